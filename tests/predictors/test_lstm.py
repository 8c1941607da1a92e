from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.predictors.hold import Hold
from shipbench.predictors.lstm import LSTM
from shipbench.records import Run
from shipbench.signals import MOTION, U


@pytest.fixture(scope="module")
def parts(harbour):
    return harbour.subset(range(12)), harbour.subset(range(12, 14)), harbour.subset(range(14, 16))


def quick(epochs=4):
    return LSTM(hidden=8, epochs=epochs)


@pytest.fixture(scope="module")
def model(parts):
    return quick().fit(parts[0], parts[1], seed=1)


@pytest.mark.long
def test_members_of_a_group_come_out_as_they_would_alone(parts, model):
    train, valid, test = parts
    batch = test.batch()
    group = [quick(), quick()]
    LSTM.fit_group(group, [train, train.subset(range(8))], [valid, None], [1, 2])
    other = quick().fit(train.subset(range(8)), seed=2)
    for a, b in zip(group, (model, other), strict=True):
        np.testing.assert_allclose(
            a.predict(batch.s0, batch.U)[..., MOTION], b.predict(batch.s0, batch.U)[..., MOTION], rtol=1e-3, atol=1e-3
        )


def test_history_is_used_and_only_what_lies_before_s0(parts, model):
    batch = parts[2].batch(history=10)
    S = model.predict(batch.s0, batch.U, batch.history)
    assert np.abs(S - model.predict(batch.s0, batch.U)).max() > 1e-6
    past = (batch.history[0].copy(), batch.history[1])
    past[0][:, 3, U] += 0.5
    assert np.abs(model.predict(batch.s0, batch.U, past) - S).max() > 1e-9
    empty = (batch.history[0][:, :0], batch.history[1][:, :0])
    np.testing.assert_array_equal(model.predict(batch.s0, batch.U, empty), model.predict(batch.s0, batch.U))


@pytest.mark.long
def test_trained_on_twelve_runs_it_comes_closer_than_kept_velocities(parts):
    train, valid, test = parts
    batch = valid.merged(test).batch()

    def error(model):
        return np.hypot(*(model.predict(batch.s0, batch.U) - batch.truth)[..., :2].transpose(2, 0, 1)).mean()

    assert error(LSTM(hidden=16, epochs=12).fit(train, valid, seed=0)) < 0.6 * error(Hold().fit(train))


def test_long_windows_are_stepped_coarsely_without_seeing_the_future(parts):
    def fine(data):
        """The same runs at 0.2 s by linear interpolation: 200 steps."""
        t = np.arange(0.0, 40.1, 0.2)
        runs = []
        for r in data.runs:
            S = np.column_stack([np.interp(t, r.t, c) for c in r.states.T])
            runs.append(Run(r.id, t, S, r.inputs[np.floor(t + 1e-9).astype(int)]))
        return replace(data, dt=0.2, runs=tuple(runs))

    model = quick(2).fit(fine(parts[0]), fine(parts[1]), seed=0)
    assert model._stride == 2
    batch = fine(parts[2]).batch(history=7)
    S = model.predict(batch.s0, batch.U, batch.history)
    assert S.shape == batch.truth.shape
    late = batch.U.copy()
    late[:, 75:, 1] += 0.4
    np.testing.assert_array_equal(model.predict(batch.s0, late, batch.history)[:, :75], S[:, :75])
    assert np.abs(np.diff(S[..., U], axis=1)).max() < 0.2, "no jumps between the knots"


def test_commanded_actuators_are_repeated(parts, tmp_path):
    def commanded(data):
        runs = [replace(r, states=np.concatenate([r.states[:, :6], r.inputs[:, :4]], axis=1)) for r in data.runs]
        return replace(data, runs=tuple(runs), actuators="commanded")

    model = quick(2).fit(commanded(parts[0]), commanded(parts[1]), seed=0)
    batch = commanded(parts[2]).batch()
    np.testing.assert_allclose(model.predict(batch.s0, batch.U)[..., 6:], batch.U)
    model.save(tmp_path / "m")
    np.testing.assert_array_equal(
        LSTM.load(tmp_path / "m").predict(batch.s0, batch.U), model.predict(batch.s0, batch.U)
    )


def test_wrong_settings_and_use_before_fit_are_refused(parts):
    with pytest.raises(ValueError, match="epochs = 0"):
        LSTM(epochs=0)
    batch = parts[2].batch()
    with pytest.raises(InputError, match="before fit"):
        LSTM().predict(batch.s0, batch.U)


@pytest.mark.long
def test_a_warm_start_goes_on_from_the_last_fit_in_its_scales(parts, model):
    train, valid, batch = parts[0], parts[1], parts[2].batch()
    still = LSTM(hidden=model.hidden, epochs=4, lr=1e-12)
    still._weights, still.warm_start = dict(model._weights), True
    still.fit(train.subset(range(4)), valid, seed=1)
    np.testing.assert_allclose(still.predict(batch.s0, batch.U), model.predict(batch.s0, batch.U), rtol=1e-5, atol=1e-4)
    np.testing.assert_array_equal(still._weights["scale_y.mean"], model._weights["scale_y.mean"])
