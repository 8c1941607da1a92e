"""Stacked training with Lightning: the folds and seeds of one network train together.

The loss is the sum over members of each member's own loss and Adam works element by element, so that a member's result
is that of a separate training. Each member draws from its own generator. Early stopping is per member: the best weights
of each are kept, and training continues until the last member stops.

One Lightning batch is a chunk: all minibatches up to the next validation, stepped through with manual optimisation. The
overhead of a Lightning batch then occurs once per validation, not once per minibatch of a small network.
"""

from __future__ import annotations

import logging
import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import lightning
import torch
from torch import Tensor, nn

from ...errors import WorkError
from ...steps import within


@dataclass(frozen=True)
class Chunk:
    """Minibatches up to the next validation, used once; `ended` (members,) marks the members whose epoch ends there."""

    minibatches: Iterable[Any]
    ended: Tensor


class StackedTask(nn.Module, ABC):
    """Training task: parameters with a leading member axis, the losses of a minibatch and the validation scores."""

    members: int

    @property
    def device(self) -> torch.device:
        """Device of the parameters."""
        return next(self.parameters()).device

    @abstractmethod
    def chunks(self) -> Iterator[Chunk]:
        """Training, cut at the validations."""

    @abstractmethod
    def losses(self, minibatch: Any) -> Tensor:
        """Training loss of every member (members,)."""

    @abstractmethod
    def scores(self) -> Tensor:
        """Validation score of every member (members,), smaller is better."""


@dataclass(frozen=True)
class Recipe:
    """Settings of the training.

    Args:
        lr: Adam's step size, or a cosine from it to `lr * lr_end` over `chunks` chunks if that is set.
        patience, min_delta: a member stops when its score has not fallen by `min_delta` for `patience` validations.
        clip: greatest gradient norm of a member, if set.
        weight_decay: decoupled (AdamW), 0 for plain Adam.
        device: "cpu", "cuda" or "cuda:1".
        threads: of torch while it trains; None leaves them.
        epochs: of every member at most, for the progress, where chunks are no epochs.
    """

    lr: float = 1e-3
    patience: int | None = None
    min_delta: float = 0.0
    clip: float | None = None
    weight_decay: float = 0.0
    chunks: int | None = None
    lr_end: float = 1.0
    device: str = "cpu"
    threads: int | None = None
    epochs: int | None = None


class BestWeights:
    """Early stopping per member: the weights of the lowest score until the member stops."""

    def __init__(self, task: StackedTask, patience: int | None, min_delta: float) -> None:
        self.patience, self.min_delta = patience, min_delta
        self.best = {k: p.detach().clone() for k, p in task.named_parameters()}
        self.score = torch.full((task.members,), math.inf, dtype=torch.float64)
        self.reference = self.score.clone()
        self.waited = torch.zeros(task.members, dtype=torch.long)
        self.validations = torch.zeros(task.members, dtype=torch.long)

    @property
    def stopped(self) -> Tensor:
        """Whether each member has stopped (members,)."""
        return (
            torch.zeros_like(self.waited, dtype=torch.bool) if self.patience is None else self.waited >= self.patience
        )

    def update(self, task: StackedTask, scores: Tensor, ended: Tensor) -> None:
        """Update the best weights with the `scores` of the members whose epoch `ended` (both (members,))."""
        scores = scores.detach().double().cpu()
        counts = ended & ~self.stopped
        better = counts & (scores < self.score)
        if better.any():
            for name, parameter in task.named_parameters():
                self.best[name][better] = parameter.detach()[better]
        self.score = torch.where(better, scores, self.score)
        enough = counts & (scores < self.reference - self.min_delta)
        self.reference = torch.where(enough, scores, self.reference)
        self.waited = torch.where(enough, 0, self.waited + counts.long())
        self.validations += counts.long()

    def restore(self, task: StackedTask) -> None:
        """Put the best weights back into `task`."""
        with torch.no_grad():
            for name, parameter in task.named_parameters():
                parameter.copy_(self.best[name])


