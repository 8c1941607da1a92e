"""How the log determinant of the latent force depends on parameters, and what estimates gain by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.selection.screening import screen
from shipbench.effects.base import EFFECTS
from shipbench.estimation import laplace as settling
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.between_ships import STRUCTURE
from shipbench.estimation.coefficients import FREE, HULL, NUM_BASE
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import Origin, fit, start
from shipbench.estimation.laplace import Fit, Model, settle
from shipbench.estimation.linearisation import Linearisation, Point, Scales
from shipbench.estimation.log_determinant import slopes
from shipbench.estimation.term import Term
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials

BASE = [*(f"p{number}" for number in FREE), *(p.name for p in HULL.parameters), *(p.name for p in STRUCTURE.parameters)]
N_R = BASE.index("N_r")


@pytest.fixture(scope="module")
def fitted(plant) -> Fit:
    scales = Scales(plant)
    coloured = scales.coloured(scales.colour.with_channel(2, 4.0, 6.0))
    origin = Origin.of(plant, coloured)
    return fit(plant, coloured, Model(), origin.point, origin.hyper, guess=origin.motion)


def _log_determinant(fitted: Fit, point: Point) -> float:
    lin = Linearisation(fitted.plant, fitted.scales, point, fitted.motion, coarse=False)
    return float(np.sum(settle(lin, Model(point.terms), fitted.hyper, {}, leap=0.0).reduced.logdet))


def _by_column(fitted: Fit, candidates: list[Term]) -> np.ndarray:
    lin = Linearisation(fitted.plant, fitted.scales, fitted.point, fitted.motion, coarse=False)
    return slopes(lin, lin.columns(candidates), fitted.reduced.inverse, fitted.hyper).sum(axis=0)


def test_slopes_by_parameters_are_those_of_the_log_determinant(fitted):
    found = _by_column(fitted, [])
    numeric = np.zeros(NUM_BASE)
    for i in range(NUM_BASE):
        ends = [replace(fitted.point, base=fitted.point.base + step * np.eye(NUM_BASE)[i]) for step in (0.05, -0.05)]
        numeric[i] = (_log_determinant(fitted, ends[0]) - _log_determinant(fitted, ends[1])) / 0.1
    assert np.abs(numeric).max() > 0.5
    assert np.abs(found - numeric).max() < 0.05 * np.abs(numeric).max()


ANTENNAS = [Term(EFFECTS.get("antenna_offset"), (own,)) for own in (0.0, 1.0)]
CAUSES = [
    *(
        Term(EFFECTS.get(name))
        for name in ("mass_change", "rudder_gain", "added_resistance", "speed_scale", "rudder_delay")
    ),
    *ANTENNAS,
]


@pytest.mark.parametrize("term", CAUSES)
def test_slopes_by_causes_of_every_kind_are_those_of_the_log_determinant(fitted, term):
    found = _by_column(fitted, [term])[NUM_BASE:]
    for a in range(term.size):
        ends = [replace(fitted.point, terms=(term,), values=(step * np.eye(term.size)[a],)) for step in (0.1, -0.1)]
        numeric = (_log_determinant(fitted, ends[0]) - _log_determinant(fitted, ends[1])) / 0.2
        assert found[a] == pytest.approx(numeric, rel=0.1, abs=0.1)


@pytest.mark.parametrize("term", [Term(EFFECTS.get("speed_scale")), *ANTENNAS])
def test_slopes_by_a_sensor_that_errs_already_are_those_of_the_log_determinant(fitted, term):
    """What it does already must not count as the change."""
    at = replace(fitted.point, terms=(term,), values=(np.full(term.size, 0.7),))
    lin = Linearisation(fitted.plant, fitted.scales, at, fitted.motion, coarse=False)
    now = settle(lin, Model((term,)), fitted.hyper, {}, leap=0.0)
    found = slopes(lin, now.columns, now.reduced.inverse, fitted.hyper).sum(axis=0)[NUM_BASE:]
    for a in range(term.size):
        ends = [
            _log_determinant(fitted, replace(at, values=(at.values[0] + step * np.eye(term.size)[a],)))
            for step in (0.1, -0.1)
        ]
        assert found[a] == pytest.approx((ends[0] - ends[1]) / 0.2, rel=0.15, abs=0.5)


@pytest.mark.parametrize(
    "term",
    [Term(EFFECTS.get("position_delay")), *(Term(EFFECTS.get("velocity_delay"), (axes,)) for axes in (0.0, 1.0))],
)
def test_a_late_sensor_tells_as_much_of_the_force(fitted, term):
    """Shifted in time, nothing is lost but where a piece begins, and that is the cutting's doing."""
    assert np.all(_by_column(fitted, [term])[NUM_BASE:] == 0.0)


