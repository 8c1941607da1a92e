"""Model under check: made, fitted and evaluated on small data; and the comparison of two predictions."""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..effects.base import EFFECTS
from ..predictors.base import make_predictor
from ..predictors.context import Context, predicted
from ..records import Batch, Dataset
from ..registry import reason
from ..signals import PSI, STATES
from ..specs import Spec
from .small import copied

SEED = 3
HISTORY = 10


class Broken(Exception):  # noqa: N818 - a verdict, not an error of ours
    """Error of a broken rule; the text is the evidence."""


class NotApplicable(Exception):  # noqa: N818
    """Signal that a rule does not apply to this model or these data; the text is the reason."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """Model after `fit`, with its arguments (copies that it may have written into), the return value of `fit` and its
    duration."""

    model: Any
    train: Dataset
    valid: Dataset | None
    returned: Any
    seconds: float = 0.0


@dataclass(eq=False)
class Subject:
    """Model spec and the data of the check; results that several rules need are computed once."""

    spec: Spec
    data: Dataset
    device: str | None = None
    saved: bool = field(init=False)

    def __post_init__(self) -> None:
        self.saved = self.spec.saved

    @cached_property
    def parts(self) -> tuple[Dataset, Dataset, Dataset]:
        """Runs to fit on, to stop by, and to predict."""
        n = len(self.data)
        test = 3 if n >= 12 else 2
        return (
            self.data.subset(range(n - test - 2)),
            self.data.subset(range(n - test - 2, n - test)),
            self.data.subset(range(n - test, n)),
        )

    @cached_property
    def batch(self) -> Batch:
        """Batch of predictions that the rules compare."""
        return self.parts[2].batch()

    @property
    def few(self) -> Dataset:
        """Runs to fit on, fewer, for rules that only test whether a fit works."""
        return self.parts[0].subset(range(min(4, len(self.parts[0]))))

    def fit(self, state: int, *, train: Dataset | None = None) -> Fitted:
        """Fit a fresh model with the seed `SEED`, on `train` alone if it is given; `state` is the seed of the global
        generators meanwhile."""
        model = make_predictor(self.spec, self.device)
        if self.saved:
            return Fitted(model, self.parts[0], None, model)
        train, held = (copied(train), None) if train is not None else (copied(self.parts[0]), copied(self.parts[1]))
        began = time.perf_counter()
        with global_generators(state):
            returned = model.fit(train, held, seed=SEED)
        return Fitted(model, train, held, returned, time.perf_counter() - began)

    @cached_property
    def fitted(self) -> Fitted:
        """Model on which most rules are tested."""
        return self.fit(state=1)

    @property
    def model(self) -> Any:
        """Model of `fitted`."""
        return self.fitted.model

    @cached_property
    def S(self) -> np.ndarray:
        """Prediction of `batch`, in float64."""
        return self.ask(self.batch.s0, self.batch.U)

    def ask(
        self, s0: np.ndarray, U: np.ndarray, history: Any = None, model: Any = None, rows: slice = slice(None)
    ) -> np.ndarray:
        """Predict on copies of the arguments, in float64, shape unchecked; `rows` are those of `batch`, for the context
        that a model asks for."""
        copies = None if history is None else (history[0].copy(), history[1].copy())
        whole = Context.of(self.parts[2], 0 if history is None else history[0].shape[-2])
        context = whole.rows(range(len(whole))[rows])
        return np.array(predicted(model or self.model, s0.copy(), U.copy(), copies, context), dtype=float)

    @property
    def replay(self) -> str:
        """Reason why other starts and inputs change nothing in this model's states, or ""."""
        return (
            "the states are read from a file, and follow from no start" if getattr(self.model, "replay", False) else ""
        )

    @cached_property
    def scale(self) -> np.ndarray:
        """Size (10,) of each state for comparisons: its range of motion within the runs (1 for one that never
        moves)."""
        states = np.stack([r.states for r in self.data.runs])
        moved = np.concatenate([states[..., : PSI + 1] - states[:, :1, : PSI + 1], states[..., PSI + 1 :]], axis=-1)
        size = np.sqrt(np.mean(moved**2, axis=(0, 1)))
        size[:2] = np.max(size[:2])  # north and east alike, whatever the runs' courses
        return np.where(size > 0.0, size, 1.0)

    def same(self, a: np.ndarray, b: np.ndarray, limit: float, what: str) -> str:
        """Evidence that `a` and `b` (..., 10) agree.

        Raises:
            Broken: they differ by more than `limit` times the size of a state, or in shape.
        """
        if a.shape != b.shape:
            raise Broken(f"{what}: shapes {a.shape} and {b.shape}")
        with np.errstate(all="ignore"):
            apart = np.abs(a - b) / self.scale
        apart = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.where(np.isnan(apart), np.inf, apart))
        worst = float(apart.max(initial=0.0))
        if worst > limit:
            where = np.unravel_index(int(np.argmax(apart)), apart.shape)
            size = f"{STATES[where[-1]]} is {a[where]:.6g} against {b[where]:.6g}"
            raise Broken(f"{what}: {size} (limit {limit:g} of its size {self.scale[where[-1]]:.3g})")
        return f"{what}: " + (
            "equal bit for bit" if not limit else f"{worst:.1e} (limit {limit:g})" if worst else "no difference"
        )

    @property
    def earth_fixed(self) -> str:
        """Reason why a moved earth frame changes this model's predictions, or ""."""
        effects = [e.name for e in self.spec.effects if EFFECTS.get(e.name).family in ("environment", "time")]
        if effects:
            return f"the model has earth-fixed effects ({', '.join(effects)})"
        return (
            "the model says that it knows a place on earth (earth_fixed)"
            if getattr(self.model, "earth_fixed", False)
            else ""
        )


def attempt(action: Callable[[], np.ndarray]) -> np.ndarray | Exception:
    """Result of the action, or its exception; numpy's warnings on overflow are ignored."""
    try:
        with np.errstate(all="ignore"):
            return action()
    except Exception as error:  # a stranger's model may raise anything
        return error


def raised(error: Exception) -> str:
    """Text of an exception for the evidence."""
    return f"raised {reason(error)}"


@contextmanager
def global_generators(state: int) -> Iterator[None]:
    """Seed the global generators of random, numpy and torch; restore them afterwards. A model that draws from them does
    not follow its seed."""
    torch = sys.modules.get("torch")
    # The global state is the one that is meant.
    kept = random.getstate(), np.random.get_state(), torch.get_rng_state() if torch else None  # noqa: NPY002
    random.seed(state)
    np.random.seed(state)  # noqa: NPY002
    if torch:
        torch.manual_seed(state)
    try:
        yield
    finally:
        random.setstate(kept[0])
        np.random.set_state(kept[1])  # noqa: NPY002
        if torch and kept[2] is not None:
            torch.set_rng_state(kept[2])
