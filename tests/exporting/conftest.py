"""Fitted models to export: two fits, and copies of them with effects of given values."""

from __future__ import annotations

import copy

import pytest

from shipbench.contract.small import small_harbour
from shipbench.estimation.extension import extension_of
from shipbench.predictors.base import make_predictor, parse_spec
from shipbench.signals import COMMANDS


@pytest.fixture(scope="session")
def made():
    """Makes a fitted model: `made("physics+current[speed=0.4,to=1]", wind=True)`; all values of effects are given."""
    kept = {}

    def make(spec: str, wind: bool = False, commanded: bool = False):
        base, *effects = spec.split("+")
        key = (base, wind)
        if key not in kept:
            inputs = (*COMMANDS, "depth", "wind_speed", "wind_from") if wind else COMMANDS
            runs = small_harbour(num=4, horizon=20, inputs=inputs)
            text = {"physics": "physics[iterations=2]", "calibrated": "calibrated[refine=false]"}[base]
            kept[key] = make_predictor(parse_spec(text)).fit(runs, seed=0)
        model = copy.copy(kept[key])
        model.commanded = commanded
        if effects:
            model.extension = extension_of(parse_spec(f"physics+{'+'.join(effects)}").effects)
            if base == "calibrated" and not commanded:
                model.gears = dict(model.gears)
                for active in model.extension.active("gear"):
                    active.effect.gear(model.gears, active.q)
        return model

    return make


@pytest.fixture
def saved(made, tmp_path):
    """Saves a model of `made` and returns its folder."""

    def save(*args, **options) -> str:
        made(*args, **options).save(tmp_path / "model")
        return str(tmp_path / "model")

    return save
