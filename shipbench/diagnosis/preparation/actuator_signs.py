"""Sign errors of recorded actuators, identified by the fit of the baseline model where the motion alone does not show
them."""

from __future__ import annotations

import numpy as np

from ...checking.units import UnitFinding, check_commands
from ...estimation.baseline import first_evidence, first_fit
from ...estimation.coefficients import CENTRE, FREE, SPREAD
from ...estimation.laplace import Fit
from ...records import Dataset
from ...signals import DELTA, F_B, F_S, STATES, N
from ..thresholds import THRESHOLDS, standard_errors

_LIFT = FREE.index(5)
"""Index of the slope of the rudder's lift among the fit's parameters."""


def turned_actuators(dataset: Dataset, null: Fit) -> list[UnitFinding]:
    """Rudder, or thrusters, whose record (and command, if it agrees) has the opposite sign; empty when none is certain.

    Args:
        dataset: that was fitted.
        null: the baseline model of it.
    """
    found = _rudder(null) + _thrusters(null)
    return found + (check_commands(dataset.runs, dataset.dt, found) if found else [])


def _rudder(null: Fit) -> list[UnitFinding]:
    slope, sd = (
        CENTRE[_LIFT] + SPREAD[_LIFT] * null.solution.mean[_LIFT],
        SPREAD[_LIFT] * np.sqrt(null.solution.cov[_LIFT, _LIFT]),
    )
    if slope > -standard_errors("error_probability") * sd:
        return []
    gain = first_evidence(null.plant.turned([DELTA - N]), null) - null.evidence
    if gain < 0.0:
        return []
    text = (
        f"The fitted lift of the rudder falls with its angle, to {slope:.2g} +- {sd:.1g} of the usual slope. "
        f"{_better(gain)}"
    )
    return [UnitFinding("delta", "sign", -1.0, text)]


def _thrusters(null: Fit) -> list[UnitFinding]:
    """Sign errors of the thrusters, by the segments in which they push.

    A sign error does not act on the fit of the other segments, nor they on its own. The recorded signs are fitted also
    with the forces and the noise model of the best other signs. In few segments one fit may take for noise what another
    takes for forces.
    """
    push = null.plant.seg.states[..., [F_B, F_S]] * null.plant.seg.mask[..., None]
    used = [c for c, pushes in zip((F_B, F_S), np.any(push != 0.0, axis=(0, 1)), strict=True) if pushes]
    if not used:
        return []
    plant = null.plant.where(np.any(push != 0.0, axis=(1, 2)))
    readings = [[c] for c in used] + ([used] if len(used) > 1 else [])
    best, turned = max(
        ((first_fit(plant.turned([c - N for c in reading]), null), reading) for reading in readings),
        key=lambda x: x[0].evidence,
    )
    gain, least = best.evidence - first_evidence(plant, null), 0.5 * THRESHOLDS.value("evidence_beyond_library")
    if gain > least:
        gain = min(gain, best.evidence - first_fit(plant, null, like=best).evidence)
    return [UnitFinding(STATES[c], "sign", -1.0, _better(gain)) for c in turned] if gain > least else []


def _better(gain: float) -> str:
    return f"With the sign reversed the plain model fits the runs better (log Bayes factor {gain:.0f})."
