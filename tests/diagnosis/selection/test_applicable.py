"""A cause acts through parts that the ship has, and has a size that a ship may have: of every effect, plug-ins too."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from made_fits import made_fit

from shipbench.diagnosis.selection.agreement import is_on_a_ship
from shipbench.diagnosis.selection.applicable import why_not
from shipbench.diagnosis.selection.stepwise import candidates_for
from shipbench.effects.base import EFFECTS, Effect, Parameter
from shipbench.estimation.forward import Plant
from shipbench.estimation.term import Term
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.ship import complete
from shipbench.signals import DELTA, F_B, F_S, N
from shipbench.simulate.trials import Trials, sea_trials

SHIP = complete(load_mmg_ship("container130").particulars)


class FlapLag(Effect):
    """A plug-in's effect that states its family and bounds, no more."""

    family = "rudder"
    summary = "flap of the rudder that follows late"
    source = "a test"
    parameters = (Parameter("lag", "s", 2.0, 0.0, 8.0),)


@cache
def trials() -> Dataset:
    return sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=6, samples=60))


def without(*channels: int, value: float = 0.0) -> Plant:
    """The plant of runs in which some actuators, and their commands, stand at `value` throughout."""
    runs = []
    for run in trials().runs:
        states, inputs = run.states.copy(), run.inputs.copy()
        states[:, list(channels)] = value
        inputs[:, [c - N for c in channels]] = value
        runs.append(replace(run, states=states, inputs=inputs))
    return Plant.of(trials().with_runs(runs))


@pytest.mark.parametrize(("channels", "family"), [((DELTA,), "rudder"), ((F_B, F_S), "thruster"), ((N,), "propulsion")])
def test_what_acts_through_an_actuator_that_never_works_is_not_asked(channels: tuple[int, ...], family: str):
    asked = {t.label for t in candidates_for(without(*channels))}
    of_family = {
        name for name in EFFECTS.names() if EFFECTS.get(name).family == family and EFFECTS.get(name).acts_through
    }
    assert of_family
    assert not asked & of_family
    assert {t.label for t in candidates_for(Plant.of(trials()))} & of_family
    assert {"current", "heading_bias", "added_resistance"} <= asked


def test_a_rudder_whose_record_stands_still_does_not_work():
    data = trials()
    assert why_not(EFFECTS.get("rudder_offset"), Plant.of(data)) == ""
    assert "rudder never moves" in why_not(EFFECTS.get("rudder_offset"), Plant.of(data, still={"delta"}))


def test_a_plug_in_is_asked_as_much_as_a_built_in_effect():
    flap = FlapLag()
    assert why_not(flap, without(DELTA)) == why_not(EFFECTS.get("rudder_lag"), without(DELTA)) != ""
    assert why_not(flap, Plant.of(trials())) == ""
    for size, wanted in ((3.0, True), (9.0, False)):
        assert is_on_a_ship(made_fit((Term(flap),), (np.array([size / 2.0]),)), 0) is wanted


def test_inputs_that_are_missing_or_known_already_are_told():
    plant = Plant.of(trials())
    assert "not measured" in why_not(EFFECTS.get("wind_drift"), plant)
    assert why_not(EFFECTS.get("wind"), plant) == ""
    plant.inputs = frozenset({"wind_speed", "wind_from", "depth"})
    assert why_not(EFFECTS.get("wind_drift"), plant) == ""
    assert "wind is measured" in why_not(EFFECTS.get("wind_per_run"), plant)
    assert "depth is measured" in why_not(EFFECTS.get("shallow_water"), plant)


@pytest.mark.parametrize(("heel", "wanted"), [(4.0, True), (-9.0, True), (11.8, False), (-15.0, False)])
def test_no_ship_sails_with_a_list_that_no_intact_ship_may_have(heel: float, wanted: bool):
    """11.8 degrees were named for a compass 3 degrees off, by which velocities from satellites had been turned, too."""
    found = made_fit((Term(EFFECTS.get("list")),), (np.array([heel / 4.0, 1.0]),))
    assert is_on_a_ship(found, 0) is wanted


@pytest.mark.parametrize("name", [n for n in EFFECTS.names() if n not in ("change_point", "unit_or_sign_error")])
def test_every_effect_may_have_its_typical_size(name: str):
    effect = EFFECTS.get(name)
    assert effect.plausible(tuple(p.typical for p in effect.sized(SHIP.L)), SHIP)
