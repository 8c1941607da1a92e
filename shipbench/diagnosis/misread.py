"""Actuators whose record lastingly differs from where the commands bring them, and which of the two the motion believes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..records import Dataset
from ..signals import ACTUATORS, MOTION
from .outcome import what_it_is
from .plain import first_evidence
from .settle import Fit

CHANNELS = {"n": (0,), "delta": (1,), "F": (2, 3)}
"""Of the actuators that share a gear."""
FORMS = ("constant", "{}", "{0}|{0}|", "|{}|")
"""What the error of a record may follow."""
_VARIABLES = {"n": "revolutions", "delta": "rudder", "F": "thrusters"}
_BETTER = 10.0
"""Least log evidence of the motion for another reading of a record, as for one of another sign."""
_INVERSIONS = 3


def readings(at: np.ndarray) -> np.ndarray:
    """The `FORMS` (4, ...) of positions (...)."""
    return np.stack([np.ones_like(at), at, at * abs(at), abs(at)])


@dataclass(frozen=True)
class RecordError:
    """What the record of an actuator reads beside where its commands bring the gear, and follows the position, best in this form: a scale that is
    off, a sensor that is not linear.

    score: 2 log likelihood ratio, as of a gear's effects; size: root mean square without the zero error, relative to that of the record; factors
    (4,): of `readings`; worth: log evidence of the motion for the record without it (where negative, the gear does not go where it is sent).
    """

    actuator: str
    form: str
    score: float
    size: float
    factors: np.ndarray
    worth: float = 0.0

    @property
    def variable(self) -> str:
        """What it depends on."""
        return _VARIABLES[self.actuator]

    @property
    def axis(self) -> str:
        """What of the two is wrong: the order, where the motion speaks for the record."""
        return f"{'ordered' if self.worth < -_BETTER else 'recorded'} {self.variable}"

    @property
    def contradicted(self) -> bool:
        """Whether the motion speaks against the record beyond doubt."""
        return self.worth > _BETTER

    def taken_out(self, recorded: np.ndarray) -> np.ndarray:
        """Positions that are recorded so."""
        true = recorded
        for _ in range(_INVERSIONS):
            true = recorded - np.tensordot(self.factors, readings(true), 1)
        return true


def judged(null: Fit, errors: Sequence[RecordError]) -> list[RecordError]:
    """The errors with what it is worth to the plain model to read each record without them."""
    if not errors:
        return []
    as_recorded, actuators = first_evidence(null.plant, null), null.plant.seg.states[..., ACTUATORS]
    return [replace(e, worth=first_evidence(null.plant.with_actuators(_true(actuators, [e])), null) - as_recorded) for e in errors]


def read_rightly(dataset: Dataset, errors: Sequence[RecordError]) -> Dataset:
    """The data set without these errors."""
    runs = [replace(r, states=np.concatenate([r.states[:, MOTION], _true(r.states[:, ACTUATORS], errors)], axis=1)) for r in dataset.runs]
    return dataset.with_runs(runs)


def said(errors: Sequence[RecordError]) -> list[str]:
    """Warnings of these errors."""
    told = []
    for e in errors:
        what = what_it_is({"axis": e.axis, "variable": e.variable, "form": e.form})
        worth = f"{'better' if e.worth > 0.0 else 'worse'} by {abs(e.worth):.0f} of log evidence"
        told.append(
            f"the runs show {what}: record and order differ by {e.size:.0%} (root mean square), however long the order stands. As ordered the plain "
            f"model explains the motion {worth}: it is taken as {'ordered' if e.contradicted else 'recorded'}. Check the calibration of both; delay, "
            "lag, deadband and play are judged without it."
        )
    return told


def _true(actuators: np.ndarray, errors: Sequence[RecordError]) -> np.ndarray:
    """Positions (..., 4) of the actuators that are recorded so."""
    true = actuators.copy()
    for e in errors:
        channels = list(CHANNELS[e.actuator])
        true[..., channels] = e.taken_out(actuators[..., channels])
    return true
