"""Parameters far from what is ordinary: wide enough a spread for them, none for the others, and no cause named in their
place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_fits import made_ship

from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.selection.screening import screen
from shipbench.diagnosis.selection.stepwise import candidates_for
from shipbench.effects.base import EFFECTS
from shipbench.estimation import robust_prior as ordinary
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.between_ships import STRUCTURE
from shipbench.estimation.coefficients import CENTRE, FREE, NUM_BASE, PLACES, SPREAD
from shipbench.estimation.eq2_rollout import parameter_scale
from shipbench.estimation.forward import Plant
from shipbench.estimation.laplace import Fit, settle
from shipbench.estimation.linearisation import Linearisation, Scales
from shipbench.estimation.robust_prior import NOTICEABLE, STRANGE, STRANGE_SUM, needed, widened, widths_of
from shipbench.ops import Array
from shipbench.physics.eq2 import accelerations, coefficients
from shipbench.physics.mmg import load_mmg_ship
from shipbench.physics.modifiers import Flow, Modifiers
from shipbench.ship import Particulars, Propeller, complete
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.unmodelled import Outside

RACE = PLACES["race"]


@pytest.fixture(scope="module")
def mariner():
    """Her rudder's force falls with the speed twice over: the race of eq. (2) would have to work against it."""
    plant = Plant.of(published_trials(PUBLISHED["mariner"], 41, plan=Trials(runs=12, samples=100)))
    return null_fit(plant, Scales(plant), candidates_for(plant, ("race_gain",)))


def test_only_what_lies_far_off_gets_a_wider_spread(mariner):
    widths = np.array(mariner.model.widths)
    assert widths.shape == (NUM_BASE,)
    assert widths[RACE] > 1.1
    assert np.sum(widths > 1.0) <= 3
    far = np.abs(mariner.solution.mean[:NUM_BASE]) > 3.5
    np.testing.assert_array_equal(widths > 1.0, far)


def test_with_it_less_is_left_for_a_cause_of_the_same_kind(mariner):
    lin = Linearisation(mariner.plant, mariner.scales, mariner.point, mariner.motion)
    narrow = settle(lin, replace(mariner.model, widths=()), mariner.hyper, {}, mariner.candidates, leap=0.0)
    assert screen(mariner)[0].score < screen(narrow)[0].score


@pytest.mark.parametrize("gain", [-1.0, 1.0])
def test_a_wider_spread_is_taken_only_where_its_fit_is_no_worse(mariner, monkeypatch, gain: float):
    """Winds of single runs of 10 m/s: the fit with wider spreads ended 68 of log evidence below the one before, with
    winds of 1.5 m/s."""
    narrow = replace(mariner, model=replace(mariner.model, widths=()))
    other = replace(mariner, excess=mariner.excess + 2.0 * (mariner.evidence - narrow.evidence - gain))
    monkeypatch.setattr(ordinary, "widths_of", lambda found: np.asarray(mariner.model.widths))
    monkeypatch.setattr(ordinary, "fit", lambda *_, **__: other)
    assert widened(narrow) is (other if gain > 0.0 else narrow)


def test_behind_a_propeller_that_drives_the_flow_is_that_of_one_that_drives():
    """With exact sensors a leak of what holds for one that stands was enough to doubt the navy ship's file (21
    spreads)."""
    ship, zero = complete(load_mmg_ship("kcs").particulars), np.zeros(3)
    u, names = 5.0, [p.name for p in STRUCTURE.parameters]
    V_A = u * (1.0 - ship.w_P0)
    n = np.array([60.0 * V_A / (0.9 * ship.D_P), 60.0 * V_A / (1.5 * ship.D_P), 0.0])  # J = 0.9, 1.5 and without end
    flow = Flow(zero, zero, zero, zero, u + zero, zero, zero, n, zero, zero, zero)

    def wake(stopped: float) -> np.ndarray:
        e, q = Modifiers(), np.zeros(len(names))
        q[names.index("stopped")] = stopped
        STRUCTURE.force(e, flow, q, ship)
        return np.asarray(e.wake)

    changed = wake(0.2) - wake(0.0)
    assert changed[0] == 0.0
    np.testing.assert_array_less(0.0, np.diff(changed))
    assert changed[2] == pytest.approx(0.2 * (1.0 - ship.w_P0), rel=1e-3)


def test_an_ordinary_ship_keeps_its_spreads():
    plant = Plant.of(sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=8, samples=80)))
    found = null_fit(plant, Scales(plant))
    assert not found.model.widths
    np.testing.assert_array_equal(widths_of(found), 1.0)


@pytest.mark.long
def test_a_ship_of_the_literature_with_an_odd_rudder_is_neither_doubted_nor_explained():
    verdict = diagnose(published_trials(PUBLISHED["mariner"], 42), gain=False)
    assert (verdict.verdict, verdict.causes, verdict.warnings) == ("none", (), ())


