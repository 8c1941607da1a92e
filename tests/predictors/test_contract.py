"""The contract, run over every registered predictor: a new one is tested by existing."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.predictors.base import PREDICTORS, make_predictor, parse_spec
from shipbench.records import Dataset
from shipbench.signals import move_frame

SMALL = {
    "mlp": "mlp[epochs=2]",
    "lstm": "lstm[epochs=2,hidden=8]",
    "neural_ode": "neural_ode[epochs=2]",
    "physics": "physics[iterations=3]",
}
"""Quick settings of the predictors that train; the others take none."""


def _fitted(name: str, data: Dataset, seed: int = 3):
    model = make_predictor(parse_spec(SMALL.get(name, name)))
    return model.fit(data.subset(range(12)), data.subset(range(12, 14)), seed=seed)


@pytest.fixture(scope="module", params=PREDICTORS.names())
def model(request, harbour):
    return _fitted(request.param, harbour)


@pytest.fixture(scope="module")
def batch(harbour):
    return harbour.subset(range(14, 16)).batch()


def test_it_predicts_the_states_after_s0_in_the_right_shape(model, batch):
    S = model.predict(batch.s0, batch.U)
    assert S.shape == batch.truth.shape
    assert np.isfinite(S).all()
    assert np.abs(S[:, 0, :2] - batch.s0[:, :2]).max() < 15.0, "the first prediction lies one step from s0"


def test_later_commands_do_not_move_earlier_states(model, batch):
    U = batch.U.copy()
    U[:, 20:, 0] *= -1.0
    U[:, 20:, 1] += 0.3
    np.testing.assert_array_equal(model.predict(batch.s0, U)[:, :20], model.predict(batch.s0, batch.U)[:, :20])


def test_a_batch_is_the_loop_over_its_runs(model, batch):
    together = model.predict(batch.s0, batch.U)
    for i in range(len(batch.ids)):
        np.testing.assert_allclose(model.predict(batch.s0[i], batch.U[i]), together[i], rtol=1e-4, atol=1e-4)


def test_moving_and_turning_the_earth_frame_moves_and_turns_the_prediction(model, batch):
    origin, rotation = np.array([500.0, -300.0]), 1.2
    moved = model.predict(move_frame(batch.s0, origin, rotation), batch.U)
    np.testing.assert_allclose(moved, move_frame(model.predict(batch.s0, batch.U), origin, rotation), rtol=1e-6, atol=1e-6)


def test_the_same_seed_gives_the_same_model(model, harbour, batch):
    again = _fitted(model.name, harbour)
    np.testing.assert_allclose(again.predict(batch.s0, batch.U), model.predict(batch.s0, batch.U), rtol=1e-6, atol=1e-6)


def test_a_saved_model_predicts_the_same_after_loading(model, batch, tmp_path):
    model.save(tmp_path / "m")
    loaded = make_predictor(parse_spec(str(tmp_path / "m")))
    np.testing.assert_array_equal(loaded.predict(batch.s0, batch.U), model.predict(batch.s0, batch.U))
    assert not any(p.suffix in (".pkl", ".pickle", ".pt") for p in (tmp_path / "m").iterdir())


def test_history_is_optional_and_changes_no_shape(model, harbour):
    batch = harbour.subset(range(14, 16)).batch(history=10)
    assert model.predict(batch.s0, batch.U, batch.history).shape == batch.truth.shape
    assert model.predict(batch.s0, batch.U).shape == batch.truth.shape


def test_it_does_not_change_its_arguments(model, batch):
    s0, U = batch.s0.copy(), batch.U.copy()
    model.predict(s0, U)
    np.testing.assert_array_equal(s0, batch.s0)
    np.testing.assert_array_equal(U, batch.U)


@pytest.mark.parametrize("fault", ["state", "inputs", "nan", "empty"])
def test_bad_input_is_named(model, batch, fault):
    s0, U = batch.s0.copy(), batch.U.copy()
    if fault == "state":
        s0 = s0[:, :7]
    elif fault == "inputs":
        U = U[..., :3]
    elif fault == "nan":
        U[0, 5, 1] = np.nan
    else:
        U = U[:, :0]
    with pytest.raises(InputError, match=r"accepted|finite"):
        model.predict(s0, U)
