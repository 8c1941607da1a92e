"""Elementwise maths on numpy arrays, torch tensors and casadi expressions.

Physics is written once with these functions; the argument's type picks the back end. Only operations that all three
have are here. torch and casadi are never imported by this module: a value of theirs can only arrive once they are
loaded.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

Array = Any
"""Type of a float, numpy array, torch tensor or casadi SX/MX; all operands of one formula come from one back end (or
are floats)."""


_NUMPY = frozenset({np.ndarray, np.float64, float, int})
"""Types for which the numpy function is called at once: the loops of a simulation call it a million times."""


def _backend(*args: Array) -> str:
    torch, casadi = sys.modules.get("torch"), sys.modules.get("casadi")
    for a in args:
        if torch is not None and isinstance(a, torch.Tensor):
            return "torch"
        if casadi is not None and isinstance(a, (casadi.SX, casadi.MX, casadi.DM)):
            return "casadi"
    return "numpy"


def _tensors(*args: Array) -> list[Any]:
    """Floats and numpy arrays lifted to tensors of the dtype and device of the first tensor among `args`."""
    torch = sys.modules["torch"]
    like = next(a for a in args if isinstance(a, torch.Tensor))
    return [
        a if isinstance(a, torch.Tensor) else torch.as_tensor(a, dtype=like.dtype, device=like.device) for a in args
    ]


def _unary(numpy_name: str, torch_name: str, casadi_name: str):
    plain = getattr(np, numpy_name)

    def apply(x: Array) -> Array:
        if type(x) in _NUMPY:
            return plain(x)
        backend = _backend(x)
        if backend == "torch":
            return getattr(sys.modules["torch"], torch_name)(x)
        if backend == "casadi":
            return getattr(sys.modules["casadi"], casadi_name)(x)
        return plain(x)

    apply.__name__ = numpy_name
    apply.__doc__ = f"Elementwise `{numpy_name}`."
    return apply


def _binary(numpy_name: str, torch_name: str, casadi_name: str):
    plain = getattr(np, numpy_name)

    def apply(x: Array, y: Array) -> Array:
        if type(x) in _NUMPY and type(y) in _NUMPY:
            return plain(x, y)
        backend = _backend(x, y)
        if backend == "torch":
            return getattr(sys.modules["torch"], torch_name)(*_tensors(x, y))
        if backend == "casadi":
            return getattr(sys.modules["casadi"], casadi_name)(x, y)
        return plain(x, y)

    apply.__name__ = numpy_name
    apply.__doc__ = f"Elementwise `{numpy_name}`."
    return apply


sin = _unary("sin", "sin", "sin")
cos = _unary("cos", "cos", "cos")
exp = _unary("exp", "exp", "exp")
sqrt = _unary("sqrt", "sqrt", "sqrt")
tanh = _unary("tanh", "tanh", "tanh")
sign = _unary("sign", "sign", "sign")
absolute = _unary("abs", "abs", "fabs")
arctan2 = _binary("arctan2", "atan2", "atan2")
minimum = _binary("minimum", "minimum", "fmin")
maximum = _binary("maximum", "maximum", "fmax")


def where(condition: Array, yes: Array, no: Array) -> Array:
    """Select `yes` where `condition` holds, else `no`. Both sides are evaluated: keep both finite.

    With a torch condition at least one side must be a tensor: two plain numbers have no dtype, and torch would round
    them to float32.
    """
    if type(condition) in _NUMPY and type(yes) in _NUMPY and type(no) in _NUMPY:
        return np.where(condition, yes, no)
    backend = _backend(condition, yes, no)
    if backend == "torch":
        torch = sys.modules["torch"]
        yes, no = _tensors(yes, no)
        return torch.where(torch.as_tensor(condition, device=yes.device), yes, no)
    if backend == "casadi":
        return sys.modules["casadi"].if_else(condition, yes, no)
    return np.where(condition, yes, no)


def clip(x: Array, low: Array, high: Array) -> Array:
    """Limit `x` to [low, high]."""
    return minimum(maximum(x, low), high)


def smoothstep(x: Array, low: float, high: float) -> Array:
    """Smooth step: 0 below `low`, 1 above `high`, 3 s^2 - 2 s^3 between (continuous slope)."""
    s = clip((x - low) / (high - low), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)
