"""Bands: whole groups are left out, the quantile is that of one more group, and a study scores and verifies them."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest

from shipbench.bench.bands import LEAST_GROUPS, PARTS, band_factor, band_shape, without_parts
from shipbench.bench.results import Cell, read_band, rescore
from shipbench.bench.runner import run_tasks
from shipbench.bench.scoring import BAND, band_scores
from shipbench.bench.submissions import read_results
from shipbench.bench.task import make_task
from shipbench.leaderboard.pages import build_board
from shipbench.leaderboard.verify import verify

MODELS = """
import numpy as np

class Holds:
    seeded = False
    def fit(self, train, valid=None, *, seed=0):
        return self
    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1], axis=1)

class Draws(Holds):
    def predict_samples(self, s0, U, samples=100, *, seed=0):
        noise = np.random.default_rng(seed).standard_normal((samples, *U.shape[:2], 6))
        return self.predict(s0, U)[None, ..., :6] + 1e-3 * (1.0 + np.arange(U.shape[1])[:, None]) * noise

class FitsManyOnly(Holds):
    def fit(self, train, valid=None, *, seed=0):
        if len(train) < 14:
            raise ValueError("too few runs")
        return self
"""


@pytest.fixture
def study(toy, tmp_path, monkeypatch):
    """Runs models of the file above with bands on 24 runs of the toy ship, two of a group."""
    (tmp_path / "models.py").write_text(MODELS)
    data = toy(runs=24, meta=lambda i: {"group": f"g{i // 2}"})
    monkeypatch.setattr("shipbench.bench.runner.load_dataset", lambda name: data)
    monkeypatch.setattr("shipbench.leaderboard.verify.load_dataset", lambda name: data)

    def run(*models, out="out", **task):
        specs = [f"{tmp_path / 'models.py'}:{m}" for m in models]
        settings = {"dataset": "toy", "models": specs, "horizon_s": 20, "folds": 4, "bands": True, **task}
        return run_tasks([make_task(settings)], tmp_path / out)

    return run


def test_parts_are_whole_groups_and_together_all_runs(toy):
    train = toy(runs=20, meta=lambda i: {"group": f"g{i // 2}"})
    valid = train.with_runs(train.runs[16:])
    train = train.with_runs(train.runs[:16])
    parts = without_parts(train, valid)
    assert len(parts) == PARTS
    assert sorted(r.id for _, _, out in parts for r in out.runs) == [f"r{i:02d}" for i in range(20)]
    for kept, kept_valid, out in parts:
        rest = {r.group for r in kept.merged(kept_valid).runs}
        assert not rest & {r.group for r in out.runs}
        assert len(rest) == 8
        assert kept_valid is not None


def test_too_few_groups_give_no_band(toy):
    assert without_parts(toy(runs=LEAST_GROUPS - 1), None) == []
    assert len(without_parts(toy(runs=LEAST_GROUPS), None)) == PARTS


def test_the_factor_of_nine_groups_is_the_largest_ratio_and_of_eight_none():
    ratios = np.arange(1.0, 10.0)[:, None, None] * np.ones((1, 3, 6))
    assert (band_factor(ratios, [f"g{i}" for i in range(9)]) == 9.0).all()
    assert np.isinf(band_factor(ratios[:8], [f"g{i}" for i in range(8)])).all()
    assert (band_factor(np.repeat(ratios, 11, axis=0), [f"g{i}" for i in range(99)]) == 9.0).all()


def test_every_group_counts_the_same_however_many_windows_it_has():
    ratios = np.concatenate([np.ones(19), np.full(500, 5.0)])[:, None, None] * np.ones((1, 1, 6))
    assert (band_factor(ratios, [*(f"g{i}" for i in range(19)), *["long"] * 500]) == 1.0).all()


def test_a_ratio_that_is_not_finite_counts_as_the_largest():
    ratios = np.ones((20, 1, 6))
    ratios[0] = np.nan
    assert (band_factor(ratios, [str(i) for i in range(20)]) == 1.0).all()
    ratios[:3] = np.nan
    assert np.isinf(band_factor(ratios, [str(i) for i in range(20)])).all()


def test_the_factor_holds_the_share_of_new_groups():
    rng = np.random.default_rng(0)
    inside = []
    for _ in range(3000):
        drawn = np.abs(rng.standard_normal((21, 1, 6))) + rng.exponential(size=(21, 1, 1))
        inside.append((drawn[20] <= band_factor(drawn[:20], [str(i) for i in range(20)])).mean())
    assert np.isclose(np.mean(inside), 19.0 / 21.0, atol=0.015)


def test_the_shape_is_that_of_own_samples_or_one():
    class Own:
        def predict_samples(self, s0, U, samples):
            return np.linspace(-1.0, 1.0, 101)[:, None, None, None] * np.ones((1, len(s0), U.shape[1], 6))

    s0, U = np.zeros((2, 10)), np.zeros((2, 3, 4))
    np.testing.assert_allclose(band_shape(Own(), s0, U), np.full((2, 3, 6), 0.9))
    np.testing.assert_array_equal(band_shape(object(), s0, U), np.ones((2, 3, 6)))


def test_the_interval_score_adds_twenty_times_the_distance_outside_and_the_heading_is_wrapped():
    truth, S, W = np.zeros((1, 10, 10)), np.zeros((1, 10, 10)), np.ones((1, 10, 6))
    S[..., 0], S[..., 2] = 1.5, 2.0 * np.pi + 0.5
    found = band_scores(truth, S, W, 1.0)
    assert found[f"{BAND}position_at_10s"] == 50.0
    assert found[f"{BAND}heading_at_10s"] == 100.0
    np.testing.assert_allclose(found[f"{BAND}position_score"], 2.0 + 0.5 * 20.0 * 0.5)
    np.testing.assert_allclose(found[f"{BAND}heading_score"], 2.0)
    assert np.isnan(list(band_scores(truth, S, np.nan * W, 1.0).values())).all()


def test_a_study_with_bands_has_the_same_predictions_and_one_more_table(study, tmp_path):
    outcome, plain = study("Holds", "Draws"), study("Holds", out="plain", bands=False)
    rows = outcome.rows
    inside = rows.groupby("model")[[c for c in rows if c.startswith(BAND) and c.endswith("0s")]].mean()
    assert ((inside > 75.0) & (inside <= 100.0)).all(axis=None)
    own = rows[rows["model"].str.endswith("Holds")].reset_index(drop=True)
    pd.testing.assert_series_equal(own["ed"], plain.rows["ed"])
    assert set(own["task"]) == set(plain.rows["task"])
    assert not any(c.startswith(BAND) for c in plain.rows)
    tables = [t.title for t in build_board(outcome.results, "toy").tables]
    assert "90 % bands" in tables
    assert "no_band" not in str(outcome.summaries)
    assert "90 % bands" not in [t.title for t in build_board(plain.results, "toy").tables]
    s = outcome.summaries[0]
    width = read_band(tmp_path / "out", Cell("toy", s["model"], 0, 0))
    assert width is not None
    assert width.shape == (6, 20, 6)
    again = rescore(tmp_path / "out", s)
    first = rows[(rows.model == s["model"]) & (rows.fold == 0)]
    for name in (c for c in rows if c.startswith(BAND)):
        np.testing.assert_allclose(again[name], first[name])


@pytest.mark.long
def test_bands_are_verified(study, tmp_path):
    study("Holds")
    assert verify(read_results(tmp_path / "out"))[0] == []
    file = next((tmp_path / "out").glob("cells/*/*/fold1-seed0/predictions.npz"))
    saved = dict(np.load(file))
    np.savez_compressed(file, S=saved["S"], W=2.0 * saved["W"])
    assert any(f"{BAND}position_score is" in line for line in verify(read_results(tmp_path / "out"))[0])
    np.savez_compressed(file, S=saved["S"])
    assert any("no band is saved" in line for line in verify(read_results(tmp_path / "out"))[0])


def test_a_model_that_cannot_be_fitted_to_fewer_runs_has_its_scores_and_no_band(study):
    outcome = study("FitsManyOnly")
    assert (outcome.rows["status"] == "ok").all()
    assert outcome.rows[[c for c in outcome.rows if c.startswith(BAND)]].isna().all(axis=None)
    assert "too few runs" in outcome.summaries[0]["no_band"]
    table = next(t for t in build_board(outcome.results, "toy").tables if t.title == "90 % bands")
    assert "`no_band` in summary.json" in table.notes[-1]


def test_too_few_runs_say_so(study):
    outcome = study("Holds", max_runs=10)
    assert "fewer than 9 groups" in outcome.summaries[0]["no_band"]


class Drawn:
    """A model whose samples are `drawn`."""

    def __init__(self, drawn: np.ndarray) -> None:
        self.drawn = drawn

    def predict_samples(self, s0: np.ndarray, U: np.ndarray, samples: int) -> np.ndarray:
        return self.drawn


def test_samples_of_another_shape_are_one_message_and_unknown_ones_no_warning():
    s0, U = np.zeros((2, 10)), np.zeros((2, 5, 4))
    with pytest.raises(ValueError, match=r"predict_samples: shape \(2, 10\); accepted: \(samples, 2, 5, 6 or 10\)"):
        band_shape(Drawn(s0), s0, U)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(band_shape(Drawn(np.full((100, 2, 5, 6), np.nan)), s0, U)).all()
