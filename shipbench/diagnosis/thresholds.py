"""Every number by which the diagnosis decides. Lengths, times and forces that go with the ship are for 130 m, scaled by
Froude's law.

One question has one number. Numbers of single effects are traits of these effects (`effects/traits.py`).
"""

from __future__ import annotations

from statistics import NormalDist

from ..thresholds import Threshold, Thresholds

_ANOTHER_MODEL = "least gain of correlated noise, or of a ship of another size"
_BEYOND = "least gain of unknown forces, and of other signs or records of actuators"
_MISFIT = "least gain of a form of the hull, or of forces of runs, that the model lacks"
_BETWEEN_SHIPS = "ordinary-differences-between-ships"

THRESHOLDS = Thresholds(
    # evidence that is asked
    Threshold("evidence", 10.0, "2 log evidence", "least gain, and lead, of what the library names", "evidence-asked"),
    Threshold("evidence_beyond_library", 20.0, "2 log evidence", _BEYOND, "evidence-asked"),
    Threshold("evidence_of_misfit", 30.0, "2 log evidence", _MISFIT, "evidence-asked"),
    Threshold("evidence_of_another_model", 100.0, "2 log evidence", _ANOTHER_MODEL, "evidence-asked"),
    Threshold("evidence_of_run_values", 50.0, "2 log evidence", "asked besides of one value a run", "evidence-asked"),
    Threshold("values_per_run", 14.0, "2 log evidence", "cost of one value a run", "cost-of-values-per-run"),
    Threshold("off_form", 0.02, "share", "of the hull's evidence, asked besides where ships differ", "evidence-asked"),
    Threshold("off_form_of_unknown", 14.0, "times", "that share, asked of an unknown force", "unknown-forces"),
    # probabilities and distances
    Threshold("error_probability", 0.05, "probability", "of an error in one test", "probabilities-of-error"),
    Threshold("error_probability_of_many", 1e-5, "probability", "of one among many tests", "probabilities-of-error"),
    Threshold("huber_knee", 3.5, "spreads", "distance from which a value is not normal", "distances-from-the-ordinary"),
    Threshold("doubtful_distance", 5.0, "spreads", "distance of a doubtful value", "distances-from-the-ordinary"),
    Threshold("outlying_parameter", 8.0, "spreads", "distance of an outlier", "distances-from-the-ordinary"),
    Threshold("doubtful_sum", 75.0, "squared spreads", "sum from which the ship file is doubtful", "ship-file"),
    Threshold("outlying_sum", 160.0, "squared spreads", "sum at which a ship is an outlier", "outlying-ships"),
    # shares of evidence, and what is reported
    Threshold("minor_share", 0.1, "share", "of the best evidence, below which a rest is minor", "shares-of-evidence"),
    Threshold("prediction_share", 0.4, "share", "of its gain that a linear prediction shows", "shares-of-evidence"),
    Threshold("change_without_one_run", 0.25, "share", "of a change's score left without any one run", "changes"),
    Threshold("alike_runs", 0.35, "share", "of runs alike before and after: always asked", "chosen-by-judgement"),
    Threshold("reported_share", 0.05, "share", "least part of a whole that is reported", "what-is-reported"),
    Threshold("reported_ratio", 1.3, "times", "least ratio that is reported", "what-is-reported"),
    Threshold("heading_sailed", 2.0, "deg", "to a sailed heading: farthest point of a curve", "chosen-by-judgement"),
    # sizes that matter
    Threshold("noticeable_force", 0.14, "force scales", "size of a practically significant force", "latent-force"),
    Threshold("error_size", 0.3, "sd of ordinary noise", "least size of an unknown error", "unknown-forces"),
    Threshold("delay_beside_delay", 0.6, "typical sizes", "least delay beside that of a sensor", "sizes-that-matter"),
    Threshold("along_the_normal", 0.1, "rad", "from a bank's normal: wind or current mends its law", "a-bank"),
    # record and runs
    Threshold("least_runs", 5, "runs", "least number for a cause to be named", "chosen-by-judgement"),
    Threshold("least_samples", 300, "samples", "least number for a cause to be named", "chosen-by-judgement"),
    Threshold("most_parts", 24, "parts", "greatest number into which long runs are cut", "chosen-by-judgement"),
    Threshold("run_duration", 120.0, "s at 130 m", "duration of a run: horizon, least part", "chosen-by-judgement"),
    Threshold("segment_length", 60.0, "s at 130 m", "length of a segment of the record", "chosen-by-judgement"),
    Threshold("sample_interval", 1.0, "s at 130 m", "interval to which fast records are averaged", "segments"),
    Threshold("segments_per_outlier", 100, "segments", "of which one may be an outlier", "chosen-by-judgement"),
    Threshold("contradiction_least_way", 0.1, "ship lengths", "least way of a piece that is judged", "record-errors"),
    Threshold("contradiction_least_turn", 15.0, "deg", "least turn of a piece that is judged", "record-errors"),
    Threshold("derived_low_frequencies", 2, "frequencies", "number of lowest ones that are compared", "derived-speeds"),
    Threshold("derived_least_track", 0.02, "m at 130 m", "errors above those of the integration", "derived-speeds"),
    Threshold("derived_least_heading", 0.02, "deg", "errors above those of the integration", "derived-speeds"),
    Threshold("wave_correlation", 0.1, "autocorrelation", "swing from which waves are tried", "noise-of-sensors"),
    Threshold("deep_water", 10.0, "draughts", "depth from which water counts as deep", "segments"),
    # priors
    Threshold("ordinary_spread", 0.3, "share", "spread of hull derivatives and time constants", _BETWEEN_SHIPS),
    Threshold("hull_change_linear", 0.5, "share", "decrease of Y_v, N_v, N_r to approach zero", _BETWEEN_SHIPS),
    Threshold("hull_on_regressions", 0.1, "share", "of the spread: a hull on the regressions", "chosen-by-judgement"),
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
    Threshold("most_steps", 24_000, "steps", "limit of all segments together", "segments"),
    Threshold("segments_for_noise", 200, "segments", "segments for noise and actuator dynamics", "chosen-by-judgement"),
    Threshold("long_segment", 5, "segments", "length of pieces for actuator dynamics", "chosen-by-judgement"),
    Threshold("wave_lag", 30, "samples", "longest lag at which waves are seen", "chosen-by-judgement"),
    Threshold("causes", 6, "1", "greatest number of causes", "chosen-by-judgement"),
    Threshold("refits", 4, "1", "number of candidates of a kind that are refitted", "chosen-by-judgement"),
    Threshold("periods", 60, "1", "greatest number of periods", "chosen-by-judgement"),
    Threshold("waves", 25, "1", "most waves in twice the extent of the places", "chosen-by-judgement"),
    Threshold("folds", 5, "parts", "number of training parts of the held-out gain", "chosen-by-judgement"),
    Threshold("correction_rounds", 3, "rounds", "of corrections after which errors are refused", "record-errors"),
    Threshold("correlation_lags", 10, "samples", "greatest lag of correlations of residuals", "chosen-by-judgement"),
    Threshold("tie", 0.5, "2 log evidence", "in which two fits are equal, or one still converges", "refits"),
    Threshold("unconverged_excess", 30.0, "2 log posterior", "excess of a fit that has not converged", "convergence"),
    Threshold("least_spread", 0.1, "scales", "least sd of latent force and noise", "chosen-by-judgement"),
    Threshold("most_latent_force", 30.0, "force scales", "greatest sd of the latent force", "chosen-by-judgement"),
    Threshold("initial_state_precision", 1e-4, "1 / variance", "of the prior of initial states", "chosen-by-judgement"),
)
"""Thresholds by the question that they answer."""


def standard_errors(name: str) -> float:
    """Distance from zero, in standard errors, that is exceeded by chance with a probability of the table, two-sided."""
    return -NormalDist().inv_cdf(0.5 * THRESHOLDS.value(name))
