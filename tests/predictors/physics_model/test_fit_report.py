"""Physics that does not follow its own training runs says so; physics that does says nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.data.files import write_dataset
from shipbench.leaderboard.pages import build_board
from shipbench.predictors.base import make_predictor, parse_spec
from shipbench.predictors.physics import Physics
from shipbench.predictors.physics_model.fit_report import FitReport
from shipbench.signals import COMMANDS, STATES


def _reversed_shaft(data):
    """The ship as recorded with n positive astern."""
    n, n_c = STATES.index("n"), COMMANDS.index("n_c")
    runs = []
    for run in data.runs:
        states, inputs = run.states.copy(), run.inputs.copy()
        states[:, n] *= -1.0
        inputs[:, n_c] *= -1.0
        runs.append(replace(run, states=states, inputs=inputs))
    return data.with_runs(runs)


def test_good_runs_get_no_note_and_the_figures_stand_with_the_equations(harbour, tmp_path):
    model = Physics().fit(harbour)
    assert model.report.note == ""
    assert model.report.error < 0.6 * model.report.hold
    assert "parameters at their bounds, training error" in model.describe()
    model.save(tmp_path / "m")
    assert make_predictor(parse_spec(str(tmp_path / "m"))).report == model.report


def test_a_ship_that_keeps_its_velocities_is_no_bad_fit():
    assert FitReport((), 11, 6.5e-42, hold=0.0).note == ""


def test_thrust_of_the_wrong_sign_is_told_with_the_evidence(harbour):
    model = Physics().fit(_reversed_shaft(harbour))
    right = Physics().fit(harbour).report.error
    assert "physics does not fit these runs" in model.report.note
    assert (
        f"With the opposite sign of n the training error is {right:.3g} m: the shaft speed looks reversed"
        in model.report.note
    )


@pytest.mark.parametrize(
    ("at", "error", "fits"),
    [
        ((), 4.0, True), ((), 10.0, False), ((), np.inf, False), (("p2",), 4.0, True), (("p1", "p2", "p3"), 4.0, False),
        (("p4",), 4.0, False),
        (("p4",), 3.0, True),
    ],
)  # fmt: skip
def test_what_counts_as_no_fit(at, error, fits):
    report = FitReport(at, 11, error, hold=10.0)
    assert report.fits is fits
    assert FitReport.from_dict(report.as_dict()) == report
    if not fits and np.isfinite(error):
        assert f"{len(at)} of 11 parameters at their bounds, training error {error:.3g} m (hold 10 m)" in report.note


def test_the_summary_and_the_table_say_so(harbour, tmp_path):
    write_dataset(_reversed_shaft(harbour), tmp_path / "astern")
    task = make_task(
        {"dataset": str(tmp_path / "astern"), "models": ["hold", "physics"], "horizon_s": 40.0, "folds": 2}
    )
    outcome = run_tasks([task], tmp_path / "out")
    assert [s["fit_report"]["of"] for s in outcome.summaries if s["model"] == "physics"] == [11, 11]
    table = build_board(outcome.results, outcome.summaries[0]["dataset"]).tables[0]
    assert {row["model"]: row.get("fit") for row in table.rows} == {"hold": None, "physics": "†"}
    assert any(note.startswith("† `physics`: physics does not fit these runs") for note in table.notes)
