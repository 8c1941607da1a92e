"""Every number by which estimation decides. Lengths, times and forces that go with the ship are for 130 m, scaled by
Froude's law."""

from __future__ import annotations

from ..thresholds import Threshold, Thresholds

_ANOTHER_MODEL = "least gain of correlated noise, or of a ship of another size"
_BETWEEN_SHIPS = "ordinary-differences-between-ships"

THRESHOLDS = Thresholds(
    # evidence that is asked
    Threshold("evidence", 10.0, "2 log evidence", "least gain, and lead, of what the library names", "evidence-asked"),
    Threshold("evidence_of_another_model", 100.0, "2 log evidence", _ANOTHER_MODEL, "evidence-asked"),
    Threshold("values_per_run", 14.0, "2 log evidence", "cost of one value a run", "cost-of-values-per-run"),
    # probabilities and distances
    Threshold("huber_knee", 3.5, "spreads", "distance from which a value is not normal", "distances-from-the-ordinary"),
    Threshold("doubtful_distance", 5.0, "spreads", "distance of a doubtful value", "distances-from-the-ordinary"),
    Threshold("outlying_parameter", 8.0, "spreads", "distance of an outlier", "distances-from-the-ordinary"),
    Threshold("outlying_sum", 160.0, "squared spreads", "sum at which a ship is an outlier", "outlying-ships"),
    # shares of evidence, and what is reported
    Threshold("reported_share", 0.05, "share", "least part of a whole that is reported", "what-is-reported"),
    # sizes that matter
    Threshold("form_of_behaviour", 0.0125, "share", "error of a fitted form in speed, turns", "sizes-of-calibration"),
    Threshold("noticeable_force", 0.14, "force scales", "size of a practically significant force", "latent-force"),
    # record and runs
    Threshold("segment_length", 60.0, "s at 130 m", "length of a segment of the record", "chosen-by-judgement"),
    Threshold("sample_interval", 1.0, "s at 130 m", "interval to which fast records are averaged", "segments"),
    Threshold("segments_per_outlier", 100, "segments", "of which one may be an outlier", "chosen-by-judgement"),
    Threshold("wave_correlation", 0.1, "autocorrelation", "swing from which waves are tried", "noise-of-sensors"),
    Threshold("deep_water", 10.0, "draughts", "depth from which water counts as deep", "segments"),
    # priors
    Threshold("ordinary_spread", 0.3, "share", "spread of hull derivatives and time constants", _BETWEEN_SHIPS),
    Threshold("hull_change_linear", 0.5, "share", "decrease of Y_v, N_v, N_r to approach zero", _BETWEEN_SHIPS),
    Threshold("hull_on_regressions", 0.1, "share", "of the spread: a hull on the regressions", "chosen-by-judgement"),
    # limits of work and numerics, which decide no name by themselves
    Threshold("most_steps", 24_000, "steps", "limit of all segments together", "segments"),
    Threshold("segments_for_noise", 200, "segments", "segments for noise and actuator dynamics", "chosen-by-judgement"),
    Threshold("long_segment", 5, "segments", "length of pieces for actuator dynamics", "chosen-by-judgement"),
    Threshold("wave_lag", 12, "samples", "longest lag at which residuals show waves", "chosen-by-judgement"),
    Threshold("swell_lag", 30, "samples", "longest lag at which the latent force shows a swell", "chosen-by-judgement"),
    Threshold("swell_correlation", 0.2, "autocorrelation", "rise that shows a swell", "noise-of-sensors"),
    Threshold("unconverged_excess", 30.0, "2 log posterior", "excess of a fit that has not converged", "convergence"),
    Threshold("led_astray", 100.0, "2 log posterior", "excess from which free steps are taken back", "convergence"),
    Threshold("least_spread", 0.1, "scales", "least sd of latent force and noise", "chosen-by-judgement"),
    Threshold("most_latent_force", 30.0, "force scales", "greatest sd of the latent force", "chosen-by-judgement"),
    Threshold("initial_state_precision", 1e-4, "1 / variance", "of the prior of initial states", "chosen-by-judgement"),
)
