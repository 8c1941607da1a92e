"""Notes on fitted physics that does not fit its own training runs."""

from __future__ import annotations

from shipbench.leaderboard.fit_notes import fit_notes
from shipbench.predictors.physics_model.fit_report import FitReport


def summary(fold: int, error: float, model: str = "physics", **changed) -> dict:
    return {
        "dataset": "toy", "model": model, "fold": fold,
        "fit_report": FitReport((), 11, error, 10.0).as_dict() | changed,
    }  # fmt: skip


def test_a_fit_that_is_better_than_hold_has_no_note():
    assert fit_notes([summary(0, 2.0), summary(1, 9.9)]) == {}


def test_the_worst_of_several_fits_is_told_with_its_fold():
    note = fit_notes([summary(0, 12.0), summary(1, 30.0), summary(2, 2.0)])["toy", "physics"]
    assert "training error 30 m (hold 10 m)" in note
    assert note.endswith("In 2 of 3 fits; the figures are those of fold 1.")


def test_each_model_has_its_own_note_and_one_fit_names_no_fold():
    notes = fit_notes([summary(0, 12.0), summary(0, 2.0, "other")])
    assert list(notes) == [("toy", "physics")]
    assert "fold" not in notes["toy", "physics"]


def test_a_malformed_or_missing_report_is_no_note():
    assert fit_notes([{"dataset": "toy", "model": "m", "fold": 0}, summary(0, 12.0, hold="far")]) == {}