class _Training(lightning.LightningModule):
    """One chunk per Lightning batch, manual optimisation inside."""

    def __init__(self, task: StackedTask, recipe: Recipe) -> None:
        super().__init__()
        self.automatic_optimization = False
        self.task, self.recipe = task, recipe
        self.done = 0
        self.watch: BestWeights | None = None

    def configure_optimizers(self) -> torch.optim.Optimizer:
        fused = self.recipe.device.partition(":")[0] in ("cpu", "cuda")
        if self.recipe.weight_decay:
            return torch.optim.AdamW(
                self.task.parameters(), lr=self.recipe.lr, weight_decay=self.recipe.weight_decay, fused=fused
            )
        return torch.optim.Adam(self.task.parameters(), lr=self.recipe.lr, fused=fused)

    def on_fit_start(self) -> None:
        self.watch = BestWeights(self.task, self.recipe.patience, self.recipe.min_delta)

    def transfer_batch_to_device(self, batch: Chunk, device: torch.device, dataloader_idx: int) -> Chunk:
        return batch

    def _learning_rate(self) -> float:
        if self.recipe.chunks is None:
            return self.recipe.lr
        share = 0.5 * (1.0 + math.cos(math.pi * min(1.0, self.done / max(1, self.recipe.chunks - 1))))
        return self.recipe.lr * (self.recipe.lr_end + (1.0 - self.recipe.lr_end) * share)

    def training_step(self, chunk: Chunk, _: int) -> None:
        optimizer: Any = self.optimizers(use_pl_optimizer=False)
        for group in optimizer.param_groups:
            group["lr"] = self._learning_rate()
        for minibatch in chunk.minibatches:
            optimizer.zero_grad(set_to_none=True)
            self.task.losses(minibatch).sum().backward()
            if self.recipe.clip is not None:
                clip_members(self.task.parameters(), self.recipe.clip)
            optimizer.step()
        self.done += 1
        self._validate(chunk.ended)

    @torch.no_grad()
    def _validate(self, ended: Tensor) -> None:
        watch = self.watch
        if watch is None:
            raise WorkError("training: validation before the fit has begun; call train().")
        watch.update(self.task, self.task.scores(), ended)
        total = self.recipe.epochs or self.recipe.chunks
        if total:
            epoch = self.done if self.recipe.epochs is None else int(watch.validations.max())
            within(epoch / total, f"epoch {epoch} of {total}")
        if watch.stopped.all():
            self.trainer.should_stop = True


def clip_members(parameters: Iterator[nn.Parameter], limit: float) -> None:
    """Scale each member's gradient to a norm of at most `limit`; a gradient that is not finite becomes zero (that
    member skips the step)."""
    grads = [p.grad for p in parameters if p.grad is not None]
    square = torch.stack([g.flatten(1).square().sum(1) for g in grads]).sum(0)
    factor = torch.nan_to_num(limit / (square.sqrt() + 1e-12), nan=0.0, posinf=0.0).clamp(max=1.0)
    for g in grads:
        g.mul_(factor.view(-1, *[1] * (g.dim() - 1)))
        torch.nan_to_num(g, nan=0.0, posinf=0.0, neginf=0.0, out=g)


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence Lightning's banners and hints, only while it runs."""
    loggers = [
        logging.getLogger(name)
        for name in ("lightning.pytorch", "lightning.fabric", "lightning.pytorch.utilities.rank_zero")
    ]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="lightning")
            warnings.filterwarnings(
                "ignore", category=UserWarning, message=".*(does not have many workers|GPU available|barebones).*"
            )
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def _threads(number: int | None) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(number or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def train(task: StackedTask, recipe: Recipe) -> BestWeights:
    """Train `task` in place and leave each member with its best weights, on the CPU. It writes no files and draws no
    global random number.

    Raises:
        WorkError: a member never had a finite validation score.
    """
    kind, _, number = recipe.device.partition(":")
    with _quiet(), _threads(recipe.threads):
        module = _Training(task, recipe)
        trainer = lightning.Trainer(
            accelerator="gpu" if kind == "cuda" else kind,
            devices=[int(number)] if number else 1,
            max_epochs=1,
            barebones=True,
            use_distributed_sampler=False,
        )
        trainer.fit(module, train_dataloaders=_Chunks(task))
    watch = module.watch
    if watch is None or not torch.isfinite(watch.score).all():
        failed = [] if watch is None else (~torch.isfinite(watch.score)).nonzero().flatten().tolist()
        raise WorkError(
            f"training: members {failed} never reached a finite validation score; look for outliers in the data, or "
            "lower lr."
        )
    watch.restore(task)
    task.cpu()
    return watch


class _Chunks:
    """Chunks as an iterable for Lightning."""

    def __init__(self, task: StackedTask) -> None:
        self.task = task

    def __iter__(self) -> Iterator[Chunk]:
        return self.task.chunks()


def epochs_of_samples(
    counts: Sequence[int], batch: int, epochs: int, draw: Sequence[torch.Generator]
) -> Iterator[tuple[Tensor, Tensor]]:
    """Shuffled minibatches of every member's samples, cut wherever a member ends an epoch.

    Each member's order and timing depend on its own samples only, not on those of other members. The last minibatch of
    an epoch is filled up from the beginning of the epoch's order.

    Yields:
        Indices (steps, members, batch) into each member's samples, and a mask of members whose epoch ends (members,).
    """
    steps = [math.ceil(c / batch) for c in counts]
    left: list[Tensor] = [torch.empty(0, batch, dtype=torch.long)] * len(counts)
    ended = [0] * len(counts)
    while min(ended) < epochs:
        for m, count in enumerate(counts):
            if len(left[m]) == 0:
                order = torch.randperm(count, generator=draw[m])
                left[m] = order.repeat(math.ceil(steps[m] * batch / count))[: steps[m] * batch].view(steps[m], batch)
        take = min(len(rows) for rows in left)
        index = torch.stack([rows[:take] for rows in left], dim=1)
        left = [rows[take:] for rows in left]
        over = torch.tensor([len(rows) == 0 and ended[m] < epochs for m, rows in enumerate(left)])
        ended = [e + (len(rows) == 0) for e, rows in zip(ended, left, strict=True)]
        yield index, over
