"""Puts a network on a GPU that is not there: `python fake_gpu.py mlp`. A process of its own, for PyTorch takes a new
kind of device once and for all.

PyTorch's fake tensors know shapes and devices only; as a GPU would, they refuse an operation on tensors of two devices.
One step of training with its gradients, a validation and a prediction are gone through.
"""

from __future__ import annotations

import importlib
import sys

import numpy as np
import torch
import torchdiffeq
from torch._subclasses.fake_tensor import FakeTensor, FakeTensorMode
from torch.utils.backend_registration import _setup_privateuseone_for_python_backend

from shipbench.contract.small import small_harbour
from shipbench.predictors.base import make_predictor, parse_spec

_setup_privateuseone_for_python_backend("gpu")
GPU = torch.device("gpu:0")


class Stopped(Exception):  # noqa: N818
    """Raised in place of the training."""


def midpoint(rate, y, times, method):
    """torchdiffeq's rule with times as numbers: fake tensors have no values to look up inputs by."""
    assert times.device == y.device == GPU
    path = [y]
    for k in range(len(times) - 1):
        path.append(path[-1] + rate(k + 0.5, path[-1] + 0.5 * rate(float(k), path[-1])))
    return torch.stack(path)


class Fake(FakeTensorMode):
    """Real tensors (on the CPU) may come in and become fake ones; nothing is asked of the GPU itself."""

    avoid_device_init = True

    def __init__(self):
        super().__init__(allow_non_fake_inputs=True)


def train(module, model, runs) -> None:
    """One step and one validation on the GPU, and nothing left elsewhere."""
    caught = []

    def stop(task, recipe):
        caught.append(task)
        raise Stopped

    kept, module.train = module.train, stop
    try:
        model.fit(runs.subset(range(8)), runs.subset(range(8, 12)))
    except Stopped:
        module.train = kept
    task = caught[0]
    kept_solver, torchdiffeq.odeint = torchdiffeq.odeint, midpoint
    with Fake():
        task.to(GPU)
        assert {tensor.device for tensor in (*task.parameters(), *task.buffers())} == {GPU}
        loss = task.losses(next(first for chunk in task.chunks() for first in chunk.minibatches))
        assert (loss.device, loss.shape) == (GPU, (1,))
        loss.sum().backward()
        assert {p.grad.device for p in task.parameters()} == {GPU}
        with torch.no_grad():
            assert task.scores().device == GPU
    torchdiffeq.odeint = kept_solver


def predict(model, runs) -> None:
    """A fitted model rolls out on the GPU and brings the states back."""
    batch, fetched, cpu = runs.subset(range(12, 16)).batch(history=5), [], torch.Tensor.cpu

    def values(tensor):
        assert tensor.device.type == "cpu"
        return np.zeros(tensor.shape)

    def to_cpu(tensor):
        fetched.append(tensor.device)
        return cpu(tensor)

    maker = next((made for made in ("_network", "_residual") if hasattr(model, made)), None)
    network = getattr(model, maker)() if maker else None  # made of real tensors: fake modules change no type
    model.device = "gpu:0"
    FakeTensor.numpy, FakeTensor.cpu = values, to_cpu
    with Fake(), torch.no_grad():
        if maker:
            setattr(model, maker, lambda: network.to(GPU))
        assert model._rollout(batch.s0, batch.U, batch.history).shape == batch.truth.shape
    assert set(fetched) == {GPU}


if __name__ == "__main__":
    name = sys.argv[1]
    harbour = small_harbour(num=16, horizon=15)
    train(
        importlib.import_module(f"shipbench.predictors.{name}"),
        make_predictor(parse_spec(f"{name}[epochs=1]")),
        harbour,
    )
    fitted = make_predictor(parse_spec(f"{name}[epochs=1]")).fit(harbour.subset(range(8)), harbour.subset(range(8, 12)))
    if name == "neural_ode":
        fitted.improved = True  # else the physics predicts
    predict(fitted, harbour)
    print("all on", GPU)