def test_the_page_of_the_calibration_has_the_prior_of_the_code():
    """Centre and spread of every parameter, as they stand in the table of docs/calibration.md."""
    page = (Path(__file__).parents[2] / "docs" / "calibration.md").read_text("utf-8")
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines() if line.startswith("| `")]
    rows = {row[0].strip("`"): row[-4:-2] for row in cells if len(row) in (5, 6)}
    prior = {p.name: (c, p.typical) for p, c in zip(STRUCTURE.parameters, STRUCTURE.centres(), strict=True)}
    prior |= {f"p{i}": (c, s) for i, c, s in zip(FREE, CENTRE, SPREAD, strict=True)}
    assert {name: tuple(map(float, rows[name])) for name in prior} == prior


EXACT = Trials(noise=0.0, gusts=0.0)


@pytest.mark.parametrize(("name", "value"), [("windmilling", 0.31), ("thrust_backing", 0.8)])
def test_a_propeller_of_the_b_series_is_that_of_an_ordinary_ship(name, value):
    """B4-70 lay 6 and 4 spreads off, ships of a third simulator up to 6 in both: half of the sum that doubts a ship
    file."""
    p = next(p for p in STRUCTURE.parameters if p.name == name)
    assert value / (p.typical * STRUCTURE.wider(load_mmg_ship("kcs").particulars)[name]) < 2.5


@pytest.mark.parametrize(("Cb", "factor"), [(0.55, 1.0), (0.65, 1.0), (0.81, 3.4), (0.88, 9.4), (0.99, 39.1)])
def test_a_full_hull_makes_waves_at_a_lower_froude_number(Cb: float, factor: float):
    """A barge with a block coefficient of 0.88 needed 9 spreads of it at a Froude number of 0.18, and her file was
    doubted."""
    assert STRUCTURE.wider(made_ship().model_copy(update={"Cb": Cb}))["wave_resistance"] == pytest.approx(
        factor, rel=0.02
    )


@pytest.fixture(scope="module")
def exact_mariner() -> Fit:
    plant = Plant.of(published_trials(PUBLISHED["mariner"], 41, plan=EXACT))
    return null_fit(plant, Scales(plant))


def test_what_ships_differ_by_more_counts_for_less(mariner, monkeypatch):
    less = needed(mariner)
    monkeypatch.setattr(type(STRUCTURE), "wider", lambda self, ship: {})
    before = needed(mariner)
    narrow = PLACES["thrust_backing"]
    assert less[narrow] == pytest.approx(before[narrow] / 2.5)
    np.testing.assert_array_equal(
        np.delete(less, [narrow, PLACES["windmilling"]]), np.delete(before, [narrow, PLACES["windmilling"]])
    )


@pytest.mark.long
def test_what_a_small_force_could_stand_for_is_not_asked_of_the_ship(exact_mariner):
    found = exact_mariner
    moved, less = found.solution.mean[:NUM_BASE], needed(found, NOTICEABLE)
    assert np.sum(less**2) < 0.9 * np.sum(moved**2)
    np.testing.assert_allclose(
        needed(found, 1e-6), moved, atol=0.2
    )  # where the force is as it was, so are the parameters
    assert np.max(np.abs(less)) < STRANGE
    assert np.sum(less**2) < STRANGE_SUM


@pytest.mark.long
@pytest.mark.parametrize(("ship", "runs"), [pytest.param("mariner", 24, marks=pytest.mark.long), ("tanker", 12)])
def test_exact_sensors_in_a_calm_make_no_cause_of_the_form_of_a_hull(ship, runs):
    """Before a least force both were `unknown` and their ship files doubted: a parameter at 12.5 spreads, a mass
    changed by 3.3 typical sizes."""
    verdict = diagnose(published_trials(PUBLISHED[ship], 43, plan=replace(EXACT, runs=runs)), gain=False)
    assert (verdict.verdict, verdict.causes) == ("none", ())
    assert not any("Is the ship file" in w for w in verdict.warnings)


@pytest.mark.long
def test_exact_sensors_in_a_calm_still_show_a_small_cause():
    hidden = Hidden(EFFECTS.get("rudder_offset"), (0.01,))
    verdict = diagnose(published_trials(PUBLISHED["mariner"], 43, (hidden,), replace(EXACT, runs=12)), gain=False)
    assert [c.effect for c in verdict.causes] == ["rudder_offset"]
    assert verdict.causes[0].parameters["offset"].value == pytest.approx(0.01, rel=0.25)


@pytest.mark.long
@pytest.mark.parametrize(("runs", "samples"), [(10, 600), (8, 400)])
def test_standard_manoeuvres_make_no_cause_and_no_doubt_of_the_form_of_a_hull(runs, samples):
    """At the limits of the rudder, S175 with heel: once ten runs gave a `rudder_delay` and a doubt of her file, and
    eight a `mass_change`, for inflow that rises with the square of the angle."""
    verdict = diagnose(
        published_trials(PUBLISHED["s175"], 185, plan=Trials(runs=runs, samples=samples, standard=True)), gain=False
    )
    assert (verdict.verdict, verdict.causes, verdict.warnings) == ("none", (), ())


