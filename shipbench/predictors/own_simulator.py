"""A simulator of the user's own, a function `simulate(s0, U, dt) -> S`, as a model; nothing of it is fitted.

It is the spec `sim.py:simulate`, or an object in memory. A class with a method `simulate` is accepted alike.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np

from ..errors import InputError
from ..names import brief
from ..records import Dataset
from ..registry import reason
from ..signals import COMMANDS, STATES
from .context import Context, wants_context

_CALL = "simulate(s0, U, dt)"


class Simulator:
    """Model of a simulator `simulate(s0, U, dt) -> S`, for a batch or for one run at a time.

    Shapes: s0 (batch, 10), U (batch, K, inputs), dt [s], S (batch, K, 10) with S[:, k] at t_k+1; or s0 (10,), U (K,
    inputs) and S (K, 10).

    A function with an argument `context` is given the `Context` of the runs. `settings` are further arguments of the
    function, by name.

    Raises:
        InputError: the function cannot be called with (s0, U, dt), or has no argument of a setting's name.
    """

    seeded = False
    learns = False

    def __init__(self, function: Callable[..., Any], settings: Mapping[str, Any] | None = None) -> None:
        self.function, self.settings = function, dict(settings or {})
        self.name = getattr(function, "__name__", type(function).__name__)
        self.dt = float("nan")
        self.inputs: tuple[str, ...] = COMMANDS
        self._single: bool | None = None
        _check_arguments(self.name, function, self.settings)

    def __repr__(self) -> str:
        return brief(f"<Simulator {self.name}>")

    @property
    def earth_fixed(self) -> bool:
        """Whether it may know a place on earth."""
        return wants_context(self.function)

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Store sample time and inputs; nothing is fitted."""
        self.dt, self.inputs = train.dt, train.inputs
        return self

    def predict(
        self, s0: np.ndarray, U: np.ndarray, history: Any = None, *, context: Context | None = None
    ) -> np.ndarray:
        """States S (batch, K, 10) that the function returns for s0 (batch, 10) and U (batch, K, inputs).

        Raises:
            ValueError: it returns another shape, for a batch and for a run alone.
        """
        s0, U = np.asarray(s0, dtype=float), np.asarray(U, dtype=float)
        if s0.ndim == 1:
            rows = None if context is None else context.rows([0])
            return self.predict(s0[None], U[None], context=rows)[0]
        if not (np.isfinite(s0).all() and np.isfinite(U).all()):
            raise ValueError("s0 and U must be finite")
        if wants_context(self.function) and context is None:
            raise InputError(
                f"{self.name} asks for the context, and none is known here. Accepted: runs of a data set, as in "
                "`shipbench run`."
            )
        if self._single is None:
            self._single, S = self._found_out(s0, U, context)
            return S
        return self._by_run(s0, U, context) if self._single else self._whole(s0, U, context)

    def describe(self) -> str:
        """First line of the function's docstring, and its settings."""
        said = (inspect.getdoc(self.function) or "").strip().partition("\n")[0]
        return "\n".join([f"simulator {self.name}, not fitted", *([said] if said else []), *self._set()])

    def _set(self) -> list[str]:
        return [f"{key} = {value}" for key, value in self.settings.items()]

    def _found_out(self, s0: np.ndarray, U: np.ndarray, context: Context | None) -> tuple[bool, np.ndarray]:
        """Whether the function takes one run at a time, and its answer. A batch is tried first."""
        faults = []
        for single, ask in ((False, self._whole), (True, self._by_run)):
            try:
                return single, ask(s0, U, context)
            except Exception as error:  # a stranger's function may raise anything
                faults.append(reason(error))
        raise ValueError(f"{_CALL} of {self.name} fails on a batch ({faults[0]}) and on one run ({faults[1]})")

    def _whole(self, s0: np.ndarray, U: np.ndarray, context: Context | None) -> np.ndarray:
        return self._asked(s0, U, context)

    def _by_run(self, s0: np.ndarray, U: np.ndarray, context: Context | None) -> np.ndarray:
        rows = [None if context is None else context.rows([i]) for i in range(len(s0))]
        return np.stack([self._asked(*one) for one in zip(s0, U, rows, strict=True)])

    def _asked(self, s0: np.ndarray, U: np.ndarray, context: Context | None) -> np.ndarray:
        more = self.settings | ({"context": context} if wants_context(self.function) else {})
        S = np.array(self.function(s0.copy(), U.copy(), self.dt, **more), dtype=float)
        expected = (*U.shape[:-1], len(STATES))
        if S.shape != expected:
            raise ValueError(f"{_CALL} returned the shape {S.shape} for U {U.shape}; accepted: {expected}, without s0")
        return S


def _check_arguments(name: str, function: Callable[..., Any], settings: Mapping[str, Any]) -> None:
    try:
        wanted = inspect.signature(function)
    except (TypeError, ValueError):  # no signature: the call will show
        return
    more = dict(settings) | ({"context": None} if wants_context(function) else {})
    try:
        wanted.bind(None, None, None, **more)
    except TypeError as error:
        raise InputError(
            f"simulator {name}{wanted} cannot be called as {_CALL}{' with ' + ', '.join(settings) if settings else ''}"
            f": {error}. Accepted: a function of s0 (batch, 10), U (batch, K, inputs) and dt [s] that returns S "
            "(batch, K, 10)."
        ) from None


def simulator_of(part: Any, settings: Mapping[str, Any] | None = None) -> Simulator | None:
    """Model of a function, or of a class or object with a method `simulate` and without `fit`; None of anything else.

    Args:
        settings: further arguments of the function, or those with which the class is made.
    """
    settings = settings or {}
    if hasattr(part, "fit"):
        return None
    if callable(getattr(part, "simulate", None)):
        return Simulator(part(**settings).simulate) if isinstance(part, type) else Simulator(part.simulate, settings)
    return None if isinstance(part, type) or not callable(part) else Simulator(part, settings)
