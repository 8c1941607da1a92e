"""The paper's MLP on five folds, 200 epochs each: all folds together beside a plain Lightning loop for each.

    python benchmarks/mlp_training.py [--runs 5] [--quick] [--json FILE]

The peer is what Lightning's documentation shows: a LightningModule, `DataLoader(TensorDataset(x, y), batch_size=32,
shuffle=True)` and a Trainer, here without logging, checkpoints, progress bar, model summary and sanity check. A second
peer yields its shuffled batches from tensors in memory. All sides have the same samples, standardised alike, the same
layers, Adam 1e-3, batches of 32, the same number of epochs without early stopping, and keep the weights of the lowest
validation loss. Ours trains all five folds in every run, a peer one fold, another in each: times are seconds a fold.
"""

from __future__ import annotations

import copy
import logging
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import lightning
import measure
import torch
from stacked_training import folds
from torch import Tensor, nn
from torch.utils.data import DataLoader, TensorDataset

from shipbench.data.base import load_dataset
from shipbench.predictors._features import InputFeatures
from shipbench.predictors._one_step import transitions
from shipbench.predictors.base import make_predictor, parse_spec
from shipbench.predictors.networks.stacked import Scaler, StackedRuns
from shipbench.records import Dataset

EPOCHS = 200
TARGET, ACCEPTED = 6.0, 0.15
"""Ratio to be reached, and by how much our losses may exceed the peer's in the mean over folds: seeds make that much,
folds more."""
Samples = tuple[Tensor, Tensor, Tensor, Tensor]


def samples(train: Dataset, valid: Dataset) -> Samples:
    """Standardised inputs and outputs of training and validation (x, z, x, z)."""
    part, held = (
        transitions(*StackedRuns.of([side]).members()[0], InputFeatures(side.inputs)) for side in (train, valid)
    )
    scale_x, scale_z = Scaler.fit([torch.cat(part[:2], dim=-1)]), Scaler.fit([part[2]])
    found = [
        scale(x[None])[0]
        for y, u, after in (part, held)
        for scale, x in ((scale_x, torch.cat([y, u], dim=-1)), (scale_z, after))
    ]
    return found[0], found[1], found[2], found[3]


class Plain(lightning.LightningModule):
    """The paper's network as one would write it."""

    def __init__(self, inputs: int, outputs: int, hidden: int = 100) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.Linear(inputs, hidden), nn.ReLU()]
        layers += [layer for _ in range(2) for layer in (nn.Linear(hidden, hidden), nn.ReLU())]
        self.net = nn.Sequential(*layers, nn.Linear(hidden, outputs))
        self.best, self.kept = float("inf"), copy.deepcopy(self.net.state_dict())

    def training_step(self, batch: Sequence[Tensor], _: int) -> Tensor:
        return nn.functional.mse_loss(self.net(batch[0]), batch[1])

    def validation_step(self, batch: Sequence[Tensor], _: int) -> None:
        self.log("valid", nn.functional.mse_loss(self.net(batch[0]), batch[1]))

    def on_validation_epoch_end(self) -> None:
        if (loss := float(self.trainer.callback_metrics["valid"])) < self.best:
            self.best, self.kept = loss, copy.deepcopy(self.net.state_dict())

    def configure_optimizers(self) -> torch.optim.Optimizer:
        return torch.optim.Adam(self.parameters(), lr=1e-3)


