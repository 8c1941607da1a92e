"""Limits of predictions: those of a saved model are the study's own, hold the share of new runs, and are left out where
they do not hold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import shipbench as sb
from shipbench.bench.predict import LIMITS, predict_runs, write_csv
from shipbench.bench.results import Cell, read_band, read_predictions, read_truth
from shipbench.errors import InputError
from shipbench.metrics.base import state_error
from shipbench.predictors._band import BAND_FILE
from shipbench.predictors.base import make_predictor
from shipbench.signals import MOTION, PSI


class Holds:
    def fit(self, train, valid=None, *, seed=0):
        return self

    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1], axis=1)


class Draws(Holds):
    band = 3.0  # an attribute of this name may be anything

    def predict_samples(self, s0, U, samples=100, *, seed=0):
        noise = np.random.default_rng(seed).standard_normal((samples, *U.shape[:2], 6))
        return self.predict(s0, U)[None, ..., MOTION] + 1e-3 * (1.0 + np.arange(U.shape[1])[:, None]) * noise

    def save(self, path):
        np.savez(path, weight=1.0)

    def describe(self):
        return "x = x0"


class Keeps(Holds):
    def save(self, path):
        Path(path).mkdir()
        np.savez(Path(path, "weights.npz"), weight=1.0)


class Answers:
    """A model that answers with its start."""

    def predict(self, s0, U, history=None):
        return s0


class AnswersSamples(Holds):
    def predict_samples(self, s0, U, samples):
        return s0


@pytest.fixture
def study(toy, tmp_path):
    """Scores models with bands on 24 runs of the toy ship."""

    def run(*models, out="out", horizon=20):
        scores = sb.benchmark(
            models, toy(runs=24), horizon=horizon, folds=2, bands=True, out=tmp_path / out, quiet=True
        )
        return scores.results

    return run


@pytest.fixture
def fitted(toy):
    """`hold`, fitted to 20 runs of 20 s, with its band."""
    train = toy(runs=20)
    model = make_predictor("hold").fit(train)
    model.band = sb.fit_band("hold", train)
    return model


@pytest.fixture
def saved(fitted, tmp_path):
    fitted.save(tmp_path / "saved")
    return str(tmp_path / "saved")


def _limits_of_study(out, model):
    cell = Cell("toy", model, 0, 0)
    S, W = read_predictions(out, cell), read_band(out, cell)
    assert S is not None
    assert W is not None
    return read_truth(out, "toy", 0), S[..., MOTION] - W, S[..., MOTION] + W, out / cell.folder


def test_the_limits_of_a_saved_model_are_those_of_its_study(study, tmp_path):
    study("hold", Draws, Keeps)
    batch, low, high, folder = _limits_of_study(tmp_path / "out", "hold")
    np.testing.assert_array_equal(sb.predict_band(folder / "model", batch.s0, batch.U), (low, high))
    for mine, kept, file in (  # in the model's folder, else beside its file
        (Draws(), "", "model.npz"),
        (Keeps(), "model", "weights.npz"),
    ):
        batch, low, high, folder = _limits_of_study(tmp_path / "out", type(mine).__name__)
        np.testing.assert_array_equal(sb.predict_band(mine, batch.s0, batch.U, band=folder / kept), (low, high))
        assert list(json.loads((folder / kept / BAND_FILE).read_text())["files"]) == [file]


def test_a_study_scores_the_band_of_a_saved_model(study, saved):
    results = study(saved)
    assert "no_band" not in str(results.summaries)
    assert results.rows["band_position_at_10s"].mean() > 75.0
    assert "no_band" not in str(study(saved, out="short", horizon=10).summaries)


def test_a_study_says_why_a_saved_model_has_no_band(study, saved, fitted, tmp_path):
    short = make_predictor(saved)
    short.band = replace(short.band, factor=short.band.factor[:5])
    short.save(tmp_path / "short")
    plain = make_predictor(saved)
    plain.band = None
    plain.save(tmp_path / "plain")
    for folder, reason in (
        ("short", "the band of the saved model has 5 time steps, the horizon 20"),
        ("plain", "a saved model is not fitted again, and this one was saved without a band"),
    ):
        assert {s["no_band"] for s in study(str(tmp_path / folder), out=folder).summaries} == {reason}


def test_limits_hold_the_share_of_runs_that_were_not_fitted(fitted, toy):
    batch = toy(runs=100).subset(range(20, 100)).batch()
    low, high = sb.predict_band(fitted, batch.s0, batch.U)
    assert low.shape == high.shape == (80, 20, 6)
    middle = fitted.predict(batch.s0, batch.U)
    np.testing.assert_allclose((low + high)[..., PSI] / 2.0, middle[..., PSI])
    inside = np.abs(state_error(batch.truth, middle))[..., MOTION] <= (high - low) / 2.0
    assert 0.8 < inside[..., :3].mean() < 0.99


def test_one_run_is_a_batch_of_one(fitted, toy):
    batch = toy().batch()
    for one, all_ in zip(
        sb.predict_band(fitted, batch.s0[3], batch.U[3]), sb.predict_band(fitted, batch.s0, batch.U), strict=True
    ):
        np.testing.assert_array_equal(one, all_[3])


def test_limits_beyond_the_band_are_not_known_and_shorter_ones_are_the_same(fitted, toy):
    batch = toy(steps=30).batch()
    low, _ = sb.predict_band(fitted, batch.s0, batch.U)
    assert np.isfinite(low[:, :20]).all()
    assert np.isnan(low[:, 20:]).all()
    np.testing.assert_array_equal(sb.predict_band(fitted, batch.s0, batch.U[:, :7])[0], low[:, :7])


def test_predict_writes_limits_and_says_for_what_they_hold(saved, toy, tmp_path):
    told: list[str] = []
    data = toy(steps=30)
    write_csv(predict_runs(saved, data, tell=told.append), tmp_path / "p.csv")
    table = pd.read_csv(tmp_path / "p.csv")
    assert list(table.columns[-12:]) == list(LIMITS)
    low, high = sb.predict_band(saved, data[0].states[0], data[0].inputs[:30])
    first = table[table["trajectory"] == "r00"]
    for i, name in enumerate(("x", "y", "psi", "u", "v", "r")):
        np.testing.assert_allclose(first[f"{name}_low"][1:], low[:, i], rtol=1e-9)
        np.testing.assert_allclose(first[f"{name}_high"][1:], high[:, i], rtol=1e-9)
    assert first.loc[first["t"].isin([0.0, 21.0, 30.0]), list(LIMITS)].isna().all(axis=None)
    assert told == [
        "Limits: x_low to r_high over the first 20 s. They hold 90 % of the measurements on average over runs like "
        "those fitted, not for each manoeuvre."
    ]


def test_predict_says_that_it_predicts_fitted_runs(saved, toy):
    told: list[str] = []
    predict_runs(saved, toy(runs=25), tell=told.append)
    assert told[0].endswith(" The model was fitted on 20 of the 25 runs: there they can be too wide.")


def test_a_model_without_a_band_is_predicted_as_before(toy, tmp_path):
    make_predictor("hold").fit(toy()).save(tmp_path / "model")
    told: list[str] = []
    write_csv(predict_runs(str(tmp_path / "model"), toy(), tell=told.append), tmp_path / "p.csv")
    assert (tmp_path / "p.csv").read_text().splitlines()[0] == "trajectory,t,x,y,psi,u,v,r,n,delta,F_b,F_s"
    assert told == []


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"dt": 0.5}, "the band is for time steps of 0.5 s, the data have 1 s"),
        ({"history": 3}, "the band is for predictions with 3 samples of history, these have 0"),
        ({"of_samples": True}, "the band is for a model with predict_samples"),
    ],
)
def test_limits_of_other_predictions_are_left_out_with_one_note(saved, toy, change, reason):
    model = make_predictor(saved)
    model.band = replace(model.band, **change)
    model.save(saved)
    told: list[str] = []
    assert all(r.limits is None for r in predict_runs(saved, toy(), tell=told.append))
    assert told == [f"Limits are left out: {reason}."]


def test_a_band_with_history_is_used_with_that_history(toy):
    data = toy(runs=12, steps=25)
    model = make_predictor("hold").fit(data)
    model.band = sb.fit_band("hold", data, history=5)
    batch = data.batch(5)
    assert sb.predict_band(model, batch.s0, batch.U, batch.history)[0].shape == (12, 20, 6)
    with pytest.raises(InputError, match="the band is for predictions with 5 samples of history, these have 0"):
        sb.predict_band(model, batch.s0, batch.U)


def test_what_has_no_band_or_another_shape_is_one_message(fitted, toy, saved):
    batch = toy().batch()
    with pytest.raises(
        InputError, match=r"the model Holds has no band\. Accepted: a folder that `shipbench run --bands`"
    ):
        sb.predict_band(Holds(), batch.s0, batch.U)
    with pytest.raises(InputError, match="the model Draws has no band"):
        sb.predict_band(Draws(), batch.s0, batch.U)
    with pytest.raises(InputError, match="the model Draws: the band is for a model without predict_samples"):
        sb.predict_band(Draws(), batch.s0, batch.U, band=fitted.band)
    with pytest.raises(InputError, match=r"s0 has shape \(10, 10\), U \(3, 20, 4\); accepted: \(batch, 10\)"):
        sb.predict_band(fitted, batch.s0, batch.U[:3])
    with pytest.raises(InputError, match=r"history \(10, 10\); accepted"):
        sb.predict_band(fitted, batch.s0, batch.U, (batch.s0, batch.U))
    with pytest.raises(InputError, match="U holds <U1; accepted: an array of real numbers"):
        sb.predict_band(fitted, batch.s0, np.array("x"))
    with pytest.raises(InputError, match="the folder nowhere has no band"):
        sb.predict_band(fitted, batch.s0, batch.U, band="nowhere")
    with pytest.raises(InputError, match=r"predict: shape \(10, 10\); accepted: \(10, 20, 10\)"):
        sb.predict_band(Answers(), batch.s0, batch.U, band=fitted.band)
    band = replace(fitted.band, of_samples=True)
    with pytest.raises(InputError, match=r"predict_samples: shape \(10, 10\)"):
        sb.predict_band(AnswersSamples(), batch.s0, batch.U, band=band)


def test_a_band_needs_windows_of_one_length_and_nine_groups(toy, saved):
    with pytest.raises(InputError, match=r"fewer than 9 groups\. Accepted: a model that can be fitted"):
        sb.fit_band("hold", toy(runs=8))
    data = toy(runs=12)
    with pytest.raises(InputError, match="cut them with windows"):
        sb.fit_band("hold", data.with_runs([*data.runs[:-1], data.runs[-1].slice(0, 9)]))
    with pytest.raises(InputError, match=r"is a saved model, which is not fitted again\. Give the spec"):
        sb.fit_band(saved, data)
    assert Path(saved, BAND_FILE).exists()
