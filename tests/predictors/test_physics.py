"""The fitted physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.estimation.actuator_fit import DEFAULT_ACTUATORS, fit_actuators
from shipbench.physics import eq2
from shipbench.physics.actuators import lag_with_rate_limit
from shipbench.predictors.hold import Hold
from shipbench.predictors.physics import Physics
from shipbench.records import Batch, Dataset, Run
from shipbench.ship import complete
from shipbench.signals import COMMANDS


@pytest.fixture(scope="module")
def fitted(harbour) -> Physics:
    return Physics().fit(harbour)


def _synthetic(harbour: Dataset, p: np.ndarray) -> Dataset:
    """The same commands sailed by eq. (2) itself with known parameters."""
    truth = Physics().fit(harbour)
    truth.p = p
    batch = harbour.batch()
    S = np.concatenate([batch.s0[:, None], truth.predict(batch.s0, batch.U)], axis=1)
    runs = (Run(r.id, r.t, S[i], r.inputs) for i, r in enumerate(harbour.runs))
    return harbour.with_runs(runs)


def test_pieces_start_from_the_measured_state(harbour):
    """Runs cut to 30 s give the fit of the data so cut; a piece as long as the runs changes nothing; a negative one is
    refused."""
    few = harbour.subset(range(6))
    whole = Physics().fit(few)
    cut = Physics(piece=30.0).fit(few)
    np.testing.assert_allclose(cut.p, Physics().fit(few.windows(round(30.0 / few.dt))).p, rtol=1e-9)
    np.testing.assert_allclose(Physics(piece=1e4).fit(few).p, whole.p, rtol=1e-9)
    assert np.max(np.abs(cut.p - whole.p) / (np.abs(whole.p) + 1e-9)) > 1e-3
    with pytest.raises(ValueError, match="piece = -1"):
        Physics(piece=-1.0)


def test_known_actuators_are_recovered(fitted):
    """The rudder's rate limit is not asked for: these 16 runs never give it a step that reaches the limit."""
    T_n, rate_n, T_delta, _, T_F, _ = fitted.actuator_params
    assert T_n == pytest.approx(6.0, rel=0.02)
    assert rate_n == pytest.approx(6.0, rel=0.02)
    assert T_delta == pytest.approx(1.0, rel=0.02)
    assert pytest.approx(2.0, rel=0.05) == T_F


def test_hard_steps_reveal_the_rate_limit_and_an_idle_actuator_keeps_its_default():
    rng = np.random.default_rng(5)
    U = np.zeros((6, 60, 4))
    U[..., 1] = np.repeat(rng.uniform(-0.6, 0.6, (6, 3)), 20, axis=1)
    s0, truth = np.zeros((6, 10)), np.zeros((6, 60, 10))
    now = s0[:, 7]
    for k in range(60):
        now = lag_with_rate_limit(now, U[:, k, 1], 1.0, 1.4, np.deg2rad(3.0))
        truth[:, k, 7] = now
    found = fit_actuators(Batch(tuple("abcdef"), s0, U, truth), 1.0)
    np.testing.assert_allclose(found[2:4], [1.4, np.deg2rad(3.0)], rtol=0.01)
    np.testing.assert_array_equal(found[[0, 1, 4, 5]], DEFAULT_ACTUATORS[[0, 1, 4, 5]])


def test_known_parameters_of_its_own_structure_are_recovered(harbour):
    p = np.array([0.05, 1500.0, 6000.0, 40.0, 0.02, 1.9, 0.05, -1.2, 0.03, 0.02, 1.1])
    data = _synthetic(harbour, p)
    found = Physics(iterations=40, tolerance=1e-10).fit(data)
    batch = data.batch()
    assert np.abs(found.predict(batch.s0, batch.U)[..., :2] - batch.truth[..., :2]).max() < 0.05
    np.testing.assert_allclose(found.p[[5, 7, 10]], p[[5, 7, 10]], rtol=0.02)


def test_the_fit_obeys_bounds_and_constraints(fitted):
    p, a = fitted.p, np.deg2rad(20.0)
    assert (p[1:4] >= 0).all()
    for s in (1, -1):
        assert p[5] + 2 * s * a * p[6] + 3 * a * a * p[7] >= -1e-6
    assert p[9] ** 2 <= 4 * p[8] * p[10] + 1e-8
    assert abs(p[4]) <= np.deg2rad(3.0) * p[5] + 1e-8


