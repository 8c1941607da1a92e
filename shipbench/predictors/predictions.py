"""States that another program predicted, read from files: a simulation that has been run already.

The spec is `predictions:FOLDER`. The files are read and matched to the runs of a data set by `replay.bind`; the model
itself holds arrays only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import InputError, unknown_parameter
from ..names import brief
from ..records import Dataset
from ..signals import ACTUATORS, COMMANDS, PSI, STATES, X, Y, wrap_angle
from .context import Context

NOT_COVERED = "no predicted trajectory covers it"
"""Reason in the rows of a window without a prediction."""


def size_text(value: float, unit: str) -> str:
    """Size with its unit; below a thousandth it is the rounding of a file."""
    return f"{value:.0f} {unit}" if value >= 100.0 else f"{value if value >= 1e-3 else 0.0:.3g} {unit}"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Predicted trajectory of a run on the time grid of the data set.

    Args:
        start: time of the first state in the run [s].
        states: (n, 10), order and units of `signals.STATES`, every dt; NaN in the columns of actuators that the file
            lacks.
    """

    start: float
    states: np.ndarray


@dataclass(frozen=True, eq=False)
class Matched:
    """Trajectories by id of the recorded run, and notes on reading and matching them."""

    runs: dict[str, tuple[Trajectory, ...]]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ReplayReport:
    """Start of each covered window against the measured one: distance [m] and difference of heading [deg]; `unknown`
    windows have no predicted state at their start. `notes` as in `Matched`."""

    distance: tuple[float, ...]
    heading: tuple[float, ...]
    unknown: int
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Report as plain data, for a summary."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> ReplayReport:
        """Report that `as_dict` wrote.

        Raises:
            KeyError, TypeError, ValueError: it is none.
        """
        return cls(
            tuple(float(x) for x in data["distance"]),
            tuple(float(x) for x in data["heading"]),
            int(data["unknown"]),
            tuple(str(note) for note in data["notes"]),
        )


@dataclass
class Predictions:
    """Predicted trajectories of other programs: CSV, Parquet, MATLAB or a data set, matched to the recorded runs.

    Args:
        mapping: mapping.toml that says what the columns are, as for a log; "" for that of the folder, if any.
    """

    mapping: str = ""
    name: ClassVar[str] = "predictions"
    needs: ClassVar[tuple[str, ...]] = ()
    replay: ClassVar[bool] = True
    earth_fixed: ClassVar[bool] = True
    seeded: ClassVar[bool] = False
    learns: ClassVar[bool] = False

    def __post_init__(self) -> None:
        self.path: Path | None = None
        self.matched: Matched | None = None
        self.inputs: tuple[str, ...] = COMMANDS
        self.dt = float("nan")
        self.report: ReplayReport | None = None

    def __repr__(self) -> str:
        return brief(f"<Predictions {self.path}>")

    @classmethod
    def of_file(cls, path: Path, params: dict[str, Any]) -> Self:
        """Model of a file or folder, not yet read.

        Raises:
            InputError: an unknown parameter.
        """
        if unknown := [key for key in params if key != "mapping"]:
            raise unknown_parameter("'predictions'", unknown[0], ["mapping"])
        model = cls(str(params.get("mapping", "")))
        model.path = path
        return model

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Store sample time and inputs; nothing is fitted."""
        self.dt, self.inputs = train.dt, train.inputs
        return self

    def skip_windows(self, context: Context, steps: int) -> list[str]:
        """Reason why each window of `steps` time steps has no prediction, "" where it has one."""
        reasons = []
        for i, run in enumerate(context.runs):
            if self._cut(context, i, steps) is not None:
                reasons.append("")
                continue
            lengths = [len(t.states) - 1 for t in self._matched().runs.get(run, ())]
            if not lengths:
                why = "none is of this run"
            elif max(lengths) < steps:
                why = f"those of its run last {max(lengths) * context.dt:g} s, the window {steps * context.dt:g} s"
            else:
                why = "those of its run begin after it does, or end before it"
            reasons.append(f"{NOT_COVERED}: {why}")
        return reasons

    def predict(
        self, s0: np.ndarray, U: np.ndarray, history: Any = None, *, context: Context | None = None
    ) -> np.ndarray:
        """Predicted states S (batch, K, 10) after the starts s0 (batch, 10); NaN where no trajectory covers the window.

        Of several trajectories of a run the one that starts last counts. Actuators that the file lacks are the commands
        of U (batch, K, inputs).

        Raises:
            InputError: the trajectories are not matched to runs, or an argument has another shape or is not finite.
        """
        s0, U = np.asarray(s0, dtype=float), np.asarray(U, dtype=float)
        if s0.ndim == 1:
            return self.predict(s0[None], U[None], context=None if context is None else context.rows([0]))[0]
        self._check(s0, U)
        if context is None:
            raise InputError(
                f"predictions of {self.path} belong to recorded runs, and no run is known here. Accepted: runs of a "
                "data set, as in `shipbench run`."
            )
        S = np.full((*U.shape[:2], len(STATES)), np.nan)
        apart: list[tuple[float, float]] = []
        unknown = 0
        for i, start in enumerate(s0):
            if (found := self._cut(context, i, U.shape[1])) is None:
                continue
            first, S[i] = found
            held = U[i, :, : len(COMMANDS)]
            S[i, :, ACTUATORS] = np.where(np.isnan(S[i, :, ACTUATORS]), held, S[i, :, ACTUATORS])
            if first is None or not np.isfinite(first[: PSI + 1]).all():
                unknown += 1
            else:
                turned = np.rad2deg(np.abs(wrap_angle(first[PSI] - start[PSI])))
                apart.append((float(np.hypot(first[X] - start[X], first[Y] - start[Y])), float(turned)))
        distance, heading = zip(*apart, strict=True) if apart else ((), ())
        self.report = ReplayReport(distance, heading, unknown, self._matched().notes)
        return S

    def _matched(self) -> Matched:
        if self.matched is None:
            raise InputError(
                f"predictions of {self.path} are not matched to runs yet. Accepted: `shipbench run --predictions "
                f"{self.path} -d DATASET`, or `shipbench check predictions:{self.path} -d DATASET`."
            )
        return self.matched

    def _cut(self, context: Context, row: int, steps: int) -> tuple[np.ndarray | None, np.ndarray] | None:
        """State at the start of a window (None where the trajectory begins one step later) and the states (steps, 10)
        after it; None where no trajectory covers the window."""
        for trajectory in sorted(self._matched().runs.get(context.runs[row], ()), key=lambda t: -t.start):
            k = round((float(context.start[row]) - trajectory.start) / context.dt)
            if k >= -1 and k + steps < len(trajectory.states):
                return (
                    trajectory.states[k] if k >= 0 else None,
                    trajectory.states[k + 1 : k + 1 + steps].copy(),
                )
        return None

    def _check(self, s0: np.ndarray, U: np.ndarray) -> None:
        shapes: Sequence[tuple[str, np.ndarray, bool]] = (
            ("s0", s0, s0.ndim == 2 and s0.shape[1] == len(STATES)),
            ("U", U, U.ndim == 3 and len(U) == len(s0) and U.shape[1] > 0 and U.shape[2] == len(self.inputs)),
        )
        for name, array, fits in shapes:
            if not fits:
                raise InputError(
                    f"{name} has shape {array.shape}; accepted: s0 (batch, {len(STATES)}) and U (batch, K, "
                    f"{len(self.inputs)}) with K >= 1."
                )
            if not np.isfinite(array).all():
                raise InputError(f"{name} holds values that are not finite; every value must be finite.")


PREDICTOR = Predictions
