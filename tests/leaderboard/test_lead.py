"""Sentence, tiles and short table on the best model of a leaderboard."""

from __future__ import annotations

import numpy as np
import pytest
from made_results import results

from shipbench.leaderboard.lead import lead, lead_tiles, short_table
from shipbench.leaderboard.pages import scores_of
from shipbench.leaderboard.scores import Scores
from shipbench.leaderboard.tables import table_iii


def scores(**models) -> Scores:
    return scores_of(results(models), "toy")


def errors(mean: float, spread: float, seed: int = 0) -> list[list[float]]:
    """ED of two folds of 15 runs."""
    return np.random.default_rng(seed).normal(mean, spread, (2, 15)).tolist()


def test_without_any_score_there_is_no_best_model():
    assert lead(scores(m=[[None, None]])).startswith("No model has a score")


def test_a_model_alone_is_told_with_its_interval_and_its_runs():
    text = lead(scores(m=errors(10.0, 1.0)))
    assert text.startswith("'m' has a mean position error (ED) of 9.")
    assert "(95 %: " in text
    assert text.endswith("over 30 runs.")


@pytest.mark.parametrize(
    ("second", "told"),
    [
        (errors(20.0, 1.0, 1), "The difference is significant: "),
        (errors(10.3, 3.0, 1), "The difference is not significant: "),
        (errors(10.0, 1.0, 0), "They do not differ on 30 runs."),
    ],
)
def test_a_difference_is_called_significant_below_5_percent_alone(second: list[list[float]], told: str):
    found = scores(a=errors(10.0, 1.0), b=second)
    assert told in lead(found)
    tile = next((t for t in lead_tiles(found, 20.0) if t.label == "Difference in ED"), None)
    assert (tile is None) is ("do not differ" in told)
    if tile is not None:
        assert tile.value == ("not significant" if "not significant" in told else "significant")


def test_a_model_with_unscored_runs_is_second_and_not_compared():
    first, second = errors(10.0, 1.0), errors(5.0, 1.0, 1)
    second[0][0] = None
    found = scores(a=first, b=second)
    assert "'a' is first" in lead(found)
    assert "They are not compared, since one of them lacks a score on some runs." in lead(found)
    tiles = {t.label: t.value for t in lead_tiles(found, 20.0)}
    assert (tiles["Windows"], tiles["Models"], tiles["Not scored"]) == ("30", "2", "1")


def test_the_short_table_has_means_alone_and_no_note_on_the_others():
    full = table_iii(scores(m=errors(10.0, 1.0)))
    short = short_table(full)
    assert [c.key for c in short.columns if c.format] == ["ed_mean", "edh_mean", "cvdm_mean"]
    assert any("standard deviation" in note for note in full.notes)
    assert not any("standard deviation" in note for note in short.notes)
