"""Rollouts and single steps as machine code against numpy's loops over the same formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench import kept_code
from shipbench.effects.base import EFFECTS, Effect, Parameter
from shipbench.estimation import rollout as rolling
from shipbench.estimation.coefficients import NUM_BASE, ShipScales, parameters
from shipbench.estimation.forward import Plant, cut
from shipbench.estimation.linearisation import Linearisation, Point, Scales
from shipbench.estimation.open_loop import rollout_plant
from shipbench.estimation.term import Term
from shipbench.physics import eq2
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.ship import complete
from shipbench.simulate.trials import Trials, sea_trials

FORCES = tuple(
    name
    for name in EFFECTS.names()
    if name != "change_point" and EFFECTS.get(name).enters == "force" and not EFFECTS.get(name).channels
)


@pytest.fixture(scope="module", params=["kcs", "windy kcs", "every 6 s"])
def data(request) -> Dataset:
    """Runs of a ship; with measured wind; and with samples so far apart that each takes several integration steps."""
    made = sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=3, samples=60))
    if request.param == "windy kcs":
        wind = np.stack([4.0 + np.sin(np.arange(61) / 9.0), np.arange(61) / 20.0], axis=1)
        runs = [
            Run(
                r.id,
                r.t,
                r.states,
                np.concatenate([r.inputs, wind[: len(r)]], axis=1),
                (*r.inputs_names, "wind_speed", "wind_from"),
            )
            for r in made.runs
        ]
        made = replace(made, runs=tuple(runs))
    if request.param == "every 6 s":
        runs = [Run(r.id, r.t[::6], r.states[::6], r.inputs[::6]) for r in made.runs]
        made = replace(made, runs=tuple(runs), dt=6.0)
    return made


@pytest.fixture(params=[False, True], ids=["recorded", "commanded"])
def plant(request, data) -> Plant:
    return Plant(complete(data.ship), replace(cut(data, 40), commanded=request.param))


def point(plant: Plant, *names: str, since: int | None = None, size: float = 0.3) -> Point:
    rng = np.random.default_rng(0)
    terms = []
    for name in names:
        effect = EFFECTS.get(name)
        begins = since if effect.enters == "force" and not effect.per_run else None
        terms.append(
            Term(effect, tuple(effect.settings(plant.seg.states[..., :2], plant.ship)[0]), effect.per_run, begins)
        )
    values = tuple(size * rng.standard_normal((plant.seg.runs, t.size) if t.per_run else t.size) for t in terms)
    eta, w = (size * rng.standard_normal((len(plant.seg.run), *shape)) for shape in ((6,), (plant.knots, 3)))
    return Point(size * rng.standard_normal(NUM_BASE), eta, w, tuple(terms), values)


@pytest.fixture
def compiler(monkeypatch):
    """Nothing built before the test."""
    if not kept_code.compiler()[0]:
        pytest.skip("no C compiler here")
    monkeypatch.setattr(rolling, "_built", {})


def both(plant: Plant, at: Point, monkeypatch) -> tuple[Linearisation, Linearisation]:
    """The linearisation with machine code and without."""
    found = Linearisation(plant, Scales(plant), at)
    found.columns()
    assert sum(code is not None for code in rolling._built.values()) == 2  # a step, and its accelerations
    monkeypatch.setattr(rolling.Course, "_code", lambda *_, **__: None)
    loops = Linearisation(plant, Scales(plant), at)
    loops.columns()
    return found, loops


def assert_agree(code: np.ndarray, loops: np.ndarray, within: float = 1e-9) -> None:
    np.testing.assert_array_equal(np.isfinite(code), np.isfinite(loops))
    axes = tuple(range(code.ndim - 1))
    size = np.maximum(np.max(np.abs(loops), axis=axes, where=np.isfinite(loops), initial=0.0), 1e-300)
    np.testing.assert_allclose(code / size, loops / size, rtol=within, atol=within)


@pytest.mark.parametrize(
    "names", [(), ("current",), ("current_per_run", "bank_suction", "rudder_lag"), ("cross_flow_drag", "wave_drift")]
)
def test_machine_code_and_numpy_agree(compiler, plant, names, monkeypatch):
    code, loops = both(plant, point(plant, *names, since=1), monkeypatch)
    for name in ("motion", "here", "rates"):
        assert_agree(getattr(code, name), getattr(loops, name))
    for name in ("jacobian", "base_sources"):  # differences over small steps
        assert_agree(getattr(code, name), getattr(loops, name), 1e-5)


@pytest.mark.long
@pytest.mark.parametrize("name", FORCES)
def test_every_force_of_the_library_becomes_machine_code(compiler, name, monkeypatch):
    made = sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=2, samples=30))
    code, loops = both(plant := Plant.of(made), point(plant, name), monkeypatch)
    assert_agree(code.motion, loops.motion)


def test_a_run_that_blows_up_is_not_finite_in_either(compiler, plant, monkeypatch):
    wild = point(plant, size=0.0)
    wild.w[0], wild.base[1] = 1e9, -80.0
    code, loops = both(plant, wild, monkeypatch)
    assert not np.isfinite(code.motion[0]).all()
    np.testing.assert_array_equal(np.isfinite(code.motion), np.isfinite(loops.motion))


def test_a_trial_that_blows_up_is_not_warned_of():
    """Numbers that are infinite, and not merely not numbers, come out of some of these; a warning is an error in these
    tests."""
    part = rollout_plant(sea_trials(load_mmg_ship("kcs"), 3, (), Trials(runs=4, samples=100)), {}, 120.0)
    base = 20.0 * np.random.default_rng(0).standard_normal(NUM_BASE)
    still = Point(base, np.zeros((4, 6)), np.zeros((4, part.knots, 3)))
    lin = Linearisation(part, Scales(part), still)
    lin.parameter_columns()
    assert not np.isfinite(lin.motion).all()


def test_one_compilation_serves_all_ships(compiler):
    plants = [
        Plant.of(sea_trials(load_mmg_ship(ship), 5, (), Trials(runs=2, samples=30))) for ship in ("kcs", "container130")
    ]
    for plant in plants:
        Linearisation(plant, Scales(plant), point(plant))
    assert len(rolling._built) == 2


def test_and_all_ways_in_which_an_effect_is_fitted(compiler, monkeypatch):
    found = []
    for ship in ("kcs", "container130"):
        plant = Plant.of(sea_trials(load_mmg_ship(ship), 5, (), Trials(runs=2, samples=30)))
        for way in EFFECTS.get("wind").fitted(plant.c.L):
            at = replace(point(plant, "wind"), terms=(Term(way, (), False),))
            found.append((plant, at, Linearisation(plant, Scales(plant), at).motion))
    assert len(rolling._built) == 2
    monkeypatch.setattr(rolling.Course, "_code", lambda *_, **__: None)
    for plant, at, motion in found:
        assert_agree(motion, Linearisation(plant, Scales(plant), at).motion)
    assert len({motion.tobytes() for _, _, motion in found}) == len(found) > 2


class Stubborn(Effect):
    """Looks at its value, as no effect should: symbols have none."""

    name, family, parameters = "stubborn", "hull", (Parameter("amplitude", "1", 1.0, -5.0, 5.0),)

    def force(self, e, s, q, ship):
        if q[0] > 0.0:
            e.push(q[0] * ship.mass)


class Shallow(Effect):
    """Looks at its own number and at the ship's."""

    name, family, parameters = "shallow", "hull", (Parameter("amplitude", "1", 1.0, -5.0, 5.0),)

    def __init__(self, depth: float) -> None:
        self.depth = depth

    def force(self, e, s, q, ship):
        if self.depth < 2.0 * ship.T:
            e.push(q[0] * ship.mass)