@pytest.mark.long
def test_where_pieces_begin_is_no_evidence_for_a_late_sensor():
    """A slow ship in short runs says little of a delay; the fewer samples of the force in its pieces had been worth 11
    of 2 log evidence for 3 s."""
    plant = Plant.of(published_trials(PUBLISHED["tanker"], 54, (), Trials(runs=90, samples=40)))
    (score,) = screen(null_fit(plant, Scales(plant), [Term(EFFECTS.get("position_delay"))]))
    assert score.score < 0.0
    assert abs(score.estimate[0]) < 2.5 * score.sd[0]


def test_slopes_by_a_pushed_moment_agree_with_those_by_a_parameter(fitted):
    """A moment that goes with the yaw rate, as the hull's and as a form of the second library."""
    lin = Linearisation(fitted.plant, fitted.scales, fitted.point, fitted.motion, coarse=False)
    columns = lin.columns()
    rates, aside = (states[..., 5] / fitted.scales.eta[5] for states in (lin.middle, lin.aside))
    pushed, bend = lin.pushed(2, rates, aside)
    with_push = replace(columns, candidates=(pushed,), bends=(*columns.bends, bend))
    found = slopes(lin, with_push, fitted.reduced.inverse, fitted.hyper).sum(axis=0)
    damping = np.mean((columns.bends[0].rates[N_R, ..., 2] / lin.away)[lin.turn == 5])
    unit = fitted.scales.w[2] / fitted.scales.eta[5]
    assert found[-1] * damping / unit == pytest.approx(found[N_R], rel=0.25)


def test_estimates_are_nearer_to_the_truth_where_the_log_determinant_counts(monkeypatch):
    """Motions of the fitted model itself under drawn forces, with little noise: squares alone make the ship less damped
    than she is."""
    plant = Plant.of(sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=8, samples=120)))
    rng, scales, (still, hyper) = np.random.default_rng(4), Scales(plant), start(plant)
    true = 0.3 * rng.standard_normal(NUM_BASE)
    lag = np.abs(np.subtract.outer(np.arange(plant.knots), np.arange(plant.knots))) * plant.knot_time / hyper.tau
    w = 0.5 * np.linalg.cholesky(np.exp(-lag)) @ rng.standard_normal((len(still.eta), plant.knots, 3))
    states = plant.seg.states.copy()
    states[..., :6] = Linearisation(plant, scales, replace(still, base=true, w=w)).predicted
    states[..., :6] += 0.1 * scales.noise * rng.standard_normal(states[..., :6].shape)
    drawn = Plant(plant.ship, replace(plant.seg, states=states), plant.long)
    origin = Origin.of(drawn, scales)

    def fitted() -> Fit:
        return fit(drawn, scales, Model(), origin.point, origin.hyper, guess=origin.motion)

    def off(found: Fit) -> float:
        error = found.solution.mean[:NUM_BASE] - true
        return float(error @ np.linalg.solve(found.solution.cov[:NUM_BASE, :NUM_BASE], error))

    counts = fitted()
    monkeypatch.setattr(settling, "slopes", lambda *given: 0.0 * slopes(*given))
    squares = fitted()
    assert counts.evidence > squares.evidence + 0.5
    assert off(counts) < 0.9 * off(squares)


def test_evidence_does_not_favour_a_ship_that_forgets_how_a_run_began():
    """A tanker in many short runs, whose initial states nobody knows: integrated out like the force, they gave her a
    negative added mass."""
    plant = Plant.of(published_trials(PUBLISHED["tanker"], 54, (), Trials(runs=60, samples=40)))
    found = null_fit(plant, Scales(plant))
    inertia = found.point.base[[BASE.index(name) for name in ("m_y", "J_z", "coupling")]]
    assert np.abs(inertia).max() < 3.0
    assert found.excess < 0.5
