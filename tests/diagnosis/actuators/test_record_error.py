"""Records of actuators that read something else than where their commands bring them, and gears of two stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.actuators.identify import find_in_gears
from shipbench.diagnosis.actuators.record_error import RecordError, readings
from shipbench.diagnosis.diagnose import diagnose
from shipbench.effects.base import EFFECTS
from shipbench.estimation.forward import Plant
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


@pytest.mark.long
@pytest.mark.parametrize("error", ERRORS.values(), ids=ERRORS)
@pytest.mark.parametrize("ship", ["kcs", "mariner"])
def test_an_error_of_the_record_is_no_deadband(ship, error):
    data = published_trials(PUBLISHED[ship], 2, (), PLAN) if ship in PUBLISHED else trials()
    effects, errors = named(recorded(data, DELTA, error))
    assert effects == []
    (found,) = errors
    angles = np.linspace(-0.5, 0.5, 11)
    np.testing.assert_allclose(found.taken_out(error(angles)), angles, atol=0.004)


@pytest.mark.parametrize("factors", [(0.02, 0.6, 0.0, 0.0), (0.0, -0.4, 0.0, 0.0), (0.0, -0.1, 0.4, -0.1)])
def test_taking_an_error_out_is_exact(factors):
    error, true = RecordError("delta", "", 0.0, 0.0, np.array(factors)), np.linspace(-0.6, 0.6, 25)
    np.testing.assert_allclose(error.taken_out(true + np.tensordot(error.factors, readings(true), 1)), true, atol=1e-9)


def test_a_zero_error_is_none_of_them():
    assert named(recorded(trials(), DELTA, lambda d: d + 0.035)) == ([], [])


CAUSES = {
    "rudder_deadband": 0.026,
    "rudder_backlash": 0.026,
    "rudder_lag": 3.0,
    "rudder_delay": 1.5,
    "rudder_rate_limit": 0.02,
}


@pytest.mark.long
@pytest.mark.parametrize(("name", "value"), CAUSES.items())
def test_what_is_wrong_with_a_gear_is_no_error_of_its_record_and_is_seen_beside_one(name, value):
    data = trials(Hidden(EFFECTS.get(name), (value,)))
    effects, errors = named(data)
    assert (effects[0], errors) == (name, [])
    assert named(recorded(data, DELTA, ERRORS["5 % low"]))[0][0] == name


def driven(gear: Callable[[np.ndarray, float, float], np.ndarray], noise: float = 0.2) -> Dataset:
    """Trials whose rudder is at positions (samples,) that a gear gives for commands (samples * 50,), steps of time and
    a scale of times."""
    data, rng, runs = trials(), np.random.default_rng(0), []
    for run in data.runs:
        position = gear(np.repeat(run.inputs[:-1, 1], 50), data.dt / 50, (data.ship.L / 130.0) ** 0.5)[::50]
        states = run.states.copy()
        states[:, DELTA] = position + np.deg2rad(noise) * rng.standard_normal(len(run))
        runs.append(replace(run, states=states))
    return data.with_runs(runs)


def followed(command: np.ndarray, dt: float, scale: float, **more: float) -> np.ndarray:
    return gear_path(
        np.zeros(1), command[None], dt, Gear(scale, 0.044 / scale, **{k: np.full(1, v) for k, v in more.items()})
    )[0]


@pytest.mark.long
@pytest.mark.parametrize("noise", [0.2, 0.005], ids=["noise", "almost exact"])
def test_a_gear_of_two_stages_is_an_ordinary_one(noise):
    def two_stages(command, dt, scale):
        motor = followed(command, dt, scale)
        position, h = motor.copy(), 0.5 * dt / scale
        for i in range(1, len(motor)):  # the trapezoidal rule: not the formula of `Gear.T2`
            position[i] = (position[i - 1] * (1.0 - h) + h * (motor[i] + motor[i - 1])) / (1.0 + h)
        return position

    assert named(driven(two_stages, noise)) == ([], [])


@pytest.mark.long
@pytest.mark.parametrize(
    ("more", "names"), [({}, []), ({"deadband": 0.026}, ["rudder_deadband"]), ({"delay": 2.0}, ["rudder_delay"])]
)
def test_orders_beyond_the_end_stops_are_ordinary(more, names):
    """Stops at 20 degrees, orders up to 35."""
    effects, errors = named(
        driven(lambda command, dt, scale: followed(np.clip(command, -0.35, 0.35), dt, scale, **more))
    )
    assert (effects[:1], errors) == (names, [])


@pytest.mark.long
def test_a_late_record_is_named_once_and_told_from_a_late_rudder():
    """The gear seems late, and the rudder acts before its record: the same effect twice, which no spec takes."""
    data = sea_trials(load_mmg_ship("kcs"), 4, (), Trials(runs=12))
    result = diagnose(recorded(data, DELTA, lambda d: np.r_[d[[0, 0]], d[:-2]]), gain=False)
    assert ([c.effect for c in result.causes], result.extended_model) == (["rudder_delay"], "calibrated+rudder_delay")
    assert result.causes[0].parameters["delay"].value == pytest.approx(2.0, abs=0.1)
    assert "the record is late" in result.causes[0].evidence


@pytest.mark.long
def test_the_motion_tells_whether_record_or_order_is_wrong():
    """Low revolutions passed for a propeller of too much thrust."""
    data = sea_trials(load_mmg_ship("kcs"), 7, (), Trials(runs=12))
    read_low = recorded(data, N, lambda n: 0.9 * n)
    low = diagnose(read_low, gain=False)
    ordered = diagnose(
        data.with_runs([replace(r, inputs=r.inputs * np.r_[1.1, np.ones(r.inputs.shape[1] - 1)]) for r in data.runs]),
        gain=False,
    )
    for result, axis, taken in (
        (low, "recorded revolutions", "commanded"),
        (ordered, "ordered revolutions", "recorded"),
    ):
        assert (result.verdict, result.causes) == ("unknown", ())
        assert (result.unknown["axis"], result.unknown["variable"]) == (axis, "revolutions")
        (text,) = (w for w in result.warnings if f"error of the {axis}" in w)
        assert f"it is taken as {taken}" in text
    assert low.fingerprint == read_low.fingerprint  # of the data as they were given, though they are read otherwise


@pytest.mark.long
def test_beside_a_named_cause_it_is_a_warning_and_of_a_rudder_the_motion_does_not_tell():
    result = diagnose(
        recorded(
            sea_trials(load_mmg_ship("kcs"), 7, (Hidden(EFFECTS.get("current"), (0.3, 0.2)),), Trials(runs=12)),
            DELTA,
            ERRORS["10 % high"],
        ),
        gain=False,
    )
    assert [c.effect for c in result.causes] == ["current"]
    assert any("error of the recorded or ordered rudder" in w and "does not show" in w for w in result.warnings)
