"""Every number by which a data check decides. Values "at 130 m" are scaled by Froude's law to the ship."""

from __future__ import annotations

from ..thresholds import Threshold, Thresholds

THRESHOLDS = Thresholds(
    # errors and noise
    Threshold("chance", 1e-4, "probability", "of a finding by chance, allowed in each test", "tests-of-significance"),
    Threshold("within_error", 3.0, "standard errors", "up to which an effect may be none", "tests-of-significance"),
    Threshold("beyond_noise", 6.0, "standard deviations", "beyond which a value is no noise", "tests-of-significance"),
    Threshold("outlier_size", 8.0, "standard deviations", "least outlier or jump", "tests-of-significance"),
    Threshold("explanation_gain", 10.0, "2 log likelihood", "least gain beyond the penalty", "explanations"),
    # numbers of cases
    Threshold("occurrences", 5, "times", "least number of steps, turns or standstills", "enough-cases"),
    Threshold("windows", 12, "windows", "least number of windows that are compared", "enough-cases"),
    Threshold("regression_windows", 60, "windows", "least number for a regression of forces", "enough-cases"),
    # shares
    Threshold("most", 0.7, "share", "that is most: of squares, of samples, a correlation", "explanations"),
    Threshold("little", 0.25, "share", "that is little: what a right reading may leave", "explanations"),
    Threshold("large_share", 0.2, "share", "of a range, of a speed, that is clearly visible", "sizes-that-count"),
    Threshold("least_share", 0.02, "share", "that counts: of a speed, of a range, of samples", "sizes-that-count"),
    Threshold("least_bias", 0.01, "share of the yaw rate", "bias that counts, for it adds up", "sizes-that-count"),
    Threshold("similar", 1.1, "times", "squares within which readings are equal", "explanations"),
    # sizes
    Threshold("least_distance", 0.02, "ship lengths", "distance that counts", "sizes-that-count"),
    Threshold("least_angle", 1.0, "deg", "angle that counts", "sizes-that-count"),
    Threshold("least_turn", 5.0, "deg", "turn that counts", "sizes-that-count"),
    Threshold("least_lag", 0.8, "s at 130 m", "lag of a sensor that counts", "sizes-that-count"),
    Threshold("speed_at_rest", 0.002, "Froude number", "speed up to which a ship is at rest", "sizes-that-count"),
    # times
    Threshold("window", 30.0, "s at 130 m", "time over which ways, turns and winds are compared", "times-of-a-ship"),
    Threshold("short_window", 15.0, "s at 130 m", "time in which signs, units and dropouts show", "times-of-a-ship"),
    Threshold("response_time", 8.0, "s at 130 m", "time in which a ship answers a force", "times-of-a-ship"),
    Threshold("averaging_time", 4.0, "s at 130 m", "time over which speeds are averaged", "times-of-a-ship"),
    Threshold("longest_lag", 10.0, "s at 130 m", "longest lag that is thought of", "times-of-a-ship"),
    Threshold("standstill_time", 5.0, "s at 130 m", "shortest standstill of a record", "times-of-a-ship"),
    # the table
    Threshold("greatest_value", 1e12, "unit of the channel", "greatest value that is read", "chosen-by-judgement"),
    Threshold("clock_step", 1.0, "s", "least step of a clock that is reported", "chosen-by-judgement"),
    Threshold("equal_within", 1e-5, "standard deviations", "difference of equal samples", "chosen-by-judgement"),
    Threshold("copied_samples", 20, "samples", "least number of equal ones in a row", "chosen-by-judgement"),
    # samples
    Threshold("repeated_share", 0.005, "share", "of repeated samples that is reported", "chosen-by-judgement"),
    Threshold("hidden_steps", 2.0, "steps of the record", "motion that rounding may hide", "chosen-by-judgement"),
    Threshold("noisy_reversals", 0.4, "share", "of steps back in a noisy record, at least", "noisy-records"),
    # units, signs and frames
    Threshold("largest_rudder_angle", 1.3, "rad", "angle beyond that of every rudder", "chosen-by-judgement"),
    Threshold("fault_scale", 0.15, "share", "ordinary error of scale", "units-and-signs"),
    Threshold("fault_heading", 0.1, "rad", "ordinary error of a compass", "units-and-signs"),
    Threshold("fault_antenna", 0.7, "ship lengths", "ordinary distance of an antenna", "units-and-signs"),
    Threshold("fault_drift", 1.0, "m/s at 130 m", "ordinary drift of the water", "units-and-signs"),
    # wind and speed log
    Threshold("wind_change", 0.05, "m/s", "least change of the recorded wind", "chosen-by-judgement"),
    Threshold("silent_pieces", 3, "pieces", "least number with a silent speed log", "enough-cases"),
    Threshold("silent_longest", 120.0, "s at 130 m", "longest piece with a steady drift", "chosen-by-judgement"),
    # actuators
    Threshold("sudden_sweep", 3.0, "s at 130 m", "too short a time for the whole range", "measured-actuators"),
    Threshold("still_way", 0.07, "Froude number", "least speed of a ship that makes way", "chosen-by-judgement"),
    Threshold("stopping_length", 25.0, "ship lengths", "way in which speed falls e-fold", "speed-without-thrust"),
    Threshold("actuator_lag", 3.5, "s at 130 m", "least lag of rudder, shaft or motion", "lags-of-actuators"),
    Threshold("order_lag", 1.5, "s at 130 m", "least lag of an order, or behind it", "lags-of-actuators"),
    Threshold("rudder_lag_gain", 20.0, "log likelihood", "least gain of a rudder's lag alone", "lags-of-actuators"),
)
"""All of them, in the order of the checks."""