class InMemory:
    """Shuffled batches straight from tensors."""

    def __init__(self, x: Tensor, z: Tensor) -> None:
        self.x, self.z = x, z

    def __len__(self) -> int:
        return -(-len(self.x) // 32)

    def __iter__(self) -> Iterator[tuple[Tensor, Tensor]]:
        for rows in torch.randperm(len(self.x)).split(32):
            yield self.x[rows], self.z[rows]


def train_peer(data: Samples, epochs: int, in_memory: bool) -> nn.Module:
    """One fold by Lightning; returns the network with its best weights."""
    x, z, valid_x, valid_z = data
    lightning.seed_everything(0, verbose=False)
    module = Plain(x.shape[1], z.shape[1])
    loader: Any = InMemory(x, z) if in_memory else DataLoader(TensorDataset(x, z), batch_size=32, shuffle=True)
    trainer = lightning.Trainer(
        accelerator="cpu", max_epochs=epochs, logger=False, enable_checkpointing=False, enable_progress_bar=False,
        enable_model_summary=False, num_sanity_val_steps=0,
    )  # fmt: skip
    trainer.fit(module, loader, DataLoader(TensorDataset(valid_x, valid_z), batch_size=1024))
    module.net.load_state_dict(module.kept)
    return module.net


def train_ours(pairs: list[tuple[Dataset, Dataset]], epochs: int) -> list[nn.Module]:
    """All folds together; returns their networks."""
    models = [make_predictor(parse_spec(f"mlp[epochs={epochs},patience=1000]")) for _ in pairs]
    type(models[0]).fit_group(models, [t for t, _ in pairs], [v for _, v in pairs], [0] * len(pairs))
    return [network(model._arrays()) for model in models]


def network(arrays: dict[str, Any]) -> nn.Module:
    """The fitted member as plain layers."""
    weights = [torch.as_tensor(v[0]).T for k, v in arrays.items() if k.endswith("weight")]
    biases = [torch.as_tensor(v[0, 0]) for k, v in arrays.items() if k.endswith("bias")]
    net = Plain(weights[0].shape[1], weights[-1].shape[0], weights[0].shape[0]).net
    with torch.no_grad():
        for layer, weight, bias in zip(net[::2], weights, biases, strict=True):
            layer.weight.copy_(weight)
            layer.bias.copy_(bias)
    return net


@torch.no_grad()
def losses(nets: Sequence[nn.Module], data: Sequence[Samples]) -> tuple[float, float]:
    """Mean squared error on training and validation, mean over folds."""
    found = [
        [float((net(x) - z).square().mean()) for x, z in (d[:2], d[2:])] for net, d in zip(nets, data, strict=True)
    ]
    mean = torch.tensor(found).mean(0)
    return float(mean[0]), float(mean[1])


def main() -> None:
    """Both peers."""
    warnings.filterwarnings("ignore", module="lightning")
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
    given = measure.options(__doc__)
    measure.header(given, "lightning")
    epochs = 2 if given.quick else EPOCHS
    pairs = folds(load_dataset("harbour90"))
    data = [samples(*pair) for pair in pairs]
    train_ours(pairs, 1)
    for in_memory in (False, True):
        ours: list[nn.Module] = []
        peers: dict[int, nn.Module] = {}
        train_peer(data[0], 1, in_memory)

        def stacked(kept: list[nn.Module] = ours) -> None:
            kept[:] = train_ours(pairs, epochs)

        def plain(kept: dict[int, nn.Module] = peers, in_memory: bool = in_memory) -> None:
            kept[len(kept) % len(pairs)] = train_peer(data[len(kept) % len(pairs)], epochs, in_memory)

        loader = (
            "batches from tensors in memory"
            if in_memory
            else "DataLoader(TensorDataset(x, z), batch_size=32, shuffle=True)"
        )
        measure.compare(
            f"mlp, {epochs} epochs of {len(data[0][0])} samples, seconds a fold",
            measure.Side("MLP.fit_group(5 models, 5 folds)", stacked, calls=len(pairs)),
            measure.Side(f"lightning.Trainer(max_epochs={epochs}).fit(module, {loader})", plain),
            given,
            target=None if in_memory else TARGET,
            warm=False,
        )
        done = sorted(peers)
        a, b = (
            losses([ours[i] for i in done], [data[i] for i in done]),
            losses([peers[i] for i in done], [data[i] for i in done]),
        )
        for side, pair in (("ours", a), ("peer", b)):
            print(f"  {side} loss, mean of folds {done}: training {pair[0]:.6f}, validation {pair[1]:.6f}")
        # the weights kept are those of the best validation; how far training went on is a matter of the epoch that this
        # was
        measure.agree(
            "validation loss, ours above the peer's by a share of", a[1] / b[1] - 1.0, 1.0 if given.quick else ACCEPTED
        )


if __name__ == "__main__":
    sys.exit(main())
