"""A size is sure if the runs agree on it, whatever the model's own error says."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from made_fits import RUNS, fit_of, fit_to, fit_to_pieces, made_fit, made_plant

from shipbench.diagnosis.actuators.kinds import ORDINARY
from shipbench.diagnosis.selection import agreement as robust
from shipbench.diagnosis.selection import requirements
from shipbench.diagnosis.selection.agreement import (
    bends,
    covariance,
    imitates,
    inflation,
    is_borne_by_one,
    is_on_a_ship,
    least_size,
    matters,
)
from shipbench.diagnosis.selection.requirements import SURE, Standard, first_unmet
from shipbench.effects.base import EFFECTS
from shipbench.estimation.coefficients import NUM_BASE, PLACES
from shipbench.estimation.forward import ordinary_gears
from shipbench.estimation.laplace import Fit
from shipbench.estimation.term import Term
from shipbench.signals import DELTA


def is_sure(fit: Fit, index: int) -> bool:
    """Whether a cause meets all requirements on a cause by itself."""
    return first_unmet(SURE, fit, index, Standard(fit, 10.0)).met


def test_runs_that_scatter_as_the_model_says_are_not_inflated():
    estimates = np.random.default_rng(3).standard_normal(2000) / 3.0
    assert inflation(fit_of(estimates), np.array([NUM_BASE]))[0] == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose(covariance(fit_of(0.1 * estimates), 0), 1.0 / 18001.0)


@pytest.mark.parametrize(("scatter", "sure"), [(0.3, True), (3.0, False)])
def test_the_same_mean_is_sure_only_if_the_runs_agree(scatter: float, sure: bool):
    fit = fit_of(0.5 + scatter * np.resize([1.0, -1.0], RUNS))
    own_error = fit.solution.cov[NUM_BASE, NUM_BASE] ** 0.5
    assert fit.values[0][0] / own_error > 40.0**0.5  # sure beyond doubt
    assert is_sure(fit, 0) is sure


@pytest.mark.parametrize(("scatter", "sure"), [(0.2, True), (0.5, False)])
def test_a_beginning_needs_runs_that_agree_much_better(scatter: float, sure: bool):
    estimates = 0.5 + scatter * np.resize([1.0, -1.0], RUNS)
    assert is_sure(fit_of(estimates), 0)
    assert is_sure(fit_of(estimates, since=4), 0) is sure


@pytest.mark.parametrize(
    ("informed", "sure"), [(9.0, False), (0.0, True)], ids=["the others say no", "the others cannot say"]
)
def test_what_one_run_alone_bears_is_sure_only_if_the_others_do_not_speak_against_it(informed: float, sure: bool):
    """A cause that is strong in the first run, as a bank near which it went; what its run says alone agrees with
    itself."""
    S, weights = np.zeros((RUNS, 2, 2)), np.append(400.0, np.full(RUNS - 1, informed))
    S[:, 0, 0], S[0, 0, 1], S[0, 1, 0] = weights, 400.0, 400.0
    fit = fit_to((Term(EFFECTS.get("rudder_offset")),), S)
    assert is_borne_by_one(fit, 0) is not sure
    assert fit.worth(0) > 100.0


def test_what_runs_have_of_their_own_is_no_disagreement_on_what_they_share():
    """A rudder offset beside a current of each run: the currents act on the motion much as the offset does."""
    rng = np.random.default_rng(8)
    Z = rng.standard_normal((RUNS, 200, 3))
    Z[..., 1] += 0.5 * Z[..., 0]  # shared, own, e
    Z[..., 2] += 0.5 * Z[..., 0] + 5.0 * rng.standard_normal((RUNS, 1)) * Z[..., 1]
    terms = (Term(EFFECTS.get("rudder_offset")), Term(EFFECTS.get("thrust_gain"), per_run=True))
    fit = fit_to(terms, np.swapaxes(Z, 1, 2) @ Z, log_tau2=(0.0, np.log(25.0)))
    assert fit.values[0] == pytest.approx(0.5, abs=0.05)
    assert inflation(fit, np.array([NUM_BASE]))[0] < 3.0
    assert is_sure(fit, 0)


@pytest.mark.parametrize(("forward", "own", "sure"), [(0.08, True, False), (0.3, True, True), (0.08, False, True)])
def test_how_far_ahead_velocities_are_is_as_sure_as_where_the_forces_of_a_hull_act(
    forward: float, own: bool, sure: bool
):
    """An antenna 4 m astern with velocities of its own was named on a patrol vessel of 52 m that had none; positions
    alone tell it by the track."""
    fit = fit_of(np.full(RUNS, forward * 130.0 / 12.0), effect="antenna_offset", setting=(float(own),))
    assert is_sure(fit, 0) is sure


OWN = Term(EFFECTS.get("thrust_gain"), per_run=True)
"""A cause with one value for each run."""


@pytest.mark.parametrize(("pieces", "steady", "sure"), [(4, True, True), (4, False, False), (1, True, True)])
def test_a_value_for_each_run_is_sure_only_if_it_lasts_for_the_run(pieces: int, steady: bool, sure: bool):
    """What differs from piece to piece of a run is no wind, however large; runs of one piece cannot tell."""
    rng = np.random.default_rng(9)
    run = np.repeat(np.arange(RUNS), pieces)
    value = rng.standard_normal((RUNS if steady else len(run), 1))
    Z = rng.standard_normal((len(run), 50, 11))  # eta, w of one knot for each axis, own, e
    Z[..., -1] += 2.0 * (value[run] if steady else value) * Z[..., -2]
    assert is_sure(fit_to_pieces((OWN,), Z, run, [np.log(4.0)]), 0) is sure


@pytest.mark.parametrize("steady", [True, False])
def test_a_wind_with_gusts_is_sure_beside_a_current_that_lasts(steady: bool):
    """They take over from each other: alone, its gusts would speak against the wind."""
    rng = np.random.default_rng(10)
    run = np.repeat(np.arange(RUNS), 4)
    Z = rng.standard_normal((len(run), 50, 12))  # eta, w of one knot for each axis, wind, current, e
    wind = 0.2 * rng.standard_normal((RUNS, 1))[run] + 0.3 * rng.standard_normal((len(run), 1))
    current = 2.0 * (rng.standard_normal((RUNS, 1))[run] if steady else rng.standard_normal((len(run), 1)))
    Z[..., -1] += wind * Z[..., 9] + current * Z[..., 10]
    assert not is_sure(fit_to_pieces((OWN,), np.delete(Z, 10, axis=2), run, [np.log(0.1)]), 0)
    assert is_sure(fit_to_pieces((OWN, OWN), Z, run, np.log([0.1, 4.0])), 0) is steady


@pytest.mark.parametrize(("own", "sure"), [(0.3, True), (3.0, False)])
def test_a_value_for_each_run_is_sure_only_if_little_else_differs_between_runs(own: float, sure: bool):
    """A force in the axes of the ship that is another in each run is no current."""
    rng = np.random.default_rng(12)
    run = np.repeat(np.arange(RUNS), 4)
    Z = rng.standard_normal((len(run), 50, 11))  # eta, w of one knot for each axis, own, e
    Z[..., -1] += rng.standard_normal((RUNS, 1))[run] * Z[..., -2]
    Z[..., -1] += np.einsum("bkj,bj->bk", Z[..., 6:9], own * rng.standard_normal((RUNS, 3))[run])
    assert is_sure(fit_to_pieces((OWN,), Z, run, [0.0]), 0) is sure


@pytest.mark.parametrize("per_run", [False, True])
@pytest.mark.parametrize("effect", ["current", "rudder_delay", "thruster_lag"])
def test_a_size_matters_from_its_least_on(effect: str, per_run: bool):
    term = Term(EFFECTS.get(effect), per_run=per_run)
    direction = np.array([0.6, -0.8] if term.size == 2 else [1.0])
    for factor, wanted in ((0.9, False), (1.1, True)):
        size = factor * direction * _least(effect)
        values = np.outer([1.0, -1.0, 1.0], size) if per_run else size
        assert matters(made_fit((term,), (values,), made_plant(3, dt=0.5)), 0) is wanted


def _least(effect: str) -> float:
    return least_size(made_fit(plant=made_plant(dt=0.5)), Term(EFFECTS.get(effect)))


def _sized(
    effect: str,
    values: np.ndarray,
    dt: float = 1.0,
    L: float = 130.0,
    setting: tuple[float, ...] = (),
    beside: Iterable[Term] = (),
) -> Fit:
    """A fit with a cause of `values` typical sizes, and others `beside` it."""
    terms = (Term(EFFECTS.get(effect), setting), *beside)
    return made_fit(terms, (values, *(np.zeros(t.size) for t in terms[1:])), made_plant(L=L, dt=dt))


@pytest.mark.parametrize(("dt", "wanted"), [(1.0, True), (2.5, False)])
def test_a_time_of_less_than_half_a_sample_does_not_matter(dt: float, wanted: bool):
    assert matters(_sized("rudder_delay", np.array([0.7]), dt), 0) is wanted  # 1.05 s
    assert matters(_sized("rudder_stall", np.array([0.7]), dt), 0)


@pytest.mark.parametrize(("delay", "wanted"), [(-2.9, False), (0.0, True), (2.9, True)])
def test_a_lag_that_a_record_as_late_takes_back_does_not_matter(delay: float, wanted: bool):
    """A towing tank's record was smoother than the motion: its rudder was 0.39 s late, with a lag of 0.42 s."""
    terms = [Term(EFFECTS.get(name)) for name in ("rudder_lag", "rudder_delay")]
    fit = made_fit(terms, [np.array([1.0]), np.array([delay / 1.5])], made_plant(3, dt=0.5))
    assert matters(fit, 0) is wanted  # 3 s at 130 m


