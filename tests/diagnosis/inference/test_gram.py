"""The algebra of the diagnosis against direct computation."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.inference.gauss_newton import Origin, fit, start
from shipbench.diagnosis.inference.gram import (
    ETA_PRECISION,
    Hyper,
    Prior,
    Products,
    accelerated,
    by_run,
    ornstein_uhlenbeck,
    solve,
)
from shipbench.diagnosis.inference.laplace import Model, products_of, settle
from shipbench.diagnosis.inference.linalg import inverses, log_determinant
from shipbench.diagnosis.model.between_ships import STRUCTURE
from shipbench.diagnosis.model.forward import Plant
from shipbench.diagnosis.model.linearisation import Linearisation, Scales, predict
from shipbench.diagnosis.model.term import Term
from shipbench.diagnosis.selection.screening import _wrong_way
from shipbench.effects.base import EFFECTS, flow_first
from shipbench.physics import eq2
from shipbench.physics.mmg import load_mmg_ship
from shipbench.physics.modifiers import Flow, Modifiers
from shipbench.simulate.trials import Trials, sea_trials


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant.of(sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=4, samples=60)))


def test_the_evidence_is_that_of_the_joint_gaussian():
    rng = np.random.default_rng(0)
    knots, G, T = 3, 2, 6 * 5
    Z = rng.standard_normal((2, T, 6 + 3 * knots + G + 1))
    hyper = Hyper(np.array([0.1, -0.3, 0.2]), rng.normal(0.0, 0.2, 6), 2.0)
    gram = Products.of(
        np.moveaxis(Z.reshape(2, 5, 6, -1), 2, 0), np.ones((2, 5), dtype=bool), knots, 1.0, np.array([0, 1]), 2
    ).weigh(hyper)
    prior = Prior(np.array([0]), np.array([0.7]), np.array([1]), np.array([0.4]))
    found = solve(gram.reduce(hyper.log_force), prior).log_evidence
    K = np.linalg.inv(ornstein_uhlenbeck(knots, 1.0, 2.0)[0])
    noise = np.diag(np.tile(np.exp(hyper.log_noise), 5))
    C = np.zeros((2 * T, 2 * T))
    for b in range(2):
        S_eta, S_w, own = Z[b, :, :6], Z[b, :, 6 : 6 + 3 * knots], Z[b, :, -2:-1]
        W = np.kron(np.diag(np.exp(hyper.log_force)), K)
        at = slice(b * T, (b + 1) * T)
        C[at, at] = noise + S_eta @ S_eta.T / ETA_PRECISION + S_w @ W @ S_w.T + np.exp(0.4) * own @ own.T
    shared = Z[:, :, -3].reshape(-1, 1)
    C += shared @ shared.T / 0.7
    e = Z[:, :, -1].ravel()
    expected = -0.5 * (e @ np.linalg.solve(C, e) + np.linalg.slogdet(C)[1])
    assert found == pytest.approx(expected, rel=1e-9)


def test_sensitivities_are_those_of_the_rollout(plant):
    scales = Scales(plant)
    point, _ = start(plant)
    columns = Linearisation(plant, scales, point).columns()
    step = 1e-4
    for i in (0, 3, 8, 16):
        moved = replace(point, base=point.base + step * np.eye(len(point.base))[i])
        slope = (predict(plant, scales, moved) - columns.predicted) / step
        got = columns.base[..., i].reshape(slope.shape)
        assert np.abs(got - slope).max() < 0.02 * np.abs(slope).max() + 1e-9
    moved = replace(point, w=point.w + step * np.eye(plant.knots)[4][None, :, None] * np.array([0.0, 1.0, 0.0]))
    slope = (predict(plant, scales, moved) - columns.predicted) / step
    assert np.abs(columns.w[..., plant.knots + 4].reshape(slope.shape) - slope).max() < 0.02 * np.abs(slope).max()


def test_a_guess_whose_gaps_are_chained_gives_the_rollout_of_a_linear_change(plant):
    scales = Scales(plant)
    point, _ = start(plant)
    lin = Linearisation(plant, scales, point)
    lin.columns()
    near = replace(point, base=point.base + 1e-3)
    lifted = Linearisation(plant, scales, near, lin.towards(near)).predicted
    assert np.abs(lifted - predict(plant, scales, near)).max() < 1e-3


def test_the_latent_force_puts_the_model_on_the_measurement(plant):
    scales = Scales(plant)
    origin = Origin.of(plant, scales)
    found = fit(plant, scales, Model(), origin.point, origin.hyper, guess=origin.motion)
    noise = np.exp(0.5 * found.hyper.log_noise) * scales.noise
    assert noise[0] == pytest.approx(0.5 * plant.c.L / 130.0, rel=0.3)  # the simulated position noise is found again
    rest = (plant.seg.states[..., :6] - found.columns.predicted) / noise
    assert np.sqrt(np.mean(rest[plant.seg.mask] ** 2)) < 1.5


def test_an_effect_with_one_value_per_run_has_its_own_columns_in_every_run(plant):
    scales = Scales(plant)
    point, hyper = start(plant)
    term = Term(EFFECTS.get("current_per_run"), per_run=True)
    point = replace(point, terms=(term,), values=(np.zeros((plant.seg.runs, 2)),))
    settled = settle(Linearisation(plant, scales, point), Model((term,)), hyper, {})
    assert settled.values[0].shape == (plant.seg.runs, 2)
    assert np.isfinite(settled.evidence)


def test_the_variance_of_values_per_run_does_not_vanish_at_once(plant):
    """Far from rest the linear model may want none of them."""
    scales = Scales(plant)
    point, hyper = start(plant)
    term = Term(EFFECTS.get("current_per_run"), per_run=True)
    point = replace(point, terms=(term,), values=(np.full((plant.seg.runs, 2), 0.5),))
    found = settle(Linearisation(plant, scales, point), Model((term,)), hyper, {0: 3.0})
    assert found.log_tau2[0] == pytest.approx(2.5)


def test_accelerated_steps_reach_the_rest_of_a_creeping_iteration():
    """Steps that close 2 % of the distance: as many plain ones would be 60 % short."""
    rest = np.array([1.0, -3.0])

    def step(theta: np.ndarray) -> tuple[float, np.ndarray]:
        return -float(np.sum((theta - rest) ** 2)), theta + np.array([0.02, 0.05]) * (rest - theta)

    assert np.abs(accelerated(step, np.zeros(2), 8) - rest).max() < 0.15


def test_a_leap_that_loses_evidence_is_not_taken():
    """Two linear stretches: extrapolated over the bend, the leap would land far beyond it."""

    def step(theta: np.ndarray) -> tuple[float, np.ndarray]:
        return -abs(float(theta[0]) - 1.0), np.minimum(theta + np.array([0.3]), 1.0)

    assert accelerated(step, np.array([-0.1]), 3) == pytest.approx(1.0)


def test_a_refit_ends_where_another_start_does(plant):
    """The evidence belongs to the model, not to the path of the fit."""
    scales = Scales(plant)
    origin = Origin.of(plant, scales)
    one = fit(plant, scales, Model(), origin.point, origin.hyper, guess=origin.motion)
    far = replace(origin.point, base=origin.point.base + 0.5 * np.cos(np.arange(len(origin.point.base))))
    other = fit(plant, scales, Model(), far, origin.hyper, guess=origin.motion)
    assert other.evidence == pytest.approx(one.evidence, abs=0.5)


def test_environment_comes_before_the_forces_that_follow_the_flow():
    """A current beside a cross-flow drag, named in either order, is the same model."""
    items = [Term(EFFECTS.get(name), ()) for name in ("cross_flow_drag", "current")]
    assert (
        [i.effect.name for i in flow_first(items)]
        == ["current", "cross_flow_drag"]
        == [i.effect.name for i in flow_first(items[::-1])]
    )


def test_what_was_chosen_among_many_costs_more():
    """Twice log of the number of shapes, or of runs where it may begin; a random effect for its variance."""
    bank, wind = EFFECTS.get("bank_suction"), EFFECTS.get("wind_per_run")
    assert Term(bank, (0.0, 100.0), choices=4).cost(24) == pytest.approx(2.0 * np.log(4.0))
    assert Term(EFFECTS.get("list"), ()).cost(24) == 0.0
    assert Term(EFFECTS.get("list"), (), since=7).cost(24) == pytest.approx(2.0 * np.log(24.0))
    assert Term(wind, (), per_run=True).cost(24) > np.log(24.0)


@pytest.mark.parametrize("u", [2.0, -2.0])
def test_ordinary_differences_have_a_value_at_which_eq_2_is_alone(plant, u):
    """Astern, too, where the race does not reach the rudder and hull and rudder have parameters of their own."""
    flow = Flow(*([0.0] * 4), u, 0.3, 0.01, -60.0, 0.2, 0.0, 0.0)
    found, alone = Modifiers(), Modifiers()
    STRUCTURE.force(
        found,
        flow,
        tuple(p.typical * v for p, v in zip(STRUCTURE.parameters, STRUCTURE.plain(), strict=True)),
        plant.ship,
    )
    p = (0.0,) + (1e3,) * 3 + (1.0,) * 7
    changed, usual = (
        eq2.accelerations(u, 0.3, 0.01, -60.0, 0.2, 0.0, 0.0, None, plant.c, p, m) for m in (found, alone)
    )
    assert changed == pytest.approx(usual, rel=1e-9)


def test_a_reversed_propeller_stops_the_flow_at_the_rudder_with_headway_alone(plant):
    def of(u, name, value):
        mods = Modifiers()
        values = [value * p.typical * (p.name == name) for p in STRUCTURE.parameters]
        STRUCTURE.force(mods, Flow(*([0.0] * 4), u, 0.3, 0.01, -60.0, 0.2, 0.0, 0.0), values, plant.ship)
        return mods

    assert of(2.0, "race", 1.0).race > of(2.0, "race", 0.0).race
    assert (
        of(-2.0, "race", 1.0).race == of(2.0, "race", 1.0).race
    )  # the flow has a sign: what drives ahead meets sternway there
    assert of(2.0, "backing", 1.0).backing > of(2.0, "backing", 0.0).backing > of(-2.0, "backing", 1.0).backing == 0.0
    assert of(-2.0, "N_v_astern", 1.0).hull.N_v < of(-2.0, "N_v_astern", 0.0).hull.N_v < 0.0
    assert of(2.0, "N_v_astern", 1.0).hull.N_v == pytest.approx(1.0, abs=0.02)


def test_sums_by_run_are_those_of_reduceat():
    run = np.array([0, 1, 1, 1, 2, 2, 5])
    values = np.random.default_rng(0).standard_normal((7, 3, 3))
    np.testing.assert_allclose(by_run(values, run), np.add.reduceat(values, [0, 1, 4, 6]), rtol=1e-12)


def test_products_of_some_channels_are_rows_of_those_of_all(plant):
    """With noise that lasts in one of them, and a piece that ends early."""
    scales = Scales(plant)
    seg = replace(
        plant.seg,
        mask=plant.seg.mask
        & (np.arange(plant.steps + 1) < plant.steps - 3 * (np.arange(len(plant.seg.run)) == 1)[:, None]),
    )
    short = copy(plant)
    short.seg = seg
    point, _ = start(plant)
    columns, coloured = (
        Linearisation(short, scales, point).columns(),
        scales.coloured(scales.colour.with_channel(2, 4.0, 6.0)),
    )
    whole, some = products_of(short, coloured, point, columns), products_of(short, coloured, point, columns, [2, 5])
    assert coloured.colour.differs(scales.colour) == [2]
    np.testing.assert_allclose(some.P, whole.P[[2, 5]], rtol=1e-12)
    e = (seg.states[..., 2] - columns.predicted[..., 2]) / scales.noise[2]
    white = np.where(seg.mask, e @ coloured.colour.factor[2].T, 0.0)
    np.testing.assert_allclose(whole.P[2, :, -1, -1], np.sum(white**2, axis=1), rtol=1e-9)


def test_log_determinants_of_sound_and_of_blown_up_matrices():
    rng = np.random.default_rng(0)
    J = rng.standard_normal((5, 12, 8))
    sound = np.swapaxes(J, 1, 2) @ J + np.eye(8)
    np.testing.assert_allclose(log_determinant(sound), np.linalg.slogdet(sound)[1], rtol=1e-12)
    J[2, :, 0] *= 1e18
    J[2, :, 1] = J[2, :, 0]  # rounding alone decides whether this is positive definite
    blown = np.swapaxes(J, 1, 2) @ J - 1e25 * np.eye(8) * (np.arange(5) == 2)[:, None, None]
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(blown)
    assert np.isfinite(log_determinant(blown)).all()
    np.testing.assert_array_equal(inverses(blown)[0], np.linalg.inv(blown))


@pytest.mark.parametrize(("count", "size"), [(1, 1), (8, 5), (19, 40)])
def test_inverses_of_many_matrices_are_those_of_each(count, size):
    J = np.random.default_rng(size).standard_normal((count, 2 * size, size)) * np.logspace(-4, 4, size)
    A = np.swapaxes(J, 1, 2) @ J
    inverse, logdet = inverses(A)
    unit = np.sqrt(np.diagonal(A, axis1=1, axis2=2))  # columns of very different sizes
    expected = np.linalg.inv(A / unit[:, :, None] / unit[:, None, :])
    np.testing.assert_allclose(inverse * unit[:, :, None] * unit[:, None, :], expected, atol=1e-9)
    np.testing.assert_allclose(logdet, np.linalg.slogdet(A)[1], rtol=1e-10)


def test_a_fit_that_has_not_come_to_rest_is_charged_with_the_cost_it_has(plant):
    """One step from far away promises much; the evidence counts what was reached, and the best point of the path is
    kept."""
    scales = Scales(plant)
    origin = Origin.of(plant, scales)
    far = replace(origin.point, base=origin.point.base + 2.0 * np.cos(np.arange(len(origin.point.base))))
    short, long = (fit(plant, scales, Model(), far, origin.hyper, iterations=k, guess=origin.motion) for k in (1, 20))
    assert short.excess > 10.0
    assert short.evidence < short.solution.log_evidence - 5.0
    assert long.excess < 1.0
    assert long.evidence > short.evidence


@pytest.mark.parametrize(
    ("name", "estimate", "wrong"),
    [
        ("rudder_lag", -0.2, True),
        ("rudder_lag", 0.2, False),
        ("shallow_water", -0.1, True),
        ("heading_bias", -0.2, False),
    ],
)
def test_what_only_slows_or_narrows_is_no_candidate_for_the_contrary(name, estimate, wrong):
    assert _wrong_way(Term(EFFECTS.get(name)), np.array([estimate])) == wrong
    assert not _wrong_way(Term(EFFECTS.get("current")), np.array([estimate, estimate]))
