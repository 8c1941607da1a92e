"""Segments that are not fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_fit, made_plant

from shipbench.estimation.laplace import Fit
from shipbench.estimation.outliers import left_out, strange_pieces
from shipbench.estimation.thresholds import THRESHOLDS
from shipbench.records import Run

FEW = THRESHOLDS.count("segments_per_outlier")


def pushed(pieces: dict[int, float], num: int = 3 * FEW) -> Fit:
    """A fit whose latent sway force has a variance of 1 in all segments, and a mean of so many in `pieces`."""
    fit = made_fit(plant=made_plant(num))
    knots, estimate = fit.plant.knots, fit.estimate.copy()
    for piece, force in pieces.items():
        estimate[piece, 6 + knots : 6 + 2 * knots] = force
    latent = estimate.shape[1]
    solved = np.zeros((num, latent, fit.reduced.S.shape[1]))
    return replace(
        fit,
        estimate=estimate,
        reduced=replace(fit.reduced, inverse=np.tile(np.eye(latent), (num, 1, 1)), solved=solved),
    )


def test_segments_that_are_pushed_far_harder_than_the_others_are_outliers_the_largest_first():
    assert strange_pieces(pushed({3: 40.0, 7: 80.0})).tolist() == [7, 3]
    assert strange_pieces(pushed({})).tolist() == []
    assert strange_pieces(pushed({3: 1.5})).tolist() == []


def test_no_more_than_a_share_of_the_segments_are_outliers():
    assert len(strange_pieces(pushed({i: 60.0 + i for i in range(4)}))) <= 3
    assert strange_pieces(pushed({0: 80.0}, FEW - 1)).tolist() == []


def run(steps: int) -> Run:
    return Run("a", np.arange(steps + 1.0), np.zeros((steps + 1, 10)), np.zeros((steps + 1, 4)))


@pytest.mark.parametrize(("steps", "said"), [(2, False), (200, True)])
def test_the_share_of_a_long_record_that_is_fitted_is_said(steps: int, said: bool):
    told = left_out(made_plant(1), [run(steps)])
    assert bool(told) is said
    if said:
        assert "of the record is fitted, 1 pieces of 2 s" in told[0]


def test_an_outlier_is_named_by_its_run_and_its_time():
    told = left_out(made_plant(2).without(np.array([1])), [run(2), replace(run(2), id="b")])
    assert "run 'b', 0 to 2 s" in told[-1]
    assert "run 'a'" not in told[-1]
