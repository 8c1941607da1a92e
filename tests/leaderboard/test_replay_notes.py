"""Notes on predicted trajectories are made of the summaries of all folds."""

from __future__ import annotations

from shipbench.leaderboard.replay_notes import replay_notes
from shipbench.predictors.predictions import ReplayReport


def summary(report, statuses=("ok", "ok"), model="predictions:theirs"):
    return {"dataset": "toy", "model": model, "run_status": list(statuses), "replay_report": report}


def test_starts_coverage_and_matches_are_told_over_all_folds():
    folds = [
        summary(ReplayReport((0.0, 2.0), (0.5, 1.0), 0, ("12 trajectories matched by run id",)).as_dict()),
        summary(ReplayReport((4.0,), (3.0,), 1, ("12 trajectories matched by run id",)).as_dict(), ("ok", "skipped")),
    ]
    assert replay_notes([*folds, {"dataset": "toy", "model": "hold", "run_status": ["ok"]}]) == {
        ("toy", "predictions:theirs"): [
            "predicted state at the start of the window against the measured one, 3 windows: median 2 m, maximum 4 m; "
            "median 1 deg, maximum 3 deg; not known in 1 windows",
            "3 of 4 windows are covered by a trajectory",
            "12 trajectories matched by run id",
        ]
    }


def test_a_start_that_no_file_holds_and_a_malformed_report():
    [notes] = replay_notes([summary(ReplayReport((), (), 2, ()).as_dict())]).values()
    assert notes == ["the state at the start is not among the predicted ones, in 2 windows"]
    assert replay_notes([summary({"distance": "far"}), summary(None)]) == {}


def test_the_frame_of_a_simulation_is_told_once():
    cells = [
        {"dataset": "toy", "model": "sim.py:simulate", "run_status": ["ok"], "simulation_notes": [f"{n} deg"]}
        for n in (1, 2)
    ]
    assert replay_notes(cells) == {("toy", "sim.py:simulate"): ["1 deg"]}
    assert replay_notes([{**cells[0], "simulation_notes": "all"}]) == {}