@pytest.mark.long
def test_resistance_that_grows_with_the_speed_itself_is_no_sign_of_a_wrong_ship_file():
    """As in the linear models of control engineers. With the spread of ships (1 of the units) instead: doubt, and
    `unknown`."""
    tanker = PUBLISHED["tanker"]
    drag = 9.0 * parameter_scale(coefficients(complete(tanker.particulars)))[1]

    def rates(motion, n, delta, thrust, push):
        return tanker.rates(motion, n, delta, thrust, (push[0] - drag * motion[0], *push[1:]))

    found = diagnose(published_trials(replace(tanker, rates=rates), 1, plan=Trials(runs=10, samples=80)), gain=False)
    assert found.verdict == "none"
    assert not found.warnings


def test_a_ship_with_more_drag_forward_is_turned_where_she_is_pushed_sideways():
    """Without it she had another lever of her bow thruster."""
    ship, still, v = complete(load_mmg_ship("kcs").particulars), np.zeros(2), np.array([0.5, -0.5])
    names = [p.name for p in STRUCTURE.parameters]

    def moment(forward: float) -> np.ndarray:
        e, q = Modifiers(), np.zeros(len(names))
        q[names.index("drag_forward")] = forward
        STRUCTURE.force(e, Flow(still, still, still, still, still, v, still, still, still, still, still), q, ship)
        return np.asarray(e.N)

    unit = 0.5 * ship.rho * ship.L**2 * ship.T
    np.testing.assert_allclose(moment(0.3) - moment(0.0), -unit * 0.3 * v * np.abs(v) / 6.0)


@pytest.mark.long
def test_the_waves_of_a_fast_ship_are_no_added_resistance():
    """A fourth power of the Froude number beside the square of the speed was named with a score of 27, the latent force
    16 times as large."""

    def of_waves(e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.push(
            -q[0]
            * 0.5
            * ship.rho
            * ship.L
            * ship.T
            * 0.015
            * (s.u * s.u / (9.81 * ship.L * 0.25**2)) ** 2
            * s.u
            * np.abs(s.u)
        )

    hidden = Hidden(Outside("wave resistance", ("speed",), of_waves), (1.0,))
    found = diagnose(published_trials(PUBLISHED["navy"], 5, (hidden,), Trials(runs=12)), gain=False)
    assert (found.verdict, found.causes, found.warnings) == ("none", (), ())
    assert found.unexplained_after["force_sd"]["surge [m/s^2]"] < 1.5e-3


def test_a_propeller_whose_curve_is_not_given_is_not_named_for_what_it_does_beside_that_curve():
    """More thrust in the estimate and less in `thrust_gain` was a way to twice the drag of a propeller that is turned
    against the flow."""
    ship = complete(load_mmg_ship("kcs").particulars.model_copy(update={"propeller": Propeller(diameter=4.0)}))
    c, p = coefficients(ship), np.zeros(11)
    names = [q.name for q in STRUCTURE.parameters]

    def surge(log_thrust: float, gain: float) -> np.ndarray:
        e, q = Modifiers(), np.zeros(len(names))
        q[names.index("log_thrust")], q[names.index("thrust_backing")], q[names.index("windmilling")] = (
            log_thrust,
            1.0,
            0.3,
        )
        n, still = np.array([-80.0, 0.0, 90.0]), np.zeros(3)
        STRUCTURE.force(e, Flow(still, still, still, still, still + 4.0, still, still, n, still, still, still), q, ship)
        EFFECTS.get("thrust_gain").force(
            e, Flow(still, still, still, still, still + 4.0, still, still, n, still, still, still), (gain,), ship
        )
        return accelerations(still + 4.0, still, still, n, still, still, still, None, c, p, e)[0]

    np.testing.assert_allclose(surge(np.log(1.8), 1.0 / 1.8 - 1.0), surge(0.0, 0.0))


@pytest.mark.long
@pytest.mark.parametrize("diameter", [1.9, *(pytest.param(d, marks=pytest.mark.long) for d in (2.26, 2.6))])
def test_a_fit_finds_its_way_from_regressions_that_are_far_off(diameter: float):
    """A small fast ship whose two screws the file gives as one: of the right size, or with up to three times the
    thrust. Her rudders have no race."""
    navy = PUBLISHED["navy"]
    ship = replace(navy, particulars=navy.particulars.model_copy(update={"propeller": Propeller(diameter=diameter)}))
    plant = Plant.of(published_trials(ship, 1, (), Trials(runs=12, samples=80)))
    found = null_fit(plant, Scales(plant))
    assert found.excess < 1.0
    assert np.exp(0.5 * found.hyper.log_force[2]) < 1.0
