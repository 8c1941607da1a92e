"""Passes of the preparation, in their order. A new pass is a file of this folder and one line here."""

from __future__ import annotations

from .apparent_wind import true_wind
from .base import Pass
from .derived_speeds import faults_of_derived_speeds, mark_derived_speeds
from .log_dropout import speeds_of_the_track
from .record_errors import correct_record_errors, refuse_contradictions
from .splitting import refuse_too_little, sort_by_time, split_long_runs
from .time_offsets import correct_late_velocities, correct_late_yaw_rate
from .water_speeds import speeds_over_ground

GIVEN: tuple[Pass, ...] = (
    split_long_runs,
    refuse_too_little,
    refuse_contradictions,
    sort_by_time,
    faults_of_derived_speeds,
)
"""Passes where the causes are given (an oracle): the runs are taken as recorded."""
PASSES: tuple[Pass, ...] = (
    split_long_runs,
    refuse_too_little,
    correct_record_errors,
    mark_derived_speeds,
    speeds_of_the_track,
    speeds_over_ground,
    correct_late_yaw_rate,
    true_wind,
    refuse_contradictions,
    sort_by_time,
    correct_late_velocities,
    faults_of_derived_speeds,
)
"""All passes: errors that the record itself shows are corrected before any model is fitted."""
