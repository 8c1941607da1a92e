"""Gross unit and sign errors are found from kinematics; ordinary faults of sensors, currents and winds raise none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from every_day import every

from shipbench.checking.units import check_units, corrected
from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import DELTA, F_B, F_S, PSI, STATES, N, R, U, V, X, Y
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import sea_trials

SHIPS = ("container130", "kcs", "kvlcc2_l7")
DEG, KNOTS = 180.0 / np.pi, 3600.0 / 1852.0
FAULTS = {
    "yaw rate to port": ({R: -1.0}, {"r": "sign"}),
    "yaw rate in deg/s": ({R: DEG}, {"r": "degrees per second"}),
    "yaw rate in deg/min": ({R: 60.0 * DEG}, {"r": "degrees per minute"}),
    "heading in degrees": ({PSI: DEG}, {"psi": "degrees"}),
    "heading anticlockwise": ({PSI: -1.0}, {"psi": "sign"}),
    "heading and yaw rate anticlockwise": ({PSI: -1.0, R: -1.0}, {"psi": "sign", "r": "sign"}),
    "speeds in knots": ({U: KNOTS, V: KNOTS}, {"u": "knots", "v": "knots"}),
    "speeds in km/h": ({U: 3.6, V: 3.6}, {"u": "km/h", "v": "km/h"}),
    "surge backwards": ({U: -1.0}, {"u": "sign"}),
    "sway to port": ({V: -1.0}, {"v": "sign"}),
    "surge alone in knots": ({U: KNOTS}, {"u": "knots"}),
    "sway alone in knots": ({V: KNOTS}, {"v": "knots"}),
    "west positive": ({Y: -1.0}, {"y": "sign"}),
    "south positive": ({X: -1.0}, {"x": "sign"}),
    "rudder in degrees": ({DELTA: DEG}, {"delta": "degrees", "delta_c": "degrees"}),
    "rudder to port": ({DELTA: -1.0}, {"delta": "sign", "delta_c": "sign"}),
    "rudder to port in degrees": ({DELTA: -DEG}, {"delta": "degrees, sign", "delta_c": "degrees, sign"}),
    "revolutions astern": ({N: -1.0}, {"n": "sign", "n_c": "sign"}),
    "revolutions in rev/s": ({N: 1.0 / 60.0}, {"n": "rev/s", "n_c": "rev/s"}),
    "revolutions in rad/s": ({N: 2.0 * np.pi / 60.0}, {"n": "rad/s", "n_c": "rad/s"}),
}
ORDINARY = (
    "antenna_offset", "current", "current_per_run", "heading_bias", "position_delay", "rudder_offset", "shallow_water",
    "speed_scale",
    "velocity_delay", "wind", "wind_per_run", "yaw_rate_bias",
)  # fmt: skip


@cache
def trials(ship: str, seed: int = 5) -> Dataset:
    return sea_trials(load_mmg_ship(ship), seed)


def misread(data: Dataset, factors: dict[int, float], commands: bool = True) -> Dataset:
    runs = []
    for run in data.runs:
        states, inputs = run.states.copy(), run.inputs.copy()
        for channel, factor in factors.items():
            states[:, channel] *= factor
            if commands and channel >= N:
                inputs[:, channel - N] *= factor
        runs.append(replace(run, states=states, inputs=inputs))
    return data.with_runs(runs)


@pytest.mark.parametrize("fault", every(3, FAULTS))
@pytest.mark.parametrize("ship", SHIPS)
def test_a_planted_fault_is_found_named_and_taken_out(ship: str, fault: str):
    factors, wanted = FAULTS[fault]
    data = trials(ship)
    spoilt = misread(data, factors)
    findings = check_units(spoilt)
    assert {f.channel: f.kind for f in findings} == wanted
    mended = corrected(spoilt, findings)
    for run, true in zip(mended.runs, data.runs, strict=True):
        np.testing.assert_allclose(run.states, true.states, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(run.inputs, true.inputs, rtol=1e-9, atol=1e-12)
    assert all(f.factor == pytest.approx(factors[STATES.index(f.channel.removesuffix("_c"))]) for f in findings)
    assert all(any(c.isdigit() for c in f.evidence) for f in findings)
    assert len(mended.notes) == len(findings)


def test_north_and_east_exchanged_are_found_and_put_back():
    data = trials("container130")
    runs = []
    for run in data.runs:
        states = run.states.copy()
        states[:, [X, Y]] = states[:, [Y, X]]
        runs.append(replace(run, states=states))
    findings = check_units(data.with_runs(runs))
    assert [(f.channel, f.kind) for f in findings] == [("x", "exchanged with y")]
    np.testing.assert_array_equal(corrected(data.with_runs(runs), findings).runs[3].states, data.runs[3].states)


def test_thrusters_in_kilonewton_are_found():
    findings = check_units(misread(trials("container130"), {F_B: 1e-3, F_S: 1e-3}))
    assert {(f.channel, f.kind) for f in findings} == {(c, "kN") for c in ("F_b", "F_s", "F_b_c", "F_s_c")}


@pytest.mark.parametrize(
    ("channel", "factor", "kind"), [(DELTA, DEG, "degrees"), (DELTA, -1.0, "sign"), (N, 1.0 / 60.0, "rev/s")]
)
def test_an_actuator_in_another_unit_than_its_command_is_told_from_it(channel: int, factor: float, kind: str):
    findings = check_units(misread(trials("kcs"), {channel: factor}, commands=False))
    assert [(f.channel, f.kind) for f in findings] == [(STATES[channel], kind)]


def test_a_heading_in_degrees_is_found_without_a_track():
    findings = check_units(misread(trials("kcs"), {X: 0.0, Y: 0.0, PSI: DEG}))
    assert [(f.channel, f.kind) for f in findings] == [("psi", "degrees")]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_ordinary_effects_raise_no_finding(seed: int):
    rng = np.random.default_rng(100 + seed)
    ship = load_mmg_ship(SHIPS[seed % 3])
    hidden = []
    for name in rng.choice(ORDINARY, 3, replace=False):
        effect = EFFECTS.get(str(name))
        size = rng.uniform(0.5, 1.5)
        if effect.per_run:
            hidden.append(
                Hidden(effect, tuple(size * p.typical * rng.standard_normal(24) for p in effect.sized(ship.L)))
            )
        else:
            q = [size * p.typical * (1.0 if p.low == 0.0 else rng.choice([-1.0, 1.0])) for p in effect.sized(ship.L)]
            hidden.append(
                Hidden(
                    effect,
                    tuple(float(np.clip(v, p.low, p.high)) for v, p in zip(q, effect.sized(ship.L), strict=True)),
                )
            )
    findings = check_units(sea_trials(ship, 1000 + seed, hidden))
    assert findings == [], [h.effect.name for h in hidden]


def test_a_clean_set_is_returned_as_it_is():
    data = trials("kvlcc2_l7")
    assert check_units(data) == []
    assert corrected(data, []) is data


def test_hardly_any_data_and_no_motion_raise_no_finding():
    data = trials("container130")
    short = data.with_runs([data.runs[0].slice(0, 20)])
    still = misread(data, dict.fromkeys(range(10), 0.0))
    assert check_units(short) == []
    assert check_units(still) == []


def test_the_noise_of_a_thruster_at_rest_is_no_unit():
    """Its 50 N had been a thousandth of the ship file's force, and so kilonewtons beyond doubt."""
    data, rng = trials("container130"), np.random.default_rng(0)

    def at_rest(run):
        still = np.pad(50.0 * rng.uniform(-1.0, 1.0, (len(run), 2)), ((0, 0), (8, 0)))
        return replace(
            run,
            states=np.where(np.arange(10) < 8, run.states, still),
            inputs=np.where(np.arange(4) < 2, run.inputs, 0.0),
        )

    assert check_units(data.with_runs([at_rest(run) for run in data.runs])) == []
