"""A simulator of the user's own, a function `simulate(s0, U, dt) -> S`, as a model; nothing of it is fitted.

It is the spec `sim.py:simulate`, or an object in memory. A class with a method `simulate` is accepted alike.
"""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np

from ..errors import InputError
from ..names import brief
from ..records import Dataset
from ..registry import reason
from ..signals import COMMANDS, STATES
from .context import Context, wants_context

_log = logging.getLogger(__name__)
_CALL = "simulate(s0, U, dt)"
_ROUNDING = 1e-4
"""Difference of two answers to the same question, of the size of the signal, that rounding may make."""


class Simulator:
    """Model of a simulator `simulate(s0, U, dt) -> S`, for a batch or for one run at a time.

    Shapes: s0 (batch, 10), U (batch, K, inputs), dt [s], S (batch, K, 10) with S[:, k] at t_k+1; or s0 (10,), U (K,
    inputs) and S (K, 10).

    A function with an argument `context` is given the `Context` of the runs. `settings` are further arguments of the
    function, by name. Its attribute `fitted_to`, if any, is the fingerprint of a data set whose runs it knows. A run on
    which the function raises has no states (NaN); the others go on.

    Raises:
        InputError: the function cannot be called with (s0, U, dt), or has no argument of a setting's name.
    """

    seeded = False
    learns = False

    def __init__(self, function: Callable[..., Any], settings: Mapping[str, Any] | None = None) -> None:
        self.function, self.settings = function, dict(settings or {})
        self.name = getattr(function, "__name__", type(function).__name__)
        self.fitted_to = str(getattr(function, "fitted_to", ""))
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
            ValueError: it raises on every run, returns another shape, or other states for the same run asked twice.
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
            return self._found_out(s0, U, context)
        return self._answers(s0, U, context)

    def describe(self) -> str:
        """First line of the function's docstring, and its settings."""
        said = (inspect.getdoc(self.function) or "").strip().partition("\n")[0]
        return "\n".join([f"simulator {self.name}, not fitted", *([said] if said else []), *self._set()])

    def _set(self) -> list[str]:
        return [f"{key} = {value}" for key, value in self.settings.items()]

    def _found_out(self, s0: np.ndarray, U: np.ndarray, context: Context | None) -> np.ndarray:
        """States of all runs, and from now on whether the function takes one run at a time.

        One run is asked twice, so that what the function keeps from call to call shows, and then as a batch of one. A
        function that takes both is asked for batches, which are faster.
        """
        faults: dict[str, str] = {}
        for self._single, form in ((True, "one run"), (False, "a batch")):
            for i in range(len(s0)):
                try:
                    first, again = (self._row(i, s0, U, context) for _ in range(2))
                except Exception as error:  # a stranger's function may raise anything
                    faults.setdefault(form, reason(error).rstrip("."))
                    continue
                self._check_repeated(first, again)
                self._single = self._single and not self._takes_batches(first, i, s0, U, context)
                return self._answers(s0, U, context)
        self._single = None
        told = list(dict.fromkeys(faults.values()))
        why = f"{told[0]}." if len(told) == 1 else " ".join(f"On {form}: {text}." for form, text in faults.items())
        raise ValueError(f"{_CALL} of {self.name} fails. {why} Accepted: S (K, 10) of one run, or (batch, K, 10)")

    def _check_repeated(self, first: np.ndarray, again: np.ndarray) -> None:
        if (apart := _apart(first, again)) is not None:
            k, column = apart
            self._single = None
            raise ValueError(
                f"{_CALL} of {self.name} returns other states when the same run is asked again: {STATES[column]} is "
                f"{again[k, column]:.6g} in place of {first[k, column]:.6g} at time step {k + 1}. Accepted: the same "
                "answer to the same question. Begin each call anew from s0, and draw random numbers from a seed in the "
                "function"
            )

    def _takes_batches(self, first: np.ndarray, i: int, s0: np.ndarray, U: np.ndarray, context: Context | None) -> bool:
        """Whether a function of one run gives the same states `first` (K, 10) of run `i` for a batch of it alone."""
        rows = None if context is None else context.rows([i])
        try:
            return _apart(first, self._asked(s0[i : i + 1], U[i : i + 1], rows)[0]) is None
        except Exception:  # a stranger's function may raise anything; it takes one run
            return False

    def _answers(self, s0: np.ndarray, U: np.ndarray, context: Context | None) -> np.ndarray:
        """States of all runs; NaN where the function raises.

        Raises:
            Exception: that of the first run, where it raises on every run.
        """
        if not self._single:
            try:
                return self._asked(s0, U, context)
            except Exception as error:  # one run may be enough to fail them all: each gets its chance alone
                if len(s0) == 1:
                    raise
                _log.debug("the batch fails: %s", reason(error))
        S, faults = np.full((*U.shape[:-1], len(STATES)), np.nan), dict[int, Exception]()
        for i in range(len(s0)):
            try:
                S[i] = self._row(i, s0, U, context)
            except Exception as error:  # a stranger's function may raise anything
                faults[i] = error
        if len(faults) == len(s0):
            raise faults[0]
        if faults:
            i, fault = next(iter(faults.items()))
            run = context.runs[i] if context is not None else f"row {i}"
            _log.warning(
                "warning: %s fails in %d of %d runs, which have no states: %s: %s",
                self.name, len(faults), len(s0), run, reason(fault),
            )  # fmt: skip
        return S

    def _row(self, i: int, s0: np.ndarray, U: np.ndarray, context: Context | None) -> np.ndarray:
        """States (K, 10) of a run, asked alone."""
        rows = None if context is None else context.rows([i])
        if self._single:
            return self._asked(s0[i], U[i], rows)
        return self._asked(s0[i : i + 1], U[i : i + 1], rows)[0]

    def _asked(self, s0: np.ndarray, U: np.ndarray, context: Context | None) -> np.ndarray:
        more = self.settings | ({"context": context} if wants_context(self.function) else {})
        S = np.array(self.function(s0.copy(), U.copy(), self.dt, **more), dtype=float)
        expected = (*U.shape[:-1], len(STATES))
        if S.shape != expected:
            raise ValueError(f"{_CALL} returned the shape {S.shape} for U {U.shape}; accepted: {expected}, without s0")
        return S


def _apart(first: np.ndarray, again: np.ndarray) -> tuple[int, int] | None:
    """First step and column where two answers (K, 10) to one question differ by more than rounding, or None."""
    size = np.max(np.where(np.isfinite(first), np.abs(first), 0.0), axis=0)
    with np.errstate(invalid="ignore"):
        other = np.abs(first - again) > _ROUNDING * size + 1e-9
    other |= np.isfinite(first) != np.isfinite(again)
    if not other.any():
        return None
    k, column = np.argwhere(other)[0]
    return int(k), int(column)


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