@pytest.mark.parametrize(("lag", "wanted"), [(0.93, False), (4.3, True)])
def test_a_ship_whose_lift_follows_late_has_no_slow_gear(lag: float, wanted: bool):
    """A tanker of 120 m without a cause, whose lift builds up over a third of a length."""
    assert (
        matters(_sized("rudder_lag", np.array([lag]) / EFFECTS.get("rudder_lag").sized(120.0)[0].typical, L=120.0), 0)
        is wanted
    )


PLAYS = [(1.0, 0.2, False, False), (1.0, 0.05, False, True), (1.0, 0.2, True, True), (0.64, 0.05, False, False)]


@pytest.mark.parametrize(("play", "noise", "commanded", "wanted"), PLAYS)
def test_play_that_takes_the_noise_out_of_a_record_or_the_lag_out_of_a_ship_is_none(
    play: float, noise: float, commanded: bool, wanted: bool
):
    """0.5 deg of it, with noise of 0.1 deg on a boat of 12 m that had none (beside orders there is no noise to take
    out); 0.64 deg on a trainer of 50 m that answers her rudder late."""
    states = np.zeros((8, 61, 10))
    states[..., DELTA] = np.deg2rad(noise * np.random.default_rng(2).standard_normal(states.shape[:2]))
    plant = made_plant(8, dt=0.5, states=states, commanded=commanded)
    assert matters(made_fit((Term(EFFECTS.get("rudder_backlash")),), (np.array([play / 2.0]),), plant), 0) is wanted