def test_the_fit_is_much_better_than_its_start(harbour, fitted):
    start = Physics(iterations=0).fit(harbour)
    assert fitted.cost < 0.7 * start.cost


def test_the_gradient_used_by_the_fit_is_the_finite_difference(harbour):
    from shipbench.predictors.physics_model import fit as fit

    model = Physics(iterations=0).fit(harbour)
    batch = harbour.subset([0, 1]).batch()
    path = model.actuator_path(batch.s0, batch.U)
    data = fit.Data(model.c, batch, path, None, 1.0, 1)
    w = data.inputs(path)
    full, plain = (fit.rollout_function(model.c, 1.0, False, sensitivities) for sensitivities in (True, False))
    p = np.array([0.05, 1500.0, 6000.0, 40.0, 0.02, 1.9, 0.05, -1.2, 0.03, 0.02, 1.1])
    S = data.linearised(full, batch.s0, w, p)[1]
    for i in range(11):
        h = 1e-5 * fit.parameter_scale(model.c)[i]
        up, down = p.copy(), p.copy()
        up[i] += h
        down[i] -= h
        slope = (data.motion(plain, batch.s0, w, up) - data.motion(plain, batch.s0, w, down)) / (2 * h)
        np.testing.assert_allclose(S[..., i], slope, atol=1e-4 * np.abs(slope).max())


def test_rollout_of_the_fit_and_of_predict_are_the_same_model(harbour, fitted):
    from shipbench.predictors.physics_model import fit as fit

    batch = harbour.subset([0, 1, 2]).batch()
    path = fitted.actuator_path(batch.s0, batch.U)
    plain = fit.rollout_function(fitted.c, 1.0, False, False)
    X = plain(batch.s0[:, :6], path.reshape(3, -1, 12), fitted.p)
    np.testing.assert_allclose(X, fitted.predict(batch.s0, batch.U)[..., :6], rtol=1e-9, atol=1e-9)


def test_intervals_cover_and_widen_with_fewer_runs(harbour):
    few, many = Physics().fit(harbour.subset(range(4))), Physics().fit(harbour)
    for model in (few, many):
        free = ~np.isnan(model.ci95[:, 0])
        assert free.any()
        assert (model.ci95[free, 0] <= model.p[free]).all()
        assert (model.ci95[free, 1] >= model.p[free]).all()


def test_it_prints_its_equations_with_units_and_intervals(fitted):
    text = fitted.describe()
    for word in ("surge", "sway", "yaw", "p10", "N s^2/m^2", "shaft time constant", "["):
        assert word in text
    assert "Izz not given" in text


def test_it_fits_a_small_model_ship_whose_actuators_are_commands(harbour):
    """Any ship.toml: 1/40 scale by Froude, commands recorded in place of actuator positions."""
    s = 1 / 40
    k = np.sqrt(s)
    ship = harbour.ship.model_copy(
        update={
            "L": 130 * s,
            "B": 18.2 * s,
            "T": 6.1 * s,
            "displacement": 9402 * s**3,
            "xG": -1.92 * s,
            "propeller": None,
            "wind": None,
            "rudder": None,
            "thrusters": None,
        }
    )
    unit = np.array([s, s, 1, k, k, 1 / k, 1 / k, 1, s**3, s**3])
    runs = []
    for r in harbour.runs:
        S, U = r.states * unit, r.inputs * unit[6:]
        S[1:, 6:] = U[:-1]
        runs.append(Run(r.id, r.t * k, S, U))
    data = Dataset("tank", ship, k, tuple(runs), actuators="commanded")
    model = Physics().fit(data)
    batch = data.batch()
    S = model.predict(batch.s0, batch.U)
    assert np.isfinite(S).all()
    np.testing.assert_allclose(S[..., 6:], batch.U)
    hold = np.linalg.norm(batch.truth[:, -1, :2] - batch.s0[:, :2], axis=1).mean()
    assert np.linalg.norm(S[:, -1, :2] - batch.truth[:, -1, :2], axis=1).mean() < 0.1 * hold


def test_measured_wind_reaches_the_forces(harbour, fitted):
    batch = harbour.subset([0]).batch()
    windy = replace(harbour, runs=tuple(
        Run(r.id, r.t, r.states, np.concatenate([r.inputs, np.tile([12.0, 0.3], (len(r), 1))], axis=1),
            (*r.inputs_names, "wind_speed", "wind_from"))
        for r in harbour.runs
    ))  # fmt: skip
    model = Physics(iterations=0).fit(windy)
    model.p = fitted.p
    b = windy.subset([0]).batch()
    assert np.abs(model.predict(b.s0, b.U)[0, -1, :2] - fitted.predict(batch.s0, batch.U)[0, -1, :2]).max() > 0.5


