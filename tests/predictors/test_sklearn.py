"""Scikit-learn regressors as one-step models."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from made_saved import signed_anew

from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.data.files import write_dataset
from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor, parse_spec


def fitted(spec, harbour, seed=0):
    return make_predictor(parse_spec(spec)).fit(harbour.subset(range(12)), seed=seed)


@pytest.fixture(scope="module")
def batch(harbour):
    return harbour.subset(range(14, 16)).batch()


@pytest.mark.parametrize(
    "spec",
    [
        "sklearn:Ridge",
        "sklearn:HistGradientBoostingRegressor[max_iter=10]",
        "sklearn:SVR",
        "sklearn:Ridge[target=state]",
    ],
)
def test_it_learns_the_next_state(harbour, batch, spec):
    """One step ahead it beats the mean of the training data by far; regressors with one output (SVR, gradient boosting)
    are fitted per channel."""
    S = fitted(spec, harbour).predict(batch.s0, batch.U[:, :1])
    spread = np.stack([r.states for r in harbour.runs])[..., 3:8].std((0, 1))
    error = np.sqrt(np.mean((S[:, 0, 3:8] - batch.truth[:, 0, 3:8]) ** 2, axis=0))
    assert (error < 0.5 * spread).all()


def test_ridge_is_the_closed_form(harbour):
    """Its rate of turn after one step, against numpy's solution of the same normal equations."""
    model = fitted("sklearn:Ridge[alpha=2.0]", harbour)
    S = np.concatenate([r.states[:-1] for r in harbour.runs[:12]])
    x = np.concatenate([S[:, 3:], np.concatenate([r.inputs[:-1] for r in harbour.runs[:12]])], axis=1)
    z = np.concatenate([r.states[1:, 5] - r.states[:-1, 5] for r in harbour.runs[:12]])
    X = (x - x.mean(0)) / x.std(0)
    w = np.linalg.solve(X.T @ X + 2.0 * np.eye(X.shape[1]), X.T @ (z - z.mean()) / z.std())
    assert model.predict(S[7, :], harbour.runs[0].inputs[7:8])[0, 5] == pytest.approx(
        S[7, 5] + z.mean() + z.std() * X[7] @ w, rel=1e-6
    )


def test_the_seed_is_its_random_state_unless_the_spec_sets_one(harbour, batch):
    spec = "sklearn:RandomForestRegressor[n_estimators=3,max_depth=4]"
    first, same, other = (fitted(spec, harbour, seed).predict(batch.s0, batch.U) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert np.abs(first - other).max() > 1e-6
    held = "sklearn:ExtraTreeRegressor[max_depth=4,random_state=5]"
    np.testing.assert_array_equal(*(fitted(held, harbour, seed).predict(batch.s0, batch.U) for seed in (1, 2)))


def test_a_rollout_that_diverges_becomes_nan_where_the_regressor_would_raise(harbour, batch):
    model = fitted("sklearn:Ridge", harbour)
    model._fitted.coef_ *= 1e30
    S = model.predict(batch.s0, batch.U)
    assert S.shape == batch.truth.shape
    assert np.isnan(S[:, -1, 3:]).all()


def test_a_saved_model_holds_no_pickle_and_is_fitted_again_to_the_same(harbour, batch, tmp_path):
    model = fitted("sklearn:RandomForestRegressor[n_estimators=3]", harbour, seed=4)
    model.save(tmp_path / "m")
    assert sorted(p.name for p in (tmp_path / "m").iterdir()) == ["arrays.npz", "model.json"]
    loaded = make_predictor(parse_spec(str(tmp_path / "m")))
    np.testing.assert_array_equal(loaded.predict(batch.s0, batch.U), model.predict(batch.s0, batch.U))


def test_a_saved_model_that_would_predict_otherwise_is_refused(harbour, tmp_path):
    """As after a change of scikit-learn's version; here it is the kept seed that is changed."""
    fitted("sklearn:RandomForestRegressor[n_estimators=3]", harbour, seed=4).save(tmp_path / "m")
    signed_anew(tmp_path / "m", lambda meta: {**meta, "meta": {**meta["meta"], "seed": 5}})
    with pytest.raises(InputError, match=r"predicts something else\. Install scikit-learn"):
        make_predictor(parse_spec(str(tmp_path / "m")))


def test_a_value_that_scikit_learn_refuses_is_one_message(harbour):
    with pytest.raises(InputError, match=r"sklearn:Ridge.*alpha"):
        fitted("sklearn:Ridge[alpha=-1.0]", harbour)


@pytest.mark.parametrize(("spec", "package"), [("sklearn:Ridge", "sklearn"), ("pysindy", "pysindy")])
def test_without_its_package_a_study_stops_before_it_starts(toy, tmp_path, monkeypatch, spec, package):
    write_dataset(toy(runs=4), tmp_path / "toy")
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delitem(sys.modules, f"shipbench.predictors.{package}", raising=False)
    task = make_task({"dataset": str(tmp_path / "toy"), "models": [spec, "hold"], "folds": 2, "horizon_s": 20.0})
    with pytest.raises(InputError, match=rf"which is not installed\. Install it: pip install 'shipbench\[{package}\]'"):
        run_tasks([task], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_saved_model_without_its_package_is_refused_with_the_way_out(harbour, tmp_path, monkeypatch):
    fitted("sklearn:Ridge", harbour).save(tmp_path / "m")
    monkeypatch.setitem(sys.modules, "sklearn", None)
    monkeypatch.delitem(sys.modules, "shipbench.predictors.sklearn")
    with pytest.raises(InputError, match=r"pip install 'shipbench\[sklearn\]'"):
        make_predictor(parse_spec(str(tmp_path / "m")))
