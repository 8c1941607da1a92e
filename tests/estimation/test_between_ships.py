"""Differences between ordinary ships and eq. (2)."""

from __future__ import annotations

import pytest

from shipbench.estimation.between_ships import STRUCTURE
from shipbench.physics import eq2
from shipbench.physics.modifiers import Flow, Modifiers


@pytest.mark.parametrize("u", [2.0, -2.0])
def test_ordinary_differences_have_a_value_at_which_eq_2_is_alone(plant, u):
    """Astern, too, where the race does not reach the rudder and hull and rudder have parameters of their own."""
    flow = Flow(*([0.0] * 4), u, 0.3, 0.01, -60.0, 0.2, 0.0, 0.0)
    found, alone = Modifiers(), Modifiers()
    STRUCTURE.force(
        found,
        flow,
        tuple(p.typical * v for p, v in zip(STRUCTURE.parameters, STRUCTURE.plain(), strict=True)),
        plant.ship,
    )
    p = (0.0,) + (1e3,) * 3 + (1.0,) * 7
    changed, usual = (
        eq2.accelerations(u, 0.3, 0.01, -60.0, 0.2, 0.0, 0.0, None, plant.c, p, m) for m in (found, alone)
    )
    assert changed == pytest.approx(usual, rel=1e-9)


def test_a_reversed_propeller_stops_the_flow_at_the_rudder_with_headway_alone(plant):
    def of(u, name, value):
        mods = Modifiers()
        values = [value * p.typical * (p.name == name) for p in STRUCTURE.parameters]
        STRUCTURE.force(mods, Flow(*([0.0] * 4), u, 0.3, 0.01, -60.0, 0.2, 0.0, 0.0), values, plant.ship)
        return mods

    assert of(2.0, "race", 1.0).race > of(2.0, "race", 0.0).race
    assert (
        of(-2.0, "race", 1.0).race == of(2.0, "race", 1.0).race
    )  # the flow has a sign: what drives ahead meets sternway there
    assert of(2.0, "backing", 1.0).backing > of(2.0, "backing", 0.0).backing > of(-2.0, "backing", 1.0).backing == 0.0
    assert of(-2.0, "N_v_astern", 1.0).hull.N_v < of(-2.0, "N_v_astern", 0.0).hull.N_v < 0.0
    assert of(2.0, "N_v_astern", 1.0).hull.N_v == pytest.approx(1.0, abs=0.02)