def test_left_side_is_clarke_and_inoue_by_hand():
    from shipbench.physics.mmg import load_mmg_ship

    c = eq2.coefficients(complete(load_mmg_ship("container130").particulars))
    L, B, T, Cb = 130.0, 18.2, 6.1, 0.651
    Y_v = -(np.pi * T / L + 1.4 * Cb * B / L) * 0.5 * 1025 * L * T
    assert c.Y_v == pytest.approx(Y_v)
    assert c.Y_v / (0.5 * 1025 * L * T) == pytest.approx(-0.275, abs=0.001)  # Inoue et al. (1981), by hand
    assert c.N_v / (0.5 * 1025 * L**2 * T) == pytest.approx(-0.094, abs=0.001)
    assert c.N_r / (0.5 * 1025 * L**3 * T) == pytest.approx(-0.042, abs=0.001)
    m_y = np.pi * (T / L) ** 2 * (1 + 0.16 * Cb * B / T - 5.1 * (B / L) ** 2) * 0.5 * 1025 * L**3
    assert c.m11 == pytest.approx(9402.0 * 1025 + m_y)
    assert c.Y_vv / (0.5 * 1025 * L * T) == pytest.approx(-0.688, abs=0.001)
    assert c.N_vvr / (0.5 * 1025 * L**3 * T) == pytest.approx(-0.230, abs=0.001)


@pytest.mark.parametrize(("commanded", "wind", "substeps"), [(False, False, 1), (False, True, 3), (True, True, 1)])
def test_rolling_is_the_same_model_as_the_formula_step_by_step(harbour, fitted, commanded, wind, substeps):
    from shipbench.estimation.eq2_rollout import Rolling, parameter_scale
    from shipbench.estimation.extension import roll

    model = Physics()
    model._set_ship(harbour.ship, (*COMMANDS, "depth", "wind_from", "wind_speed") if wind else COMMANDS, 1.0, commanded)
    model.actuator_params, model.p, model.substeps = fitted.actuator_params, fitted.p, substeps
    batch = harbour.subset([0, 1, 2]).batch()
    U = batch.U
    if wind:
        rng = np.random.default_rng(0)
        U = np.concatenate(
            [U, 20.0 + 0.0 * U[..., :1], rng.uniform(0, 6, (*U.shape[:2], 1)), rng.uniform(0, 15, (*U.shape[:2], 1))],
            axis=2,
        )
    path, measured = model.actuator_path(batch.s0, U), model._wind(U)
    expected = roll([], batch.s0, path, measured, 1.0 / substeps, substeps, model.c, list(model.p), model.particulars)
    S = model.predict(batch.s0, U)
    np.testing.assert_allclose(S[..., :6], expected, rtol=1e-9, atol=1e-9)
    rolling = Rolling(
        model.c,
        None if commanded else model.actuator_params,
        (0, 1, 2, 3, 6, 5) if wind else (0, 1, 2, 3),
        1.0,
        substeps,
    )
    again, slopes = rolling.linearised(batch.s0, U, model.p)
    np.testing.assert_allclose(again, S, rtol=1e-9, atol=1e-9)
    step = 1e-4 * parameter_scale(model.c)
    for i in range(len(model.p)):
        up, down = (
            rolling.states(batch.s0, U, model.p + sign * step * (np.arange(len(model.p)) == i)) for sign in (1, -1)
        )
        slope = (up - down)[..., :6] / (2.0 * step[i])
        np.testing.assert_allclose(slopes[..., i], slope, atol=1e-4 * np.abs(slope).max() + 1e-9)


def test_the_particulars_alone_make_an_ordinary_ship_and_no_run_changes_it(harbour):
    batch = harbour.batch()
    model = Physics().of_particulars(harbour)
    S = model.predict(batch.s0, batch.U)
    np.testing.assert_array_equal(Physics().of_particulars(harbour[:1]).predict(batch.s0, batch.U), S)
    hold = Hold.at(harbour.dt).predict(batch.s0, batch.U)
    error, floor = (np.hypot(*(P - batch.truth)[..., :2].T).mean() for P in (S, hold))
    assert error < 0.8 * floor
    assert model.p[[0, 3, 4, 6, 9]].tolist() == [0.0] * 5
