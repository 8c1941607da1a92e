"""Predicted trajectories as a model: windows, coverage, actuators, starts, the contract, and the spec."""

from __future__ import annotations

import numpy as np
import pytest
from made_tracks import MOTION, apart, predicted, rows_of, written

from shipbench.contract.base import BROKEN
from shipbench.contract.check import check_model
from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor
from shipbench.predictors.context import Context
from shipbench.predictors.predictions import NOT_COVERED, Matched, Predictions, ReplayReport, Trajectory
from shipbench.replay.bind import bound
from shipbench.specs import parse_spec


@pytest.fixture
def data(toy):
    return apart(toy(runs=12, steps=40))


def model_of(folder, data):
    return make_predictor(bound(parse_spec(f"predictions:{folder}"), data)).fit(data)


def test_a_window_is_cut_from_the_trajectory_of_its_run(data, tmp_path):
    model = model_of(written(predicted(data), tmp_path / "theirs"), data)
    windows = data.windows(10, stride=10)
    batch, context = windows.batch(), Context.of(windows)
    S = model.predict(batch.s0, batch.U, context=context)
    off = 0.02 * (context.start[:, None] + np.arange(1, 11))
    np.testing.assert_allclose(S[..., 0] - batch.truth[..., 0], off, atol=1e-8)
    np.testing.assert_allclose(S[..., 1:], batch.truth[..., 1:], atol=1e-8)
    assert model.skip_windows(context, 10) == [""] * len(windows)
    np.testing.assert_allclose(model.report.distance, 0.02 * context.start, atol=1e-8)
    assert ReplayReport.from_dict(model.report.as_dict()) == model.report


def test_the_trajectory_that_starts_last_counts_and_one_may_start_a_step_after_the_window(data):
    run, steps = data.runs[0], 10
    early, late = (Trajectory(start, np.full((41 - int(start), 10), start)) for start in (0.0, 21.0))
    model = Predictions()
    model.matched = Matched({run.id: (late, early)})
    windows = data.with_runs([run]).windows(steps, stride=10)
    batch, context = windows.batch(), Context.of(windows)
    S = model.fit(data).predict(batch.s0, batch.U, context=context)
    assert S[:, 0, 0].tolist() == [0.0, 0.0, 21.0, 21.0]
    assert model.report is not None
    assert model.report.unknown == 1  # the window at 20 s: no state there is predicted


def test_windows_that_no_trajectory_covers_are_skipped_with_the_reason(data, tmp_path):
    table = predicted(data)
    short = rows_of(table, "r01").iloc[:6]
    late = rows_of(table, "r02").iloc[25:]
    whole = rows_of(table, "r00")
    folder = written(whole, tmp_path / "theirs", "a.csv")
    written(short, folder, "b.csv")
    written(late, folder, "c.csv")
    model = model_of(folder, data)
    windows = data.subset([0, 1, 2, 3]).windows(20, stride=20)
    batch, context = windows.batch(), Context.of(windows)
    reasons = model.skip_windows(context, 20)
    assert reasons[:2] == ["", ""]
    assert reasons[2] == f"{NOT_COVERED}: those of its run last 5 s, the window 20 s"
    assert reasons[4] == f"{NOT_COVERED}: those of its run last 15 s, the window 20 s"
    assert reasons[6] == f"{NOT_COVERED}: none is of this run"
    S = model.predict(batch.s0, batch.U, context=context)
    assert [bool(np.isnan(one).all()) for one in S] == [bool(reason) for reason in reasons]


def test_missing_actuators_are_the_commands_and_never_the_measured_states(data, tmp_path):
    model = model_of(written(predicted(data, MOTION), tmp_path / "theirs"), data)
    batch = data.windows(10).batch()
    S = model.predict(batch.s0, batch.U, context=Context.of(data.windows(10)))
    assert np.array_equal(S[..., 6:], batch.U)
    assert any("n, delta, F_b, F_s not given: taken as the commands" in note for note in model.report.notes)


def test_the_contract_is_kept(data, tmp_path):
    folder = written(predicted(data, MOTION), tmp_path / "theirs")
    report = check_model(f"predictions:{folder}", data)
    assert not report.of(BROKEN), report
    half = written(predicted(data.subset(range(8))), tmp_path / "half")
    assert not check_model(f"predictions:{half}", data).of(BROKEN)
    with pytest.raises(InputError, match="belongs to recorded runs"):
        check_model(f"predictions:{folder}")
    few = written(rows_of(predicted(data), "r00").iloc[:4], tmp_path / "few")
    with pytest.raises(InputError, match="predicts no window of 'toy'"):
        check_model(f"predictions:{few}", data)


def test_bad_specs_and_calls_are_one_message_each(data, tmp_path):
    with pytest.raises(InputError, match="'predictions' is made of a file"):
        make_predictor("predictions")
    with pytest.raises(InputError, match="no parameter 'mappings'"):
        make_predictor("predictions:theirs[mappings=m.toml]")
    with pytest.raises(InputError, match="takes none"):
        make_predictor("predictions:theirs+current")
    batch = data.batch()
    unmatched = make_predictor("predictions:theirs").fit(data)
    with pytest.raises(InputError, match="not matched to runs yet"):
        unmatched.predict(batch.s0, batch.U, context=Context.of(data))
    model = model_of(written(predicted(data), tmp_path / "theirs"), data)
    with pytest.raises(InputError, match="no run is known here"):
        model.predict(batch.s0, batch.U)
    with pytest.raises(InputError, match="accepted"):
        model.predict(batch.s0[:, :7], batch.U)
    with pytest.raises(InputError, match="finite"):
        model.predict(batch.s0 * np.nan, batch.U)
