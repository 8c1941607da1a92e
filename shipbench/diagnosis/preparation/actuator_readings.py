"""Actuators whose record differs lastingly from the position that the commands give, and which of the two the motion
supports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...estimation.baseline import first_evidence
from ...estimation.laplace import Fit
from ...records import Dataset
from ...signals import ACTUATORS, MOTION
from ..actuators.record_error import CHANNELS, RecordError
from ..result import what_it_is


def judged(null: Fit, errors: Sequence[RecordError]) -> list[RecordError]:
    """Errors with the log Bayes factor of the baseline model for each record without its error."""
    if not errors:
        return []
    as_recorded, actuators = first_evidence(null.plant, null), null.plant.seg.states[..., ACTUATORS]
    return [
        replace(e, worth=first_evidence(null.plant.with_actuators(_true(actuators, [e])), null) - as_recorded)
        for e in errors
    ]


def read_rightly(dataset: Dataset, errors: Sequence[RecordError]) -> Dataset:
    """Data set without these errors."""
    runs = [
        replace(r, states=np.concatenate([r.states[:, MOTION], _true(r.states[:, ACTUATORS], errors)], axis=1))
        for r in dataset.runs
    ]
    return dataset.with_runs(runs)


def said(errors: Sequence[RecordError]) -> list[str]:
    """Warnings on these errors."""
    told = []
    for e in errors:
        what = what_it_is({"axis": e.axis, "variable": e.variable, "form": e.form})
        motion = (
            "does not show which of the two is right"
            if e.undecided
            else f"agrees with the {'command' if e.contradicted else 'record'}"
        )
        told.append(
            f"the runs show {what}: they differ by {e.size:.0%} (root mean square), however long the command is held. "
            f"The motion {motion} (log Bayes factor "
            f"{e.worth:+.1f} for the command): it is taken as "
            f"{'commanded' if e.contradicted else 'recorded'}. Check the calibration of "
            "both; delay, lag, deadband and play are judged without it."
        )
    return told


def _true(actuators: np.ndarray, errors: Sequence[RecordError]) -> np.ndarray:
    """True positions (..., 4) of the actuators for recorded ones."""
    true = actuators.copy()
    for e in errors:
        channels = list(CHANNELS[e.actuator])
        true[..., channels] = e.taken_out(actuators[..., channels])
    return true
