"""Metrics against values worked out by hand from the seed paper's eq. (15) to (17)."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.metrics.base import METRICS
from shipbench.signals import DELTA, F_B, PSI, STATES, R, U, V, X, Y

ALL = ("ed", "edh", "cvdm", "final_displacement", "heading_error", "position_rmse", "signal_rmse")


def score(name, true, pred, s0=None, L=100.0, dt=1.0):
    s0 = np.zeros((len(true), 10)) if s0 is None else s0
    return METRICS.get(name).per_run(true=true, pred=pred, s0=s0, L=L, dt=dt)


def straight(speed=5.0, steps=4, batch=1):
    """A ship going north at `speed`, from the origin."""
    true = np.zeros((batch, steps, 10))
    true[..., X] = speed * np.arange(1, steps + 1)
    true[..., U] = speed
    return true


def test_every_metric_of_the_default_task_is_registered():
    assert METRICS.names() == sorted([*ALL, "trial_indices"])  # the last one has a file of tests of its own


@pytest.mark.parametrize("name", ALL)
def test_a_perfect_prediction_scores_zero(name):
    true = straight()
    assert all(np.all(v == 0) for v in score(name, true, true.copy()).values())


@pytest.mark.parametrize("name", ALL)
def test_scores_do_not_change_the_arrays(name):
    true, pred = straight(), straight(4.0)
    before = true.copy(), pred.copy()
    score(name, true, pred)
    np.testing.assert_array_equal(before, (true, pred))


def test_ed_is_the_mean_distance_over_the_predicted_knots():
    true, pred = straight(), straight()
    pred[0, :, X] += [3.0, 0.0, 0.0, 0.0]
    pred[0, :, Y] += [4.0, 0.0, 0.0, 3.0]
    np.testing.assert_allclose(score("ed", true, pred)["ed"], [(5.0 + 3.0) / 4])


def test_edh_adds_half_a_length_times_the_heading_error():
    true, pred = straight(), straight()
    pred[0, :, Y] += 2.0
    pred[0, :, PSI] -= 0.1
    np.testing.assert_allclose(score("edh", true, pred, L=130.0)["edh"], [2.0 + 65.0 * 0.1])


@pytest.mark.parametrize(
    ("true_psi", "pred_psi"), [(np.pi - 0.05, -np.pi + 0.05), (-np.pi + 0.05, np.pi - 0.05), (0.05, 4 * np.pi - 0.05)]
)
def test_heading_errors_are_taken_the_short_way_round(true_psi, pred_psi):
    true, pred = straight(), straight()
    true[..., PSI], pred[..., PSI] = true_psi, pred_psi
    np.testing.assert_allclose(score("heading_error", true, pred)["heading_error"], [0.1], rtol=1e-9)
    np.testing.assert_allclose(score("edh", true, pred, L=100.0)["edh"], [5.0], rtol=1e-9)
    np.testing.assert_allclose(score("cvdm", true, pred)["cvdm"], [100 * 0.1 / np.pi], rtol=1e-9)
    np.testing.assert_allclose(score("signal_rmse", true, pred)["rmse_psi"], [0.1], rtol=1e-9)


def test_cvdm_by_hand():
    # True track: 4 steps of 5 m from s0 = origin, so Lt = 20 m, Ut = 5 m/s.
    true, pred = straight(), straight()
    for signal, error in ((X, 1.0), (Y, -2.0), (PSI, 0.1), (U, 0.5), (V, -0.25), (R, 0.01)):
        pred[0, :2, signal] += error  # at two of the four knots
    knot = 1 / 20 + 2 / 20 + 0.1 / np.pi + 0.5 / 5 + 0.25 / 5 + 0.01 / (np.pi / 100)
    np.testing.assert_allclose(score("cvdm", true, pred)["cvdm"], [100 * knot / 2], rtol=1e-12)


def test_cvdm_takes_the_track_from_s0_on():
    true, pred = straight(steps=1), straight(steps=1)
    pred[..., X] += 1.0
    s0 = np.zeros((1, 10))
    s0[0, Y] = -12.0  # the first step goes from (0, -12) to (5, 0): 13 m
    np.testing.assert_allclose(score("cvdm", true, pred, s0=s0)["cvdm"], [100 / 13], rtol=1e-12)


def test_cvdm_scales_each_run_by_itself():
    true = np.concatenate([straight(5.0), straight(10.0)])
    pred = true.copy()
    pred[..., Y] += 1.0
    np.testing.assert_allclose(score("cvdm", true, pred)["cvdm"], [100 / 20, 100 / 40], rtol=1e-12)


def test_cvdm_of_a_ship_that_does_not_move_is_undefined_and_the_other_runs_are_not_disturbed():
    true = np.concatenate([np.zeros((1, 4, 10)), straight()])
    pred = true + 0.0
    pred[..., Y] += 1.0
    values = score("cvdm", true, pred)["cvdm"]
    assert np.isnan(values[0])
    np.testing.assert_allclose(values[1], 5.0)


def test_final_displacement_is_the_distance_at_the_last_knot():
    true, pred = straight(), straight()
    pred[0, -1, X] -= 6.0
    pred[0, -1, Y] += 8.0
    np.testing.assert_allclose(score("final_displacement", true, pred)["final_displacement"], [10.0])


def test_position_rmse_is_the_root_of_the_mean_square_and_not_the_mean_distance():
    true, pred = straight(), straight()
    pred[0, :, Y] += [0.0, 0.0, 0.0, 4.0]
    np.testing.assert_allclose(score("position_rmse", true, pred)["position_rmse"], [2.0])
    np.testing.assert_allclose(score("ed", true, pred)["ed"], [1.0])


def test_signal_errors_stay_apart_each_in_its_own_unit():
    true, pred = straight(), straight()
    pred[..., DELTA] += 0.2
    pred[..., F_B] -= 1000.0
    values = score("signal_rmse", true, pred)
    assert {k: float(v[0]) for k, v in values.items() if v[0]} == pytest.approx({"rmse_delta": 0.2, "rmse_F_b": 1000.0})
    units = {c.name: c.unit for c in METRICS.get("signal_rmse").columns}
    assert units["rmse_n"] == "rpm"
    assert units["rmse_F_b"] == "N"
    assert units["rmse_r"] == "rad/s"


def test_every_signal_but_the_position_has_its_own_error():
    assert [c.name for c in METRICS.get("signal_rmse").columns] == [f"rmse_{s}" for s in STATES[2:]]


@pytest.mark.parametrize("name", ALL)
def test_metrics_score_a_batch_as_they_score_its_runs_one_by_one(name):
    rng = np.random.default_rng(0)
    true, pred, s0 = rng.normal(size=(3, 5, 10)), rng.normal(size=(3, 5, 10)), rng.normal(size=(3, 10))
    together = score(name, true, pred, s0)
    for column, values in together.items():
        alone = [score(name, true[i : i + 1], pred[i : i + 1], s0[i : i + 1])[column][0] for i in range(3)]
        np.testing.assert_allclose(values, alone, rtol=1e-12)


def test_a_prediction_that_still_holds_s0_is_refused():
    true = straight()
    with pytest.raises(InputError, match=r"true \(1, 4, 10\), pred \(1, 5, 10\)"):
        score("ed", true, np.zeros((1, 5, 10)))


def test_metric_arguments_are_keyword_only():
    with pytest.raises(TypeError):
        METRICS.get("ed").function(straight(), straight())
