"""What data cannot identify, on simulated trials that lack it; and the noise of channels, on noise that is known."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipbench.data.coverage import Samples, gaps
from shipbench.data.harbour90_noisy import NOISE
from shipbench.data.noise import channel_noise, resolution, white_noise
from shipbench.data.sensitivity import COLLINEAR, LEAST_EFFECT, identifiability
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.ship import Ship
from shipbench.signals import COMMANDS
from shipbench.simulate.hidden import sail

RUNS, STEPS = 8, 240


@cache
def trial(kind: str) -> Dataset:
    """Eight runs of 240 s of the container ship: dead straight, small zig-zags on one course, turns at one speed, or
    everything."""
    ship, rng, t = load_mmg_ship("container130"), np.random.default_rng(0), np.arange(STEPS)
    s0, U = np.zeros((RUNS, 10)), np.zeros((RUNS, STEPS, 4))
    s0[:, 3], s0[:, 6], U[..., 0] = 5.0, 100.0, 100.0
    for i in range(RUNS):
        if kind == "zigzag":
            U[i, :, 1] = np.deg2rad(4.0 + i / 8) * np.sign(np.sin(2 * np.pi * t / (60 + 5 * i)))
        if kind in ("turns", "all"):
            U[i, 20:, 1], s0[i, 2] = np.deg2rad([35, -35, 20, -20, 30, -30, 10, -10][i]), i
        if kind == "all":
            s0[i, 3], U[i, :, 0] = 1.0 + 0.6 * i, np.repeat(rng.choice([-120, 40, 70, 100, 130], 6), 40)
    if kind == "all":
        U[2, :, 2], U[3, :, 3] = 5e4, -5e4
        U[4:6, :, 0], U[4:6, :, 1] = -140.0, 0.0
        s0[4:6, 3] = 0.5
    S = sail(ship, s0, U, 1.0, [], None, max_step=0.5)
    U = np.concatenate([U, U[:, -1:]], axis=1)
    runs = tuple(Run(f"r{i}", np.arange(STEPS + 1.0), S[i], U[i], COMMANDS) for i in range(RUNS))
    return Dataset(kind, ship.particulars, 1.0, runs)


def scaled(data: Dataset, factor: float) -> Dataset:
    """The same trial of a geometrically similar ship of `factor` times the length, by Froude's law."""
    root = np.sqrt(factor)
    particulars = data.ship.model_dump(exclude_none=True)
    for key, power in {"L": 1, "B": 1, "T": 1, "xG": 1, "displacement": 3, "mass": 3, "Izz": 5}.items():
        if key in particulars:
            particulars[key] *= factor**power
    for part, keys in {"propeller": {"diameter": 1, "x": 1}, "rudder": {"area": 2, "height": 1, "x": 1},
                       "thrusters": {"x_bow": 1, "x_stern": 1, "max_force": 3},
                       "wind": {"frontal_area": 2, "lateral_area": 2}}.items():  # fmt: skip
        for key in keys.keys() & particulars.get(part, {}).keys():
            particulars[part][key] *= factor ** keys[key]
    force = factor**3
    states = np.array([factor, factor, 1.0, root, root, 1.0 / root, 1.0 / root, 1.0, force, force])
    runs = tuple(Run(r.id, r.t * root, r.states * states, r.inputs * states[6:], COMMANDS) for r in data.runs)
    return replace(data, ship=Ship.from_dict(particulars, "scaled"), dt=data.dt * root, runs=runs)


def subjects(data: Dataset) -> set[str]:
    return {gap.subject for gap in gaps(data)}


