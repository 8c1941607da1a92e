"""Order of the effects of a model, and what one effect states and two know."""

from __future__ import annotations

from dataclasses import fields
from importlib.metadata import EntryPoint
from itertools import combinations, permutations

import numpy as np
import pytest

from shipbench import registry
from shipbench.effects.base import EFFECTS, Effect, aliases_of, flow_first
from shipbench.effects.traits import Traits
from shipbench.estimation.term import Term
from shipbench.physics.hull import HullFactors
from shipbench.physics.mmg import load_mmg_ship
from shipbench.physics.modifiers import Flow, Modifiers
from shipbench.ship import complete
from shipbench.simulate.hidden import Hidden, sail

SHIP = load_mmg_ship("container130")
PARTICULARS = complete(SHIP.particulars)
MOTION = Flow(x=20.0, y=-60.0, t=30.0, psi=0.7, u=4.0, v=-0.5, r=0.01, n=90.0, delta=0.3, F_b=2e4, F_s=-1e4)
FLOW = ("u_c", "v_c", "drift", "air_u", "air_v")
EVERY = [effect for effect in map(EFFECTS.get, EFFECTS.names()) if not effect.traits.wraps]
FORCES = [effect for effect in EVERY if effect.enters == "force"]


def hidden(effect: Effect) -> Hidden:
    """An effect of about its typical size, with no value of zero."""
    return Hidden(effect, tuple(p.typical or 0.1 for p in effect.sized(130.0)))


def modifiers(items: list[Hidden]) -> dict[str, float]:
    """Fields after all items in the order of `flow_first`, those of the hull among them."""
    e = Modifiers()
    for item in flow_first(items):
        item.effect.force(e, MOTION, item.q, PARTICULARS)
    own = {f.name: getattr(e, f.name) for f in fields(Modifiers) if f.name != "hull"}
    return own | {f"hull.{f.name}": getattr(e.hull, f.name) for f in fields(HullFactors)}


@pytest.mark.parametrize("effect", EVERY, ids=lambda effect: effect.name)
def test_an_effect_that_writes_the_flow_states_it(effect: Effect):
    found = modifiers([hidden(effect)])
    assert effect.moves_flow == any(found[name] != 0.0 for name in FLOW)


@pytest.mark.parametrize("effect", FORCES, ids=lambda effect: effect.name)
def test_the_order_in_which_two_forces_are_given_does_not_matter(effect: Effect):
    """In all forms in which they are fitted."""
    for other in FORCES[FORCES.index(effect) + 1 :]:
        for form in (effect, *effect.fitted(130.0)):
            for beside in (other, *other.fitted(130.0)):
                pair = [hidden(form), hidden(beside)]
                assert modifiers(pair) == pytest.approx(modifiers(pair[::-1]), rel=1e-12, abs=0.0), other.name


@pytest.mark.parametrize(
    "names",
    [*combinations([effect.name for effect in FORCES if effect.family == "environment"], 2)],
    ids="-".join,
)
def test_a_ship_sails_the_same_in_two_environments_in_either_order(names: tuple[str, str]):
    s0, U = np.zeros((1, 10)), np.zeros((1, 10, 4))
    s0[0, 3], s0[0, 6], U[..., 0], U[..., 1], wind = 4.0, 90.0, 90.0, 0.3, np.full((1, 10, 2), 5.0)
    one, other = (
        sail(SHIP, s0, U, 1.0, [hidden(EFFECTS.get(name)) for name in order], wind, 1.0)
        for order in (names, names[::-1])
    )
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("names", [*permutations(("change", "cross_flow_drag", "bank_suction"))])
def test_what_sets_the_water_in_motion_comes_first(names: tuple[str, ...]):
    """A current that begins with a run, too."""
    begins = EFFECTS.get("change_point").of(EFFECTS.get("current"), from_time=10.0)
    items = [Term(begins if name == "change" else EFFECTS.get(name), ()) for name in names]
    assert flow_first(items)[0].effect is begins


# --- confounded effects


def test_aliases_of_the_library():
    assert {effect.name: found for effect in EVERY if (found := aliases_of(effect.name))} == {
        "mass_change": ("thrust_gain",), "thrust_gain": ("mass_change",),
    }  # fmt: skip


class Stranger(Effect):
    """A plug-in's effect that is confounded with one of the library and one that is not installed."""

    family = "hull"
    parameters = EFFECTS.get("mass_change").parameters
    traits = Traits(aliases=("mass_change", "not_installed"))


STRANGER = Stranger()
STRANGER.name = "stranger"


def test_an_effect_of_the_library_knows_the_alias_that_a_plug_in_states(monkeypatch):
    point = EntryPoint("stranger", f"{__name__}:STRANGER", "shipbench.effects")
    monkeypatch.setattr(registry, "scanned", lambda group: (point,) if group == point.group else ())
    assert aliases_of("stranger") == ("mass_change",)
    assert aliases_of("mass_change") == ("stranger", "thrust_gain")
    assert aliases_of("not_installed") == ()
