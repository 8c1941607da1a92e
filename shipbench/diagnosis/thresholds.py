"""Every number by which the diagnosis decides. Lengths, times and forces that go with the ship are for 130 m, scaled by
Froude's law.

One question has one number. Numbers of single effects are traits of these effects (`effects/traits.py`).
"""

from __future__ import annotations

from statistics import NormalDist

from ..estimation.thresholds import THRESHOLDS as ESTIMATION
from ..thresholds import Threshold, Thresholds

_BEYOND = "least gain of unknown forces, and of other signs or records of actuators"
_MISFIT = "least gain of a form of the hull, or of forces of runs, that the model lacks"

THRESHOLDS = Thresholds(
    *ESTIMATION.rows.values(),
    # evidence that is asked
    Threshold("evidence_beyond_library", 20.0, "2 log evidence", _BEYOND, "evidence-asked"),
    Threshold("evidence_of_misfit", 30.0, "2 log evidence", _MISFIT, "evidence-asked"),
    Threshold("evidence_of_run_values", 50.0, "2 log evidence", "asked besides of one value a run", "evidence-asked"),
    Threshold("off_form", 0.02, "share", "of the hull's evidence, asked besides where ships differ", "evidence-asked"),
    Threshold("off_form_of_large", 4.0, "times", "that share, asked of a large unknown force", "unknown-forces"),
    Threshold("off_form_of_small", 12.0, "times", "that share, asked of a noticeable unknown force", "unknown-forces"),
    Threshold("off_form_slope", 0.75, "per unit", "growth of these multiples with that share", "unknown-forces"),
    # probabilities and distances
    Threshold("error_probability", 0.05, "probability", "of an error in one test", "probabilities-of-error"),
    Threshold("error_probability_of_many", 1e-5, "probability", "of one among many tests", "probabilities-of-error"),
    Threshold("doubtful_sum", 75.0, "squared spreads", "sum from which the ship file is doubtful", "ship-file"),
    # shares of evidence, and what is reported
    Threshold("minor_share", 0.1, "share", "of the best evidence, below which a rest is minor", "shares-of-evidence"),
    Threshold("prediction_share", 0.4, "share", "of its gain that a linear prediction shows", "shares-of-evidence"),
    Threshold("change_without_one_run", 0.25, "share", "of a change's score left without any one run", "changes"),
    Threshold("alike_runs", 0.35, "share", "of runs alike before and after: always asked", "chosen-by-judgement"),
    Threshold("reported_ratio", 1.3, "times", "least ratio that is reported", "what-is-reported"),
    Threshold("heading_sailed", 2.0, "deg", "to a sailed heading: farthest point of a curve", "chosen-by-judgement"),
    # sizes that matter
    Threshold("error_size", 0.3, "sd of ordinary noise", "least size of an unknown error", "unknown-forces"),
    Threshold("delay_beside_delay", 0.6, "typical sizes", "least delay beside that of a sensor", "sizes-that-matter"),
    Threshold("along_the_normal", 0.1, "rad", "from a bank's normal: wind or current mends its law", "a-bank"),
    # record and runs
    Threshold("least_runs", 5, "runs", "least number for a cause to be named", "chosen-by-judgement"),
    Threshold("least_samples", 300, "samples", "least number for a cause to be named", "chosen-by-judgement"),
    Threshold("most_parts", 24, "parts", "greatest number into which long runs are cut", "chosen-by-judgement"),
    Threshold("run_duration", 120.0, "s at 130 m", "duration of a run: horizon, least part", "chosen-by-judgement"),
    Threshold("contradiction_least_way", 0.1, "ship lengths", "least way of a piece that is judged", "record-errors"),
    Threshold("contradiction_least_turn", 15.0, "deg", "least turn of a piece that is judged", "record-errors"),
    Threshold("derived_low_frequencies", 2, "frequencies", "number of lowest ones that are compared", "derived-speeds"),
    Threshold("derived_least_track", 0.02, "m at 130 m", "errors above those of the integration", "derived-speeds"),
    Threshold("derived_least_heading", 0.02, "deg", "errors above those of the integration", "derived-speeds"),
    # priors
    Threshold("force_prior", 0.5, "latent force", "prior sd of a force's coefficient", "chosen-by-judgement"),
    Threshold("error_prior", 3.0, "sd of ordinary noise", "prior sd of an error's coefficient", "chosen-by-judgement"),
    Threshold("shortest_period", 8.0, "s at 130 m", "shortest period of a force in time", "chosen-by-judgement"),
    Threshold("longest_swell", 1.8, "s/m^0.5", "longest wave period per root of the ship length", "unknown-forces"),
    Threshold("shortest_wave", 4.0, "ship lengths", "shortest wave over the places", "chosen-by-judgement"),
    # actuators and ship file
    Threshold("shaft_time_constant", 12.0, "s at 130 m", "greatest one of an ordinary shaft", "ordinary-actuators"),
    Threshold("shaft_rate", 2.0, "rpm/s at 130 m", "least rate of an ordinary shaft", "ordinary-actuators"),
    Threshold("rudder_time_constant", 2.0, "s at 130 m", "greatest one of an ordinary rudder", "ordinary-actuators"),
    Threshold("rudder_rate", 1.9, "deg/s at 130 m", "least rate of an ordinary rudder", "ordinary-actuators"),
    Threshold("thruster_time_constant", 4.5, "s at 130 m", "greatest one of ordinary thrusters", "ordinary-actuators"),
    Threshold("second_stage", 0.5, "share", "of that: greatest time constant of a second stage", "chosen-by-judgement"),
    Threshold("longest_delay", 10.0, "s at 130 m", "greatest delay that is looked for", "chosen-by-judgement"),
    Threshold("record_uncertainty", 0.02, "share; samples", "uncertainty of a record", "chosen-by-judgement"),
    Threshold("longest_ship", 400.0, "m", "length of the longest ships", "chosen-by-judgement"),
    Threshold("other_size_estimated", 3.0, "times", "lead of another size beside estimated parts", "another-size"),
    # limits of work and numerics, which decide no name by themselves
    Threshold("causes", 6, "1", "greatest number of causes", "chosen-by-judgement"),
    Threshold("refits", 4, "1", "number of candidates of a kind that are refitted", "chosen-by-judgement"),
    Threshold("periods", 60, "1", "greatest number of periods", "chosen-by-judgement"),
    Threshold("waves", 25, "1", "most waves in twice the extent of the places", "chosen-by-judgement"),
    Threshold("folds", 5, "parts", "number of training parts of the held-out gain", "chosen-by-judgement"),
    Threshold("correction_rounds", 3, "rounds", "of corrections after which errors are refused", "record-errors"),
    Threshold("correlation_lags", 10, "samples", "greatest lag of correlations of residuals", "chosen-by-judgement"),
    Threshold("tie", 0.5, "2 log evidence", "in which two fits are equal, or one still converges", "refits"),
)
"""Thresholds by the question that they answer."""


def standard_errors(name: str) -> float:
    """Distance from zero, in standard errors, that is exceeded by chance with a probability of the table, two-sided."""
    return -NormalDist().inv_cdf(0.5 * THRESHOLDS.value(name))