@pytest.mark.parametrize(
    ("others", "wanted"), [(("position_delay",), False), (("rudder_delay", "current"), True), ((), True)]
)
def test_of_two_sensors_that_are_late_each_must_be_so_by_more(others: tuple[str, ...], wanted: bool):
    """Velocities early by 0.14 s stood beside positions 0.3 s late on a model whose positions alone were late, by 0.5
    s."""
    beside = [Term(EFFECTS.get(name)) for name in others]
    assert matters(_sized("velocity_delay", np.array([-0.4]), setting=(0.0,), beside=beside), 0) is wanted


@pytest.mark.parametrize(
    ("effect", "strange", "wanted"),
    [
        ("rudder_delay", ("with",), True),
        ("rudder_delay", ("with", "null"), False),
        ("rudder_delay", (), False),
        ("current", ("with",), False),
    ],
)
def test_what_asks_for_a_stranger_ship_than_nothing_does_is_no_cause(
    monkeypatch, effect: str, strange: tuple[str, ...], wanted: bool
):
    """Else the ship file was doubted for it; a current shows whatever the ship is."""
    term = Term(EFFECTS.get(effect))
    fit = made_fit((term,), (np.ones(term.size),))
    monkeypatch.setattr(robust, "needed", lambda found: "with" if found is fit else "null")
    monkeypatch.setattr(robust, "is_strange", lambda z: z in strange)
    assert bends(fit, 0, made_fit()) is wanted


@pytest.mark.parametrize(("shift", "wanted"), [(-1.4, True), (1.4, True), (4.1, False)])
def test_a_thruster_acts_on_board(shift: float, wanted: bool):
    """On a ship of 56 m a lever of 57 m was named for what the hull's form lacked."""
    assert is_on_a_ship(_sized("thruster_lever", np.array([shift]), L=56.0), 0) is wanted


@pytest.mark.parametrize(("shift", "wanted"), [(1.8, True), (-1.8, True), (2.1, False), (-2.6, False)])
def test_a_ship_floats_with_her_centre_of_gravity_where_it_is(shift: float, wanted: bool):
    """On a ferry of 132 m a shift of 10.5 m was named for what her form lacked in water of two to four draughts."""
    assert is_on_a_ship(_sized("center_of_gravity_shift", np.array([shift]), L=132.0), 0) is wanted


@pytest.mark.parametrize(
    ("forward", "starboard", "wanted"),
    [(-30.0, -9.0, True), (0.0, 9.0, True), (-4.4, -14.7, False), (70.0, 0.0, False)],
)
def test_an_antenna_stands_on_the_ship(forward: float, starboard: float, wanted: bool):
    """14.7 m to port were named on a barge 85 m long and 9.5 m wide, whose log read nothing below 1.1 m/s."""
    at = np.array([forward, starboard]) / [p.typical for p in EFFECTS.get("antenna_offset").sized(85.0) if not p.shape]
    assert is_on_a_ship(_sized("antenna_offset", at, L=85.0), 0) is wanted