REVERSING, STERNWAY, STALL = (
    "reversed propeller: stopping, propeller walk astern",
    "forces going astern",
    "stall of the rudder",
)
DRIFT, TURNING = "cross-flow drag of the hull", "turning: yaw damping and its nonlinear terms"
HEADINGS = "current and wind apart from offsets of rudder, hull and propeller"
ONE_RPM = "propeller walk apart from a rudder offset; thrust and race against the shaft speed"
ONE_SPEED, ZERO_SPEED = "resistance apart from thrust", "forces near zero speed"
THRUSTERS = {"bow thruster", "stern thruster"}
RUDDER = {f"rudder force to {side}, and with it the ship's asymmetry" for side in ("port", "starboard")}
CHANNELS = {"gusts, and wind that differs from run to run", "shallow water"}
NEVER_SLOW = {REVERSING, STERNWAY, ZERO_SPEED}


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (
            "straight",
            {STALL, DRIFT, TURNING, HEADINGS, ONE_RPM, ONE_SPEED} | NEVER_SLOW | THRUSTERS | RUDDER | CHANNELS,
        ),
        ("zigzag", {STALL, DRIFT, HEADINGS, ONE_RPM} | NEVER_SLOW | THRUSTERS | RUDDER | CHANNELS),
        ("turns", {ONE_RPM} | NEVER_SLOW | THRUSTERS | CHANNELS),
        ("all", CHANNELS),
    ],
)
def test_what_a_trial_lacks_is_named_and_nothing_else(kind, expected):
    assert subjects(trial(kind)) == expected


def test_every_gap_has_a_figure_or_a_missing_channel_and_a_manoeuvre():
    for gap in gaps(trial("straight")):
        assert any(c.isdigit() for c in gap.because) or "not recorded" in gap.because
        assert gap.manoeuvre
    because = {gap.subject: gap.because for gap in gaps(trial("turns"))}
    assert (
        because[REVERSING]
        == "shaft speed below -10 % of the usual maximum: 0 s, at least 109 s are needed; least 100 rpm"
    )


def test_a_model_and_its_ship_are_judged_alike():
    for kind in ("zigzag", "turns", "all"):
        assert subjects(scaled(trial(kind), 1 / 43)) == subjects(trial(kind))


def test_recorded_wind_and_depth_and_commanded_actuators_are_seen():
    data = trial("turns")

    def with_channels(depth: np.ndarray) -> Dataset:
        names = (*COMMANDS, "wind_speed", "wind_from", "depth")
        extra = np.column_stack([np.full((STEPS + 1, 2), 3.0), depth])
        return data.with_runs(Run(r.id, r.t, r.states, np.hstack([r.inputs, extra]), names) for r in data.runs)

    assert "shallow water" not in subjects(with_channels(np.linspace(10.0, 20.0, STEPS + 1)))
    found = {gap.subject: gap.because for gap in gaps(with_channels(np.full(STEPS + 1, 12.0)))}
    assert found["shallow water"] == "depth is 12 to 12 m in all samples"
    assert not CHANNELS & found.keys() - {"shallow water"}
    gears = "lag, rate limit, delay and dead band of rudder and shaft"
    assert gears not in subjects(data)
    assert gears in subjects(replace(data, actuators="commanded"))


def test_drift_is_seen_from_the_end_that_leads():
    S, C = np.zeros((2, 10)), np.zeros((2, 4))
    S[:, 3], S[:, 4], S[1, 3] = 5.0, 1.0, -5.0
    samples = Samples(Dataset("two", trial("straight").ship, 1.0, (Run("a", np.arange(2.0), S, C),)))
    np.testing.assert_allclose(samples.drift, np.arctan2(1.0, 5.0))
    assert samples.froude[0] == -samples.froude[1] > 0.0


def test_headings_are_an_arc_on_the_circle():
    ship = trial("straight").ship

    def arc(degrees: np.ndarray) -> float:
        S = np.zeros((len(degrees), 10))
        S[:, 2] = np.deg2rad(degrees)
        return np.rad2deg(
            Samples(
                Dataset("h", ship, 1.0, (Run("a", np.arange(float(len(S))), S, np.zeros((len(S), 4))),))
            ).heading_arc()
        )

    assert arc(np.linspace(-20.0, 20.0, 400)) == pytest.approx(38.0, abs=0.3)  # across north, 5 % left out
    assert arc(np.linspace(340.0, 380.0, 400)) == pytest.approx(38.0, abs=0.3)
    assert arc(np.tile([10.0, 190.0], 100)) == pytest.approx(180.0)
    assert arc(np.linspace(0.0, 360.0, 400)) > 330.0


