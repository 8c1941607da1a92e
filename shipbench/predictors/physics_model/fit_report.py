"""Error of fitted physics on its own training runs, beside the baseline of constant velocities (`hold`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ...records import Batch
from ...signals import COMMANDS, STATES

_N, _N_C = STATES.index("n"), COMMANDS.index("n_c")
_NOTHING = 1e-6
"""A position error [m] that is rounding."""
_RESISTANCE = frozenset({"p1", "p2", "p3"})
"""Linear, quadratic and cubic resistance: one of them at zero leaves its share to the others."""


@dataclass(frozen=True)
class FitReport:
    """Result of a fit.

    Args:
        at_bounds: symbols of the parameters that ended at their bounds.
        of: number of parameters.
        error: mean position error over the training runs [m].
        hold: the same of constant velocities [m].
        reversed_error: the same after a fit with the opposite sign of n [m]; None where that was not tried.
    """

    at_bounds: tuple[str, ...]
    of: int
    error: float
    hold: float
    reversed_error: float | None = None

    @property
    def fits(self) -> bool:
        """Whether it fits its own runs: it is better than `hold`, and where its error is more than a third of that of
        `hold`, no coefficient of the propeller or the rudder, nor the whole resistance, is at a bound."""
        telling = set(self.at_bounds) - _RESISTANCE or set(self.at_bounds) >= _RESISTANCE
        if self.error < _NOTHING:  # the ship keeps its velocities: there is nothing to be better at
            return True
        return self.error < self.hold and not (telling and self.error > self.hold / 3.0)

    @property
    def summary(self) -> str:
        """The figures in words."""
        return (
            f"{len(self.at_bounds)} of {self.of} parameters at their bounds, training error {self.error:.3g} m "
            f"(hold {self.hold:.3g} m)"
        )

    @property
    def note(self) -> str:
        """Warning for the reader, "" where the physics fits."""
        if self.fits:
            return ""
        hint = "`shipbench data check` looks at signs and units, `shipbench diagnose` at what the physics lacks."
        if self.reversed_error is not None and self.reversed_error < 0.5 * self.error:
            hint = (
                f"With the opposite sign of n the training error is {self.reversed_error:.3g} m: the shaft speed "
                "looks reversed."
            )
        return f"physics does not fit these runs: {self.summary}. {hint}"

    def as_dict(self) -> dict[str, Any]:
        """Values for a summary; an error that is not finite is None there."""
        kept = asdict(self) | {"at_bounds": list(self.at_bounds)}
        return {
            key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in kept.items()
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> FitReport:
        """Report from the values that `as_dict` returned."""
        error, hold = (np.inf if data[key] is None else float(data[key]) for key in ("error", "hold"))
        again = data.get("reversed_error")
        return cls(
            tuple(map(str, data["at_bounds"])), int(data["of"]), error, hold, None if again is None else float(again)
        )


def position_error(S: np.ndarray, batch: Batch) -> float:
    """Mean distance [m] of predicted S (batch, K, 10) from the truth; infinite where a run diverged."""
    with np.errstate(all="ignore"):
        distance = float(np.hypot(S[..., 0] - batch.truth[..., 0], S[..., 1] - batch.truth[..., 1]).mean())
    return distance if np.isfinite(distance) else np.inf


def with_reversed_shaft(report: FitReport, batch: Batch, error_on: Callable[[Batch], float]) -> FitReport:
    """Report with the error of a fit to the same runs with the opposite sign of n, where the physics does not fit."""
    if report.fits:
        return report
    s0, truth, U = batch.s0.copy(), batch.truth.copy(), batch.U.copy()
    for array, column in ((s0, _N), (truth, _N), (U, _N_C)):
        array[..., column] *= -1.0
    return replace(report, reversed_error=error_on(replace(batch, s0=s0, truth=truth, U=U)))
