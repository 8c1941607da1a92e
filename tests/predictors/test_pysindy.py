"""Sparse equations of motion: a known system is found, a run that diverges ends in NaN."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from toy_ship import TOY_SHIP

from shipbench.contract.small import small_harbour
from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor, parse_spec
from shipbench.records import Dataset, Run
from shipbench.signals import COMMANDS, move_frame


def known_ship(runs: int = 6, steps: int = 250, dt: float = 0.2) -> Dataset:
    """du/dt = 0.002 n - 0.02 u^2, dv/dt = -0.2 v - 0.4 u r, dr/dt = -0.1 r + 0.01 u delta; the actuators swing and are
    at their commands."""
    rng, t, made = np.random.default_rng(0), dt * np.arange(steps + 1), []
    for i in range(runs):
        (a, b), (f, g) = rng.uniform(0, 6, 2), rng.uniform(0.1, 0.4, 2)
        n, delta = (lambda t, a=a, f=f: 60 + 50 * np.sin(a + f * t)), (lambda t, b=b, g=g: 0.5 * np.sin(b + g * t))

        def rates(t, s, n=n, delta=delta):
            _, _, psi, u, v, r = s
            turned = [u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), r]
            return [*turned, 0.002 * n(t) - 0.02 * u * u, -0.2 * v - 0.4 * u * r, -0.1 * r + 0.01 * u * delta(t)]

        S, U = np.zeros((steps + 1, 10)), np.zeros((steps + 1, 4))
        S[:, :6] = solve_ivp(
            rates, (0, t[-1]), [0, 0, 0, rng.uniform(0.5, 4.0), 0, 0], t_eval=t, rtol=1e-9, atol=1e-12
        ).y.T
        S[:, 6], S[:, 7] = n(t), delta(t)
        U[:-1, :2], U[-1, :2] = S[1:, 6:8], S[-1, 6:8]
        made.append(Run(f"r{i}", t, S, U))
    return Dataset("known", TOY_SHIP, dt, tuple(made))


@pytest.fixture(scope="module")
def known():
    return known_ship()


@pytest.fixture(scope="module")
def model(known):
    return make_predictor(parse_spec("pysindy")).fit(known.subset(range(5)))


def test_the_equations_of_a_known_system_are_found(model):
    """All terms and no others, and their sizes within 5 %: ridge and finite differences leave that much."""
    found = model._found
    scale = np.concatenate([found["scale_x"], found["scale_w"][found["moving"]]])  # u, v, r, n, delta
    terms = {}
    for row, size, name in zip(found["coefficients"], found["scale_rate"], "uvr", strict=True):
        for c, powers in zip(row, found["powers"], strict=True):
            if c:
                terms[name, tuple(int(p) for p in powers)] = c * size / np.prod(scale**powers)
    expected = {
        ("u", (2, 0, 0, 0, 0)): -0.02, ("u", (0, 0, 0, 1, 0)): 0.002, ("v", (0, 1, 0, 0, 0)): -0.2,
        ("v", (1, 0, 1, 0, 0)): -0.4,
        ("r", (0, 0, 1, 0, 0)): -0.1, ("r", (1, 0, 0, 0, 1)): 0.01,
    }  # fmt: skip
    assert terms.keys() == expected.keys()
    for key, value in expected.items():
        assert terms[key] == pytest.approx(value, rel=0.05)


def test_it_predicts_a_run_that_it_has_not_seen(model, known):
    batch = known.subset([5]).batch()
    error = np.abs(model.predict(batch.s0, batch.U) - batch.truth)[0]
    travelled = np.hypot(*(batch.truth[0, -1, :2] - batch.s0[0, :2]))
    assert error[-1, :2].max() < 0.02 * travelled


def test_its_equations_are_printed(model):
    lines = model.describe().split("\n")
    assert lines[2].startswith("dr/dt = ")
    assert "u delta" in lines[2]
    assert lines[3].startswith("divided by: u ")


def test_a_run_that_diverges_is_nan_from_there_on_and_the_others_are_not(model, known):
    batch = known.batch()
    s0 = batch.s0.copy()
    s0[2, 3] = -12.0  # astern, its quadratic drag drives it on
    S = model.predict(s0, batch.U)
    assert np.isnan(S[2, -1, :6]).all()
    assert (np.nanmax(np.abs(S[2, :, 3:6]), axis=0) <= 10.0 * model._found["largest"]).all(), (
        "beyond ten times the data nothing is predicted"
    )
    assert np.isfinite(np.delete(S, 2, axis=0)).all()


def test_measured_wind_is_seen_from_the_ship():
    """Turning the earth with its wind turns the prediction, and the wind is among the variables."""
    data = small_harbour(inputs=(*COMMANDS, "wind_speed", "wind_from"))
    model = make_predictor(parse_spec("pysindy[degree=1]")).fit(data)
    assert model._found["moving"][4:].all()
    batch, turned = data.batch(), data.batch().U.copy()
    turned[..., 5] += 1.2
    moved = model.predict(move_frame(batch.s0, np.zeros(2), 1.2), turned)
    np.testing.assert_allclose(
        moved, move_frame(model.predict(batch.s0, batch.U), np.zeros(2), 1.2), rtol=1e-6, atol=1e-6
    )


def test_smoothed_derivatives_bear_noise_better(known):
    rng = np.random.default_rng(1)
    noise = np.array([0, 0, 0, 0.02, 0.005, 0.0005, 0, 0, 0, 0])
    noisy = known.with_runs(
        Run(r.id, r.t, r.states + noise * rng.standard_normal(r.states.shape), r.inputs) for r in known.runs[:5]
    )
    batch = known.subset([5]).batch()
    errors = []
    for spec in ("pysindy", "pysindy[derivative=smoothed]"):
        S = make_predictor(parse_spec(spec)).fit(noisy).predict(batch.s0, batch.U)
        errors.append(np.nan_to_num(np.hypot(*(S - batch.truth)[0, :, :2].T), nan=1e9).mean())
    assert errors[1] < errors[0]


@pytest.mark.parametrize("setting", ["degree=0", "threshold=-1", "alpha=-1", "derivative=exact"])
def test_a_wrong_setting_is_named(setting):
    with pytest.raises(InputError, match=rf"{setting.split('=')[0]} = .*accepted"):
        make_predictor(parse_spec(f"pysindy[{setting}]"))
