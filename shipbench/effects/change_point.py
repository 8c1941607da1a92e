"""Something changed: another effect that is absent at first and present from a run on, or from a time within every run
on.

`EFFECT.of(inner, from_run=12)` is the effect that a model or a simulation takes; its values are those of the inner
effect. Before the change the amplitudes are zero (shape parameters are kept), so that what was there all along stays in
the model as itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..errors import InputError
from ..ops import Array, where
from ..physics.actuators import Gear
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect
from .traits import Traits


class ChangePoint(Effect):
    family = "time"
    summary = "an effect that begins at a run or at a time"
    phrase = "a change that begins at run number {from_run}"
    source = "Page (1955), Biometrika 42, 523-527: change of a mean from a run or time on"
    traits = Traits(search="change", describes_data=True, wraps=True, local=True)
    parameters = ()
    separate = "repeat the first run's manoeuvre at the end of the trials"

    def __init__(self) -> None:
        self.inner: Effect | None = None
        self.from_run: int | None = None
        self.from_time: float | None = None
        self.rows: np.ndarray | None = None

    def of(
        self,
        effect: Effect,
        *,
        from_run: int | None = None,
        from_time: float | None = None,
        rows: Sequence[int] | np.ndarray | None = None,
    ) -> ChangePoint:
        """Effect `effect` from the run number `from_run` (0 is the first) or from `from_time` [s] after the beginning
        of every run.

        Args:
            rows: number of the run of each row (simulated run, segment) where rows are not the runs in order; values
                and flow have rows last.

        Raises:
            InputError: not just one of `from_run`, `from_time` is given, a cause that is no force shall begin within
                runs, or `effect` is a change.
        """
        if (from_run is None) == (from_time is None):
            raise InputError(
                f"effect '{self.name}': from_run = {from_run}, from_time = {from_time}; give one of the two."
            )
        if isinstance(effect, ChangePoint):
            raise InputError(
                f"effect '{self.name}': the effect that changes is '{effect.name}' itself; give one of the others."
            )
        if from_time is not None and effect.enters != "force":
            raise InputError(
                f"effect '{self.name}': '{effect.name}' enters as {effect.enters}, from_time = {from_time}; only "
                "forces can begin within a run. "
                "Use from_run."
            )
        changed = ChangePoint()
        changed.inner, changed.from_run, changed.from_time = effect, from_run, from_time
        changed.rows = None if rows is None else np.asarray(rows)
        for key in ("parameters", "per_run", "vector", "separate", "moves_flow"):
            setattr(changed, key, getattr(effect, key))
        begins = f"run {from_run}" if from_time is None else f"{from_time:g} s"
        vars(changed)["summary"] = f"{effect.name} from {begins} on"
        return changed

    @property
    def enters(self) -> str:
        return self._inner().enters

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        inner = self._inner()
        if inner.enters == "force":
            inner.force(e, s, self._gated(q, s.t, s.u), ship)

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        inner = self._inner()
        if inner.enters == "gear":
            inner.gear(gears, self._gated(q, 0.0, None))

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        inner = self._inner()
        return inner.measure(S, self._gated(q, 0.0, S[:, 0, 0]), dt) if inner.enters == "sensor" else S

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        return self._inner().settings(positions, ship)

    def public(self, q: Sequence[float]) -> dict[str, float]:
        return self._inner().public(q) | self._begins()

    def units(self) -> dict[str, str]:
        return self._inner().units() | {key: "s" if key == "from_time" else "1" for key in self._begins()}

    def internal(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """Values `q` of the inner effect; its beginning may be repeated.

        Raises:
            InputError: as the inner effect, or the change shall begin elsewhere than this effect does.
        """
        begins = self._begins()
        for key, value in begins.items():
            if values.get(key, value) != value:
                raise InputError(
                    f"effect '{self.name}': {key} = {values[key]:g}, this one begins at {value:g}; make another one "
                    "with `of`."
                )
        return self._inner().internal({k: v for k, v in values.items() if k not in begins})

    def _inner(self) -> Effect:
        if self.inner is None:
            raise InputError(
                f"effect '{self.name}' does not say what changes; use EFFECT.of(effect, from_run=...) or of(effect, "
                "from_time=...)."
            )
        return self.inner

    def _begins(self) -> dict[str, float]:
        return (
            {"from_run": float(self.from_run)}
            if self.from_run is not None
            else {"from_time": float(self.from_time or 0.0)}
        )

    def _gated(self, q: Sequence[Array], t: Array, like: Array) -> tuple[Array, ...]:
        """The values with the amplitudes zero before the change; the last axis of `like`, or of the values, is that of
        the rows."""
        gate = self._after_run(q, like) if self.from_time is None else self._after_time(t, self.from_time)
        return tuple(v if p.shape else v * gate for v, p in zip(q, self._inner().parameters, strict=True))

    def _after_time(self, t: Array, begins: float) -> Array:
        if isinstance(t, float | int):
            return float(t >= begins)
        return where(t >= begins, 1.0 + 0.0 * t, 0.0 * t)

    def _after_run(self, q: Sequence[Array], like: Array) -> np.ndarray:
        rows = self.rows
        if rows is None:
            lengths = [v.shape[-1] for v in (like, *q) if isinstance(v, np.ndarray) and v.ndim]
            rows = np.arange(lengths[0]) if lengths else None
        if rows is None or self.from_run is None:
            raise InputError(
                f"effect '{self.name}': one number, and no runs to tell apart; give one value per run, or `rows` to "
                "`of`."
            )
        return (rows >= self.from_run).astype(float)


EFFECT = ChangePoint()
