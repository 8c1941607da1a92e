"""Indices of standard manoeuvres: circles and headings with known answers, the simulator's own reading, and what is no
manoeuvre."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.metrics.base import METRICS
from shipbench.metrics.trial_indices import NAMES, overshoots, trial_indices, turning_indices
from shipbench.physics.mmg import load_mmg_ship
from shipbench.signals import DELTA, PSI, R, U, X, Y
from shipbench.simulate.manoeuvres import straight_state, turning_circle
from shipbench.simulate.simulator import Simulator

L = 100.0


def circle(radius=300.0, course=0.7, side=1.0, samples=800, speed=5.0):
    """States (1, samples, 10) of a steady turn from the origin that begins on `course`, its s0, and the rudder
    order."""
    t = np.arange(1, samples + 1)
    turned = speed * t / radius
    ahead, aside = radius * np.sin(turned), side * radius * (1 - np.cos(turned))
    S = np.zeros((1, samples, 10))
    S[0, :, X] = ahead * np.cos(course) - aside * np.sin(course)
    S[0, :, Y] = ahead * np.sin(course) + aside * np.cos(course)
    S[0, :, PSI] = course + side * turned
    S[0, :, U] = speed
    s0 = np.zeros((1, 10))
    s0[0, [PSI, U]] = course, speed
    orders = np.zeros((1, samples, 4))
    orders[0, :, 1] = side * np.deg2rad(35)
    return s0, S, orders


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("course", [0.0, 0.7, -2.0])
def test_a_circle_has_its_radius_and_diameter_on_any_course_and_side(course, side):
    s0, S, orders = circle(course=course, side=side)
    [found] = trial_indices(s0=s0, states=S, true=S, U=orders, L=L)
    np.testing.assert_allclose(found[:3], [3.0, 3.0, 6.0], rtol=1e-3)
    assert np.isnan(found[3:]).all()


def test_a_turn_that_does_not_come_round_has_an_advance_only():
    s0, S, orders = circle()
    steps = int(0.75 * np.pi * 300 / 5)
    found = trial_indices(s0=s0, states=S[:, :steps], true=S[:, :steps], U=orders[:, :steps], L=L)[0]
    assert np.isfinite(found[:2]).all()
    assert np.isnan(found[2])


def test_course_keeping_before_the_turn_is_left_out():
    s0, S, orders = circle(course=0.0)
    wait = 40
    ahead = np.zeros((1, wait, 10))
    ahead[0, :, X], ahead[0, :, U] = 5.0 * np.arange(1, wait + 1), 5.0
    later = S.copy()
    later[..., X] += 5.0 * wait
    helm = np.zeros((1, wait, 4))
    helm[0, :, 1] = np.deg2rad(3) * np.sin(np.arange(wait))
    both, inputs = np.concatenate([ahead, later], axis=1), np.concatenate([helm, orders], axis=1)
    found = trial_indices(s0=s0 * np.array([1, 1, 0, 1, 1, 1, 1, 1, 1, 1]), states=both, true=both, U=inputs, L=L)
    np.testing.assert_allclose(found[0, :3], [3.0, 3.0, 6.0], rtol=1e-3)


def zigzag(first=3.0, second=5.0):
    """Headings by the sample, rudder orders and reversals of a 10/10 zig-zag that starts to starboard."""
    up = np.concatenate([np.linspace(0, 10, 11), 10 + first * np.sin(np.linspace(0, np.pi, 9))[1:]])
    down = np.concatenate([np.linspace(10, -10, 21)[1:], -10 - second * np.sin(np.linspace(0, np.pi, 9))[1:]])
    psi = np.deg2rad(np.concatenate([up, down, np.linspace(-10, 0, 11)[1:]]))
    orders = np.full(len(psi) - 1, np.deg2rad(10.0))
    orders[10 : 10 + 8 + 20] *= -1
    return psi, orders


def test_overshoots_are_counted_from_the_heading_at_the_reversal():
    psi, orders = zigzag()
    S = np.zeros((1, len(psi) - 1, 10))
    S[0, :, PSI], S[..., U] = psi[1:], 5.0
    s0, inputs = np.zeros((1, 10)), np.zeros((1, len(orders), 4))
    s0[0, U], inputs[0, :, 1] = 5.0, orders
    [found] = trial_indices(s0=s0, states=S, true=S, U=inputs, L=L)
    np.testing.assert_allclose(np.rad2deg(found[3:]), [3.0, 5.0], atol=1e-9)
    assert np.isnan(found[:3]).all()
    mirrored = S * np.where(np.arange(10) == PSI, -1.0, 1.0)
    np.testing.assert_allclose(trial_indices(s0=s0, states=mirrored, true=mirrored, U=-inputs, L=L)[0, 3:], found[3:])


def test_an_overshoot_whose_end_is_not_seen_is_none():
    psi = np.deg2rad([0, 5, 10, 12, 13, 14])
    assert np.isnan(overshoots(psi, np.array([2]), 1.0)).all()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda s0, U: s0.__setitem__((0, R), 0.02), "the ship is turning already"),
        (lambda s0, U: s0.__setitem__((0, 3), 0.0), "the ship lies still"),
        (lambda s0, U: U.__setitem__((0, slice(300, None), 1), np.deg2rad(10)), "the rudder goes elsewhere"),
        (lambda s0, U: U.__imul__(0.05), "the rudder hardly moves"),
        (
            lambda s0, U: U.__setitem__((0, slice(None), 1), np.random.default_rng(0).uniform(-0.6, 0.6, 800)),
            "random orders",
        ),
    ],
)
def test_other_runs_have_no_index(change, why):
    s0, S, orders = circle()
    change(s0, orders)
    assert np.isnan(trial_indices(s0=s0, states=S, true=S, U=orders, L=L)).all(), why


def test_the_simulators_turning_circle_reads_the_same():
    sim = Simulator(load_mmg_ship("kvlcc2_l7"), 0.2)
    turn = turning_circle(sim, 1.179, 624.0, 35.0, 0.2, 60.0)
    orders = np.zeros((1, 300, 4))
    orders[..., 0], orders[..., 1] = 624.0, np.deg2rad(35.0)
    s0 = straight_state(1.179, 624.0)
    S = sim.rollout(s0, orders, 0.2)
    found = trial_indices(s0=s0, states=S, true=S, U=orders, L=sim.ship.L)[0]
    np.testing.assert_allclose(found[:3], [turn.advance, turn.transfer, turn.tactical_diameter])
    assert turning_indices(np.concatenate([s0[:, None], S], axis=1)[0], sim.ship.L) == pytest.approx(tuple(found[:3]))


def test_the_metric_is_predicted_less_true_and_needs_the_orders():
    s0, true, orders = circle()
    _, pred, _ = circle(radius=330.0)
    errors = METRICS.get("trial_indices").per_run(true=true, pred=pred, s0=s0, L=L, dt=1.0, U=orders)
    assert list(errors) == [f"{n}_error" for n in NAMES]
    assert errors["advance_error"] == pytest.approx(0.3, rel=1e-2)
    assert errors["tactical_diameter_error"] == pytest.approx(0.6, rel=1e-2)
    assert np.isnan(errors["overshoot_1_error"])
    with pytest.raises(InputError, match="needs the inputs"):
        METRICS.get("trial_indices").per_run(true=true, pred=pred, s0=s0, L=L, dt=1.0)


def test_which_runs_are_manoeuvres_does_not_depend_on_the_model():
    s0, true, orders = circle()
    wild = true.copy()
    wild[..., DELTA], wild[..., R] = 9.0, 9.0
    assert np.isfinite(trial_indices(s0=s0, states=wild, true=true, U=orders, L=L)[0, :3]).all()
