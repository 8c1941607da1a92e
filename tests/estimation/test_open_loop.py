"""Open-loop rollouts: what counts as an error, and how it is counted."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.estimation.coefficients import NUM_BASE
from shipbench.estimation.linearisation import Scales
from shipbench.estimation.open_loop import Rollout, cost, distance, errors, rolled, sizes

PRIOR = Rollout(np.zeros(NUM_BASE), (), ())


@pytest.fixture
def lin(plant):
    return rolled(plant, Scales(plant), PRIOR)


def test_a_rollout_begins_at_the_measured_state_and_errs_later(plant, lin):
    e = errors(lin).reshape(len(plant.seg.run), -1, 6)
    np.testing.assert_allclose(e[:, 0], 0.0, atol=1e-12)
    assert (np.abs(e[:, -1, :2]).max(axis=1) > 0.0).all()


def test_positions_are_one_channel(lin):
    size = sizes(lin)
    assert size[0] == size[1]
    assert (size > 0.0).all()


def test_the_distance_is_the_mean_over_samples_but_the_first(plant, lin):
    ed = np.hypot(*np.moveaxis(lin.predicted[..., :2] - plant.seg.states[..., :2], -1, 0))[:, 1:]
    mask = plant.seg.mask[:, 1:]
    found, motion = distance(plant, Scales(plant), PRIOR)
    for run in range(plant.seg.runs):
        of = plant.seg.run == run
        assert found[run] == pytest.approx(ed[of][mask[of]].mean())
    np.testing.assert_array_equal(motion, lin.predicted)


def test_a_segment_that_diverges_has_a_bounded_cost(lin):
    weights = np.ones_like(errors(lin))
    whole = cost(lin, weights)
    lin.predicted[0, 1:] = np.nan
    assert np.isfinite(cost(lin, weights))
    assert cost(lin, weights) > whole
