"""Every number by which the diagnosis decides. Lengths, times and forces that go with the ship are for 130 m, scaled by Froude's law.

Numbers of single effects are traits of these effects (`effects/traits.py`).
"""

from __future__ import annotations

from ..thresholds import Threshold, Thresholds

THRESHOLDS = Thresholds(
    # preparation
    # model and inference
    # actuators
    # selection: whether a size is sure, and matters
    Threshold("play_over_noise", 6.0, "standard deviations", "play behind a record of the rudder that is no noise of it", "sizes-that-matter"),
    Threshold("delay_beside_delay", 0.6, "typical sizes", "least delay beside that of another sensor", "sizes-that-matter"),
    Threshold("along_the_normal", 0.1, "rad", "angle to the normal of a bank within which a steady wind or current mends its law", "a-bank"),
    Threshold("doubt", 0.05, "probability", "that the size of a cause is zero, from which on it is not sure", "agreement-of-runs"),
    Threshold("doubt_of_a_change", 1e-5, "probability", "the same of a cause that begins with a run", "agreement-of-runs"),
    Threshold("against", -2.0, "2 log evidence", "of a cause without any one run, below which the other runs speak against it", "agreement-of-runs"),
    Threshold(
        "own_forces_left", 30.0, "2 log evidence", "of forces of single runs that may be left beside values of single runs", "values-of-single-runs"
    ),
    Threshold("own_forces_share", 0.1, "share", "of what values of single runs are worth that may be left besides", "values-of-single-runs"),
    # selection: screening, steps, changes
    # selection: unknown forces and errors
    # selection: the ship file
    # evaluation
)
"""All of them, in the order of the diagnosis."""
