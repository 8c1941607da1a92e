"""Error of the record of an actuator beside its commands, as a function of the position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..thresholds import THRESHOLDS

CHANNELS = {"n": (0,), "delta": (1,), "F": (2, 3)}
"""Channels of the actuators that share a gear."""
FORMS = ("constant", "{}", "{0}|{0}|", "|{}|")
"""Functions of the position that the error of a record may follow."""
_VARIABLES = {"n": "revolutions", "delta": "rudder", "F": "thrusters"}


def readings(at: np.ndarray) -> np.ndarray:
    """Functions `FORMS` (4, ...) of positions (...)."""
    return np.stack([np.ones_like(at), at, at * abs(at), abs(at)])


@dataclass(frozen=True)
class RecordError:
    """Error of the record against the position that the commands give, as a function of the position, best in this
    form.

    Examples are a calibration error and a sensor that is not linear.

    score: 2 log likelihood ratio, as for effects on dynamics; size: root mean square without the zero error, relative
    to that of the record; factors (4,): of `readings`; worth: log Bayes factor of the motion for the record without it
    (where negative, the actuator does not reach its command).
    """

    actuator: str
    form: str
    score: float
    size: float
    factors: np.ndarray
    worth: float = 0.0

    @property
    def variable(self) -> str:
        """Variable on which it depends."""
        return _VARIABLES[self.actuator]

    @property
    def undecided(self) -> bool:
        """Check whether the motion leaves open which of the two is wrong."""
        return 2.0 * abs(self.worth) <= THRESHOLDS.value("evidence_beyond_library")

    @property
    def axis(self) -> str:
        """Signal that is wrong, as far as the motion identifies it."""
        which = "recorded or ordered" if self.undecided else "recorded" if self.contradicted else "ordered"
        return f"{which} {self.variable}"

    @property
    def contradicted(self) -> bool:
        """Check whether the motion contradicts the record."""
        return 2.0 * self.worth > THRESHOLDS.value("evidence_beyond_library")

    def taken_out(self, recorded: np.ndarray) -> np.ndarray:
        """Positions corrected for the error (Newton's method; the record rises with the position)."""
        _, straight, bent, split = self.factors
        true = recorded
        for _ in range(8):
            slope = np.maximum(1.0 + straight + 2.0 * bent * abs(true) + split * np.sign(true), 0.1)
            true = true - (true + np.tensordot(self.factors, readings(true), 1) - recorded) / slope
        return true