def test_one_that_asks_for_proportions_is_compiled_for_each_ship_and_number(compiler, plant):
    x0, still = plant.seg.states[:, 0, :6], np.zeros((len(plant.seg.run), plant.steps + 1, 3))
    ends = [
        plant.roll(x0, [0.0] * 11, [rolling.Active(Shallow(depth), (1e-2,))], still)[0, 1, 3] for depth in (1000.0, 5.0)
    ]
    assert ends[1] > ends[0]
    assert sum(code is not None for code in rolling._built.values()) == 2


def test_an_effect_that_takes_no_symbols_goes_through_numpy(plant):
    course = plant.course
    active = [rolling.Active(Stubborn(), (1e-3,))]
    x0, push = plant.seg.states[:, 0, :6], plant.pushes(np.zeros((len(plant.seg.run), plant.steps + 1, 3)))
    assert course._code(active, steps=True) is None
    moved = plant.roll(x0, [0.0] * 11, active, np.zeros((len(x0), plant.steps + 1, 3)))
    assert moved[0, 1, 3] > plant.roll(x0, [0.0] * 11, [], np.zeros((len(x0), plant.steps + 1, 3)))[0, 1, 3]
    assert push.shape == (plant.steps, len(x0), plant.substeps, 3, 3)


@pytest.mark.parametrize("wind", [None, (7.0, 0.8)])
def test_slopes_are_those_of_the_accelerations(wind):
    """Rates and central differences of the formula, for a calibrated ship with a current, at 20 states."""
    rng, ship = np.random.default_rng(1), complete(load_mmg_ship("kcs").particulars)
    vessel = rolling.Vessel(ship, eq2.coefficients(ship))
    p, active = parameters(ShipScales.of(ship, vessel.c, True), 0.5 * rng.standard_normal(NUM_BASE))
    active.append(rolling.Active(EFFECTS.get("current"), (0.4, -0.3)))
    slopes = rolling.Slopes.of(active, vessel, wind is not None)
    state = rng.uniform([-3.0, 2.0, -1.0, -0.02], [3.0, 8.0, 1.0, 0.02], (1, 20, 4))
    act = rng.uniform([-60.0, -0.5, 0.0, 0.0], [100.0, 0.5, 1e4, 1e4], (1, 20, 4))
    values = np.array([[*p, *(v for a in active for v in a.q)]], dtype=float)

    def formula(at: np.ndarray) -> np.ndarray:
        x = (0.0, 0.0, *np.moveaxis(at, -1, 0))
        return np.stack(rolling.accelerations(x, np.moveaxis(act, -1, 0), 0.0, wind, p, active, vessel), axis=-1)

    rates, found = slopes(state, values, act, None if wind is None else np.broadcast_to(wind, (1, 20, 2)))
    np.testing.assert_allclose(rates, formula(state), rtol=1e-9, atol=1e-12)
    h = 1e-6 * np.eye(4)
    differences = np.stack([(formula(state + d) - formula(state - d)) / 2e-6 for d in h], axis=-1)
    np.testing.assert_allclose(found, differences, rtol=1e-4, atol=1e-7)