def test_the_models_sensitivities_tell_what_is_alike():
    turns, everything = ({t.subject: t for t in identifiability(trial(kind))[0]} for kind in ("turns", "all"))
    # at one speed of the shaft, walk and offset push the stern alike; with the revolutions up and down they do not
    assert turns["propeller walk"].closest == "rudder offset"
    assert turns["propeller walk"].explained > COLLINEAR
    assert everything["rudder offset"].explained < turns["rudder offset"].explained
    assert everything["resistance"].explained < turns["resistance"].explained
    assert everything["thrust gain"].explained < turns["thrust gain"].explained
    for subject in ("propeller walk astern", "thruster gain"):  # never used
        assert turns[subject].effect_size <= LEAST_EFFECT < everything[subject].effect_size


def test_on_one_course_a_current_cannot_be_told_apart_and_in_turns_it_can():
    current = {
        kind: next(c for c in identifiability(trial(kind))[0] if c.subject == "current")
        for kind in ("straight", "turns")
    }
    assert current["straight"].explained > COLLINEAR > current["turns"].explained


def test_sensitivities_of_a_model_and_its_ship_agree():
    ours, small = (identifiability(data)[0] for data in (trial("turns"), scaled(trial("turns"), 1 / 43)))
    for a, b in zip(ours, small, strict=True):
        assert (a.subject, a.effect_size > LEAST_EFFECT) == (b.subject, b.effect_size > LEAST_EFFECT)
        assert a.explained == pytest.approx(b.explained, abs=0.03)


def test_runs_too_short_for_rollouts_say_so():
    data = trial("turns")
    found, how = identifiability(data.with_runs(r.slice(0, 3) for r in data.runs))
    assert found == []
    assert "too short" in how


@pytest.mark.parametrize("sigma", [0.0, 0.02, 0.3])
def test_white_noise_is_measured_on_a_moving_signal(sigma):
    t = np.arange(600.0)
    signal = 5.0 * np.sin(2 * np.pi * t / 60.0) + 0.1 * t + 3.0 * (t > 300.0)
    x = signal + sigma * np.random.default_rng(1).standard_normal(len(t))
    assert white_noise(x) == pytest.approx(sigma, rel=0.15, abs=1e-4)


def test_the_noise_of_simulated_trials_is_found():
    rng, clean = np.random.default_rng(2), trial("turns")
    noisy = clean.with_runs(
        Run(r.id, r.t, r.states + NOISE * rng.standard_normal(r.states.shape), r.inputs, COMMANDS) for r in clean.runs
    )
    for c, true in itertools.islice(zip(channel_noise(noisy), NOISE, strict=True), 6):
        assert c.noise == pytest.approx(true, rel=0.12)
        assert c.greatest >= c.noise
        assert np.isnan(c.step)
        assert c.repeated == 0.0


def test_a_grid_of_values_is_seen_and_a_few_changes_are_none():
    rng = np.random.default_rng(3)
    smooth = np.cumsum(rng.standard_normal(3000))
    assert resolution([np.round(smooth / 0.5) * 0.5]) == pytest.approx(0.5)
    assert np.isnan(resolution([smooth]))
    assert np.isnan(resolution([np.repeat(rng.standard_normal(10), 300)]))
    assert np.isnan(resolution([np.zeros(50)]))


def test_commands_in_place_of_positions_are_no_measurements():
    assert "delta" in {c.channel for c in channel_noise(trial("turns"))}
    assert "delta" not in {c.channel for c in channel_noise(replace(trial("turns"), actuators="commanded"))}
