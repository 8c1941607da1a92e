"""Gears followed by machine code against `gear_path`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from shipbench import kept_code
from shipbench.diagnosis.actuators import identify as gears
from shipbench.diagnosis.actuators.identify import _Record, find_in_gears
from shipbench.diagnosis.actuators.kinds import GearFinding, kinds_of
from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.selection import stepwise
from shipbench.diagnosis.selection.analysis import plain_model
from shipbench.diagnosis.selection.stepwise import select
from shipbench.effects.base import EFFECTS, Effect, Parameter
from shipbench.estimation.forward import Plant
from shipbench.estimation.open_loop import rollout_plant
from shipbench.estimation.rollout import Active
from shipbench.ops import Array
from shipbench.physics.actuators import Gear, gear_path
from shipbench.physics.mmg import MMGShip, load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import DELTA, N
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.ships import scaled


@pytest.fixture
def compiler():
    if not kept_code.compiler()[0]:
        pytest.skip("no C compiler here")


def trials(name: str, *values: float) -> Plant:
    return Plant.of(
        sea_trials(load_mmg_ship("kcs"), 4, (Hidden(EFFECTS.get(name), values),), Trials(runs=4, samples=70))
    )


@pytest.mark.parametrize("which", range(6))
def test_machine_code_follows_as_numpy_does(compiler, which, monkeypatch):
    plant, rng = trials("rudder_backlash", 0.03), np.random.default_rng(which)
    record = _Record.of(plant.long, plant.c.L, "delta", np.array([(b, 1) for b in range(len(plant.long.run))]))
    kind = (None, *kinds_of("delta", record.scale, 0.6, Gear(1.0, 0.1)))[which]
    low, high = np.log([0.1, 0.02]), np.log([3.0, 0.2])
    z = rng.uniform(low, high, (9, 2))
    if kind is not None:
        z = np.resize(z, (9, max(2, kind.at + 1)))
        z[:, kind.at] = rng.uniform(np.log(kind.low), np.log(kind.high), 9)
    paths, costs = record.paths(z, kind), record.costs(z, kind)
    monkeypatch.setattr(gears, "_follower", lambda field: None)
    np.testing.assert_allclose(paths, record.paths(z, kind), rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(costs, record.costs(z, kind), rtol=1e-9)


@pytest.mark.parametrize(("name", "value"), [("rudder_delay", 2.5), ("rudder_deadband", 0.04)])
def test_findings_do_not_depend_on_the_compiler(compiler, name, value, monkeypatch):
    plant = trials(name, value)
    found, ordinary, _ = find_in_gears(plant)
    monkeypatch.setattr(gears, "_follower", lambda field: None)
    expected, as_before, _ = find_in_gears(plant)
    assert [f.effect for f in found] == [f.effect for f in expected]
    assert found[0].effect == name
    np.testing.assert_allclose([f.value for f in found], [f.value for f in expected], rtol=1e-3)
    np.testing.assert_allclose([f.score for f in found], [f.score for f in expected], rtol=1e-2)
    assert ordinary.keys() == as_before.keys()


@pytest.mark.long
@pytest.mark.parametrize("name", ["rudder_delay", "rudder_backlash", "rudder_lag", "rudder_rate_limit", "shaft_lag"])
def test_from_the_smallest_size_that_is_told_on_an_effect_is_found(name):
    """The same trials and noise with nothing hidden, with more than the size that they would have shown, and with
    less."""
    ship, effect = load_mmg_ship("kcs"), EFFECTS.get(name)

    def score(*hidden: Hidden) -> GearFinding:
        found, _, _ = find_in_gears(Plant.of(sea_trials(ship, 4, hidden, Trials(runs=8, samples=120))))
        return next(g for g in found if g.effect == name)

    least = score().detectable
    more, less = (least / f if name == "rudder_rate_limit" else least * f for f in (1.2, 0.5))
    assert score(Hidden(effect, (more,))).score > 10.0 > score(Hidden(effect, (less,))).score


@pytest.mark.parametrize("dt", [0.1, 1.0])
def test_an_ordinary_gear_is_found_at_any_sampling(dt):
    """Ten samples a second are no reason for quicker gears: the least rate that is looked for was one of the samples,
    and every gear seemed slow."""
    data, rng = sea_trials(load_mmg_ship("kcs"), 4, (), Trials(runs=4, samples=90)), np.random.default_rng(0)
    each = round(data.dt / dt)
    runs = []
    for run in data.runs:
        inputs = np.repeat(run.inputs, each, axis=0)
        states = np.repeat(run.states, each, axis=0)
        for channel, gear, noise in ((0, Gear(8.0, 3.0), 0.3), (1, Gear(1.5, np.deg2rad(2.5)), np.deg2rad(0.2))):
            path = gear_path(inputs[:1, channel], inputs[None, :-1, channel], dt, gear)[0]
            states[:, 6 + channel] = path + noise * rng.standard_normal(len(path))
        runs.append(replace(run, t=dt * np.arange(len(inputs)), states=states, inputs=inputs))
    found, ordinary, _ = find_in_gears(Plant.of(replace(data, runs=tuple(runs), dt=dt)))
    assert max(f.score for f in found if f.actuator != "F") < 0.0
    assert ordinary["n"].rate == pytest.approx(3.0, rel=0.02)
    assert ordinary["delta"].rate == pytest.approx(np.deg2rad(2.5), rel=0.02)


def test_a_record_that_is_late_by_less_than_a_stage_has_a_slope_to_be_found_by():
    """Orders alone: held for a sample each, they would else not move at all with a small delay, and the fit would rest
    at none."""
    data = sea_trials(load_mmg_ship("kcs"), 3, (), Trials(runs=2, samples=60))
    plant = Plant.of(replace(data, actuators="commanded"))
    still, effect = plant.path_of([]), EFFECTS.get("rudder_delay")
    moved = [plant.path_of([Active(effect, (late,))]) - still for late in (-0.01, -0.02)]
    small, twice = (np.abs(m[..., 1]).max() for m in moved)
    assert 0.0 < small < twice < 2.5 * small


def test_a_rudder_that_is_later_than_its_record_by_part_of_a_sample_has_a_slope_to_be_found_by():
    """It moved by whole stages only, and delays of recorded rudders were never found."""
    plant, effect = trials("rudder_delay", 0.0), EFFECTS.get("rudder_delay")
    at, on = (plant.path_of([Active(effect, (late,))])[..., 1] for late in (1.3, 1.31))
    further = plant.path_of([Active(effect, (1.32,))])[..., 1]
    assert 0.0 < np.abs(on - at).max() < np.abs(further - at).max() < 2.5 * np.abs(on - at).max()


@pytest.mark.long
def test_a_rudder_that_is_later_than_its_record_is_named():
    """The motion alone shows it: between order and record nothing is late."""
    data = sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=12))
    seconds = data.dt * np.arange(len(data.runs[0].states))
    early = [replace(run, states=run.states.copy()) for run in data.runs]
    for run in early:
        run.states[:, DELTA] = np.interp(seconds + 1.3, seconds, run.states[:, DELTA])
    found = diagnose(data.with_runs(early), gain=False)
    (cause,) = found.causes
    assert cause.effect == "rudder_delay"
    assert cause.parameters["delay"].value == pytest.approx(1.3, abs=0.3)
    (warning,) = [w for w in found.warnings if w.startswith("rudder_delay: the motion shows the rudder 1.")]
    assert "by [delay] delta = -1." in warning
    assert found.extended_model in ("physics", "calibrated")  # whose gears end at the record


class Behind(Effect):
    """What follows a gear with a time constant, or after some play."""

    family = "rudder"
    summary = source = ""
    parameters = (Parameter("size", "1", 1.0, 0.0, 100.0),)

    def __init__(self, actuator: str, field: str) -> None:
        self.name, self.actuator, self.field = "behind", actuator, field

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears[self.actuator] = replace(gears[self.actuator], **{self.field: q[0]})


def _recorded_before(ship: MMGShip, gear: Behind, size: float, channel: int, trials: Trials) -> Dataset:
    """The motion with a gear of this size, the record that of the same orders without it."""
    data, plain = (sea_trials(ship, 6, hidden, trials) for hidden in ((Hidden(gear, (size,)),), ()))
    runs = [replace(run, states=run.states.copy()) for run in data.runs]
    for run, other in zip(runs, plain.runs, strict=True):
        run.states[:, channel] = other.states[:, channel]
    return data.with_runs(runs)


@pytest.mark.parametrize(
    ("effect", "gear", "size", "channel", "told"),
    [
        pytest.param("rudder_lag", Behind("delta", "T2"), 3.0, DELTA, "by [delay] delta = -", marks=pytest.mark.long),
        pytest.param(
            "rudder_backlash",
            Behind("delta", "backlash"),
            0.05,
            DELTA,
            "Measure behind that play.",
            marks=pytest.mark.long,
        ),
        pytest.param("shaft_lag", Behind("n", "T2"), 8.0, N, "by [delay] n = -", marks=pytest.mark.long),
    ],
)
def test_a_gear_behind_its_record_is_named(effect: str, gear: Behind, size: float, channel: int, told: str):
    found = diagnose(_recorded_before(load_mmg_ship("container130"), gear, size, channel, Trials(runs=16)), gain=False)
    (cause,) = found.causes
    assert cause.effect == effect
    (value,) = cause.parameters.values()
    assert value.value == pytest.approx(size, rel=0.2)
    (warning,) = [w for w in found.warnings if w.startswith(f"{effect}: the motion shows ")]
    assert told in warning
    assert found.extended_model in ("physics", "calibrated")


@pytest.mark.long
def test_play_is_judged_beside_a_lag_that_is_too_small_to_matter(monkeypatch: pytest.MonkeyPatch):
    """On a boat a record that is 0.2 s early was passed over, and play that is not there named for it."""
    ship, trials = (
        scaled(load_mmg_ship("kcs"), 12.0),
        Trials(runs=12, samples=120, thrusters=False, astern=False, gusts=0.5, noise=0.3),
    )
    monkeypatch.setattr(stepwise, "_least", lambda best, now: -np.inf)  # no refit is given up
    found = select(plain_model(Plant.of(_recorded_before(ship, Behind("delta", "T2"), 0.2, DELTA, trials))), 10.0)
    (play,) = [s for s in found.steps if s.term.label == "rudder_backlash" and s.round == 0]
    assert play.score > 30.0
    assert {"rudder_delay", "rudder_lag"} <= set(found.unmet)
    assert not found.final.model.terms


@pytest.mark.parametrize(("actuators", "field"), [("measured", "T2"), ("commanded", "T")])
def test_a_lag_behind_the_record_follows_the_motor_where_orders_drive_the_ship(actuators: str, field: str):
    """Before the motor, whose rate is limited, it hardly shows: held-out gains of it were 21 %, now 31."""
    data = replace(sea_trials(load_mmg_ship("kcs"), 3, (), Trials(runs=2, samples=60)), actuators=actuators)
    ordinary = Gear(2.0, 0.05)
    plant, goal = (
        rollout_plant(data, {"delta": gear}, 120.0)
        for gear in (ordinary, replace(ordinary, **{field: getattr(ordinary, field) + 3.0}))
    )
    np.testing.assert_allclose(plant.path_of([Active(EFFECTS.get("rudder_lag"), (3.0,))]), goal.path, atol=1e-12)
