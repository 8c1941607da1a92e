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
    Threshold("evidence", 10.0, "2 log evidence", "least gain of a cause that is named", "evidence-asked"),
    Threshold("null_quantile", 0.95, "probability", "quantile of null scores, a least threshold", "evidence-asked"),
    Threshold("evidence_of_hull", 30.0, "2 log evidence", "least gain of an unusual hull", "chosen-by-judgement"),
    Threshold("off_form", 0.02, "share", "of that gain, asked besides where ships differ", "evidence-asked"),
    Threshold("evidence_of_misfit", 10.0, "2 log evidence", "asked besides where misfit is absorbed", "evidence-asked"),
    Threshold("evidence_of_run_values", 50.0, "2 log evidence", "asked besides of one value a run", "evidence-asked"),
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
    Threshold("hopeless_score", 14.0, "2 log evidence", "below zero: no second estimate for run values", "screening"),
    Threshold("causes", 6, "1", "greatest number of causes", "chosen-by-judgement"),
    Threshold("refits", 3, "1", "number of best candidates that are refitted", "chosen-by-judgement"),
    Threshold("refit_share_of_threshold", 0.5, "share", "of the threshold: least for a refit", "chosen-by-judgement"),
    Threshold("refit_share_of_score", 0.1, "share", "of the best score: least for a refit", "chosen-by-judgement"),
    Threshold("rival_overlap", 0.25, "share", "of the best evidence that a rival could take", "chosen-by-judgement"),
    Threshold("rivals", 4, "1", "greatest number of rivals that are refitted", "chosen-by-judgement"),
    Threshold("tie", 0.1, "2 log evidence", "in which two settings of an effect are equal", "chosen-by-judgement"),
    Threshold("tie_of_vectors", 0.5, "share", "of its score by which two settings of a vector are equal", "refits"),
    Threshold("refit_share_of_best", 0.6, "share", "of the best gain: least predicted gain of a refit", "refits"),
    Threshold("refit_margin", 30.0, "2 log evidence", "allowance on that least predicted gain", "refits"),
    Threshold("near_threshold", 1.0, "2 log evidence", "below the threshold: a refit is iterated further", "refits"),
    Threshold("left_by_causes_share", 0.05, "share", "of the causes' gain, asked of the next", "chosen-by-judgement"),
    Threshold("left_by_causes_most", 20.0, "2 log evidence", "most that is so asked", "chosen-by-judgement"),
    Threshold("confused_score", 10.0, "2 log evidence", "behind the winner: confused with it", "chosen-by-judgement"),
    Threshold("confused_formulas", 0.1, "share", "of that score, where only formulas differ", "confused-causes"),
    Threshold("changes_refitted", 2, "1", "number of changes that are refitted", "chosen-by-judgement"),
    Threshold("change_margin", 14.0, "2 log evidence", "lead of a change over other causes", "chosen-by-judgement"),
    Threshold("change_margin_own", 4.0, "2 log evidence", "lead over it from the first run on", "chosen-by-judgement"),
    Threshold("runs_for_a_change", 8, "runs", "least number in which a change is looked for", "chosen-by-judgement"),
    Threshold("change_without_one_run", 0.25, "share", "of a change's score left without any one run", "changes"),
    Threshold("alike_lower", 0.35, "share", "of runs alike before and after: always asked", "chosen-by-judgement"),
    Threshold("alike_upper", 0.5, "share", "of runs alike before and after: always enough", "chosen-by-judgement"),
    Threshold("alike_by_chance", 0.05, "probability", "quantile in random order, asked between", "chosen-by-judgement"),
    # selection: unknown forces and errors
    Threshold("evidence_of_unknown", 20.0, "2 log evidence", "least gain of an unknown force", "unknown-forces"),
    Threshold("off_form_of_large", 4.0, "times", "`Selection.off_form` asked of a large force", "unknown-forces"),
    Threshold("off_form_of_small", 12.0, "times", "`Selection.off_form` asked of a small force", "unknown-forces"),
    Threshold("off_form_slope", 0.75, "per unit", "growth of `off_form_of_large` with `off_form`", "unknown-forces"),
    Threshold("evidence_free_of_form", 16.0, "2 log evidence", "least gain of what no hull does", "unknown-forces"),
    Threshold("unknown_margin", 10.0, "2 log evidence", "lead of it over all named causes", "chosen-by-judgement"),
    Threshold("contender_share", 0.4, "share", "of the gain of named causes, to be refitted", "unknown-forces"),
    Threshold("contenders", 3, "1", "greatest number of unknown forces that are refitted", "chosen-by-judgement"),
    Threshold("force_size", 0.07, "latent force", "least size of an unknown force", "unknown-forces"),
    Threshold("error_size", 0.3, "sd of ordinary noise", "least size of an unknown error", "unknown-forces"),
    Threshold("force_prior", 0.5, "latent force", "prior sd of a force's coefficient", "chosen-by-judgement"),
    Threshold("error_prior", 3.0, "sd of ordinary noise", "prior sd of an error's coefficient", "chosen-by-judgement"),
    Threshold("variances_again", 2.0, "log evidence", "gain to estimate variances again", "chosen-by-judgement"),
    Threshold("samples_for_errors", 4.0, "s", "longest time between samples for errors of sensors", "unknown-forces"),
    Threshold("shortest_period", 8.0, "s", "shortest period of a force in time", "chosen-by-judgement"),
    Threshold("longest_period", 200.0, "s", "longest period of a force in time", "chosen-by-judgement"),
    Threshold("periods", 60, "1", "greatest number of periods", "chosen-by-judgement"),
    Threshold("longest_swell", 1.8, "s/m^0.5", "longest wave period per root of the ship length", "unknown-forces"),
    Threshold("shortest_wave", 4.0, "ship lengths", "shortest wave over the places", "chosen-by-judgement"),
    Threshold("waves", 25, "1", "most waves in twice the extent of the places", "chosen-by-judgement"),
    # selection: the ship file
    Threshold("other_size_sum", 20.0, "prior variances", "sum from which other ship sizes are tried", "ship-file"),
    Threshold("doubtful_parameter", 5.0, "prior sd", "of a parameter: the ship file is doubtful", "ship-file"),
    Threshold("doubtful_sum", 75.0, "prior variances", "sum from which the ship file is doubtful", "ship-file"),
    Threshold("thrust_outlier", 4.0, "prior sd", "of the thrust: the ship file is in doubt", "chosen-by-judgement"),
    Threshold("thrust_reported", 1.3, "factor", "of an estimated thrust that is reported", "chosen-by-judgement"),
    Threshold("other_size", 60.0, "log evidence", "lead of a ship of another size over the ship file", "another-size"),
    Threshold("other_size_estimated", 3.0, "times", "that lead, if propeller or rudder are estimated", "another-size"),
    Threshold("other_size_first_fit", 0.0, "log evidence", "the same lead after a first fit, to go on", "another-size"),
    Threshold("same_size_margin", 5.0, "log evidence", "lead of causes over a similar size", "chosen-by-judgement"),
    Threshold("pieces_of_sizes", 99, "pieces", "of a long record by which sizes are compared", "another-size"),
    # evaluation
)
"""All of them, in the order of the diagnosis."""
