"""Records of actuators that read something else than where their commands bring them, and gears of two stages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.gears import find_in_gears
from shipbench.diagnosis.misread import RecordError
from shipbench.diagnosis.plant import Plant
from shipbench.effects.base import EFFECTS
from shipbench.physics.actuators import Gear, gear_path
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import DELTA, N
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials

PLAN = Trials(runs=8)
ERRORS = {
    "5 % low": lambda d: 0.95 * d,
    "10 % high": lambda d: 1.1 * d,
    "not linear": lambda d: d + 0.05 * np.sin(2.0 * d),
    "steeper to starboard": lambda d: d + 0.08 * abs(d),
}


def trials(*hidden: Hidden) -> Dataset:
    return sea_trials(load_mmg_ship("kcs"), 4, hidden, PLAN)


def recorded(data: Dataset, channel: int, error) -> Dataset:
    runs = []
    for run in data.runs:
        states = run.states.copy()
        states[:, channel] = error(states[:, channel])
        runs.append(replace(run, states=states))
    return data.with_runs(runs)


def named(data: Dataset) -> tuple[list[str], list[RecordError]]:
    found, _, errors = find_in_gears(Plant.of(data))
    return [f.effect for f in found if f.score > 10.0], errors


@pytest.mark.parametrize("error", ERRORS.values(), ids=ERRORS)
@pytest.mark.parametrize("ship", ["kcs", "mariner"])
def test_an_error_of_the_record_is_no_deadband(ship, error):
    data = published_trials(PUBLISHED[ship], 2, (), PLAN) if ship in PUBLISHED else trials()
    effects, errors = named(recorded(data, DELTA, error))
    assert effects == []
    (found,) = errors
    angles = np.linspace(-0.5, 0.5, 11)
    np.testing.assert_allclose(found.taken_out(error(angles)), angles, atol=0.004)


def test_a_zero_error_is_none_of_them():
    assert named(recorded(trials(), DELTA, lambda d: d + 0.035)) == ([], [])


CAUSES = {"rudder_deadband": 0.026, "rudder_backlash": 0.026, "rudder_lag": 3.0, "rudder_delay": 1.5, "rudder_rate_limit": 0.02}


@pytest.mark.parametrize(("name", "value"), CAUSES.items())
def test_what_is_wrong_with_a_gear_is_no_error_of_its_record_and_is_seen_beside_one(name, value):
    data = trials(Hidden(EFFECTS.get(name), (value,)))
    effects, errors = named(data)
    assert (effects[0], errors) == (name, [])
    assert named(recorded(data, DELTA, ERRORS["5 % low"]))[0][0] == name


@pytest.mark.parametrize("noise", [0.2, 0.005], ids=["noise", "almost exact"])
def test_a_gear_of_two_stages_is_an_ordinary_one(noise):
    data, rng, runs = trials(), np.random.default_rng(0), []
    scale, parts = (data.ship.L / 130.0) ** 0.5, 50
    for run in data.runs:
        motor = gear_path(run.states[:1, DELTA], np.repeat(run.inputs[None, :-1, 1], parts, axis=1), data.dt / parts, Gear(scale, 0.044 / scale))[0]
        position = motor.copy()
        for i in range(1, len(motor)):  # the trapezoidal rule, as nobody else here follows a second stage
            h = 0.5 * data.dt / parts / scale
            position[i] = (position[i - 1] * (1.0 - h) + h * (motor[i] + motor[i - 1])) / (1.0 + h)
        states = run.states.copy()
        states[:, DELTA] = position[::parts] + np.deg2rad(noise) * rng.standard_normal(len(run))
        runs.append(replace(run, states=states))
    assert named(data.with_runs(runs)) == ([], [])


def test_the_motion_tells_whether_record_or_order_is_wrong():
    """Low revolutions passed for a propeller of too much thrust."""
    data = sea_trials(load_mmg_ship("kcs"), 7, (), Trials(runs=12))
    low = diagnose(recorded(data, N, lambda n: 0.9 * n), gain=False)
    ordered = diagnose(data.with_runs([replace(r, inputs=r.inputs * np.r_[1.1, np.ones(r.inputs.shape[1] - 1)]) for r in data.runs]), gain=False)
    for result, axis, taken in ((low, "recorded revolutions", "ordered"), (ordered, "ordered revolutions", "recorded")):
        assert (result.verdict, result.causes) == ("unknown", ())
        assert (result.unknown["axis"], result.unknown["variable"]) == (axis, "revolutions")
        (text,) = (w for w in result.warnings if f"error of the {axis}" in w)
        assert f"it is taken as {taken}" in text


def test_beside_a_named_cause_it_is_a_warning():
    result = diagnose(
        recorded(sea_trials(load_mmg_ship("kcs"), 7, (Hidden(EFFECTS.get("current"), (0.3, 0.2)),), Trials(runs=12)), DELTA, ERRORS["10 % high"]),
        gain=False,
    )
    assert [c.effect for c in result.causes] == ["current"]
    assert any("error of the recorded rudder" in w for w in result.warnings)