@pytest.mark.parametrize(("towards", "bank", "wanted"),
    [(4.7, (1.57, 4.3, 0.0), True), (1.6, (1.57, 4.3, 0.0), True), (2.0, (1.57, 4.3, 0.0), False),
                                                         (4.7, None, False)])  # fmt: skip
def test_a_wind_straight_at_a_bank_mends_its_law(towards: float, bank: tuple[float, ...] | None, wanted: bool):
    """A wind of 5.3 m/s from 270 deg and a current to 270 deg were named beside a bank at 90 deg that all runs of a
    barge followed."""
    beside = () if bank is None else (Term(EFFECTS.get("bank_suction"), bank),)
    assert imitates(_sized("wind", np.array([np.cos(towards), np.sin(towards)]), beside=beside), 0) is wanted


@pytest.mark.parametrize(("share", "wanted"), [(0.0027, False), (0.01, True)])
def test_a_drift_of_a_few_thousandths_of_the_wind_is_none(share: float, wanted: bool):
    """0.27 % was named on a cruise ship, in a wind that moved no water."""
    assert matters(_sized("wind_drift", np.array([share / 0.01])), 0) is wanted


def test_thrusters_known_by_their_orders_may_be_as_slow_as_ordinary_ones():
    """A lag of 2 s and a limit of a quarter of the force per second were named 1.2 to 1.3 s too slow on two ships with
    nothing hidden."""
    lag = ORDINARY["F"].T - ordinary_gears(130.0)["F"].T
    assert _least("thruster_lag") * EFFECTS.get("thruster_lag").parameters[0].typical > lag > 1.0


def test_lift_that_grows_more_slowly_than_the_sine_is_no_stall():
    """A rudder with a flap, of aspect ratio 0.65, whose lift goes as tanh up to 1.35, at 35 deg: named 0.19 with
    nothing hidden."""
    sine = 1.5 * 6.13 * 0.65 / (0.65 + 2.25) * np.sin(np.deg2rad(35.0)) / 1.35
    lost = 1.0 - np.tanh(sine) / sine
    assert _least("rudder_stall") * EFFECTS.get("rudder_stall").parameters[0].typical > lost > 0.15


@pytest.mark.parametrize(("begins", "lost", "wanted"), [(0.35, 0.31, False), (0.35, 0.4, True), (0.2, 0.31, True)])
def test_a_wing_that_stalls_smoothly_about_35_deg_is_an_ordinary_rudder(begins: float, lost: float, wanted: bool):
    """With nothing hidden a coaster and a ferry had lost 0.31 and 0.28 from 20 deg on."""
    assert matters(_sized("rudder_stall", np.array([lost / 0.5]), setting=(begins,)), 0) is wanted


def test_more_is_asked_of_what_the_form_of_a_hull_could_be():
    """Where each run is another manoeuvre, what a polynomial lacks differs from run to run and passes for winds of
    single runs."""
    standard = Standard(fit_of(np.zeros(RUNS)), 10.0, off_form=3.0)
    current, mass, bank = (EFFECTS.get(name) for name in ("current", "mass_change", "bank_suction"))
    plain, late, mistaken, near = (
        standard.asked_besides(t) for t in (Term(current), Term(current, since=3), Term(mass), Term(bank))
    )
    assert (plain, late, near) == (0.0, 3.0, 3.0)
    assert 3.0 < mistaken < standard.asked_besides(Term(EFFECTS.get("wind_per_run"), per_run=True))


@pytest.mark.parametrize(
    ("effect", "lever", "sure"),
    [("wind_per_run", 2.0, True), ("wind_per_run", -9.3, False), ("current_per_run", -9.3, True)],
)
def test_a_wind_that_needs_a_superstructure_of_no_ship_is_none(monkeypatch, effect: str, lever: float, sure: bool):
    """Two ships of a third simulator without wind: what their model lacked passed for winds, with the centre of the
    area 0.35 lengths off."""
    z = np.zeros(NUM_BASE)
    z[PLACES["wind_lever"]] = lever
    monkeypatch.setattr(robust, "needed", lambda fit: z)
    monkeypatch.setattr(requirements, "lasts", lambda fit: True)
    monkeypatch.setattr(requirements, "tells_runs_apart", lambda fit: True)
    assert is_sure(made_fit((Term(EFFECTS.get(effect), per_run=True),)), 0) is sure
