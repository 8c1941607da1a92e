"""What a diagnosis asks of one effect and not of another stands with the effect: algorithms know no names."""

from __future__ import annotations

import ast
import dataclasses
from pathlib import Path

import pytest

import shipbench
from shipbench.effects.base import EFFECTS, Effect, having, searched_by
from shipbench.effects.traits import SEARCHES, Traits

PACKAGE = Path(shipbench.__file__).parent
GENERIC = {"current", "wind", "list"}
"""Names of effects that are words of their own: a group of channels, a command."""
FILES = [
    p
    for folder in (
        "bench",
        "checking",
        "data",
        "diagnosis",
        "estimation",
        "importing",
        "leaderboard",
        "predictors",
        "reports",
        "simulate",
    )
    for p in sorted((PACKAGE / folder).rglob("*.py"))
]


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_algorithm_knows_the_name_of_an_effect(path: Path) -> None:
    names = set(EFFECTS.built_in()) - GENERIC
    texts = [
        node
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]
    assert not {f"{node.lineno}: {node.value}" for node in texts if node.value in names}


@pytest.mark.parametrize("name", EFFECTS.names())
def test_traits_are_consistent(name: str) -> None:
    effect, traits = EFFECTS.get(name), EFFECTS.get(name).traits
    assert traits.search in SEARCHES
    assert {*traits.aliases, *traits.imitates} <= set(EFFECTS.names())
    for other in traits.aliases:
        assert name not in EFFECTS.get(other).traits.aliases, "one of the two states it"
    for other in traits.imitates:
        of = EFFECTS.get(other)
        assert type(of).normal is not Effect.normal, "what is imitated has a normal"
        assert effect.vector is not None
    assert bool(traits.gear_field) == (not traits.wraps and effect.enters == "gear")
    assert traits.least_size >= Traits().least_size


@pytest.mark.parametrize("search", ["hull", "change", "units"])
def test_what_has_a_search_of_its_own_is_one_effect(search: str) -> None:
    assert len(searched_by(search)) == 1


def test_effects_with_a_trait_come_by_family_and_name() -> None:
    assert [effect.name for effect in having("ordinary")] == ["race_gain", "wake_variation", "thruster_speed_loss"]
    assert {effect.family for effect in having("on_card")} == {
        "environment", "rudder", "propulsion", "thruster", "hull",
    }  # fmt: skip
    for effect in having("ordinary"):
        centre, spread = effect.traits.ordinary
        assert spread > 0.0
        assert effect.parameters[0].low < centre < effect.parameters[0].high


def test_every_trait_is_used_by_an_effect() -> None:
    for field in dataclasses.fields(Traits):
        assert any(getattr(EFFECTS.get(name).traits, field.name) != field.default for name in EFFECTS.names()), (
            field.name
        )
