"""Clean data sets for `shipbench suite check`, from simulators that differ in structure: faults are planted into some,
the others must have no finding."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from ...data import harbour90, harbour90_noisy
from ...effects.base import EFFECTS, Effect
from ...physics.mmg import MMGShip, load_mmg_ship
from ...records import Dataset, Run
from ...ship import complete
from ...simulate.fitted_ship import fitted_trials
from ...simulate.hidden import Hidden
from ...simulate.trials import Trials, sea_trials

SHIPS = ("container130", "kcs", "kvlcc2_l7")
EQUATION, HARBOUR = "eq. (2)", "harbour90_noisy"
SOURCES = (*SHIPS, EQUATION, HARBOUR)
"""Sea trials of three MMG ships of 130, 230 and 7 m; sea trials of drawn hulls of the fitted model, on container130;
port manoeuvres."""
_WINDY = Trials(gusts=2.0, wind=(-8.0, 9.0))
_CALM = Trials(noise=0.0, gusts=0.0)
_CALM_SETS = 3
_STEPS = {
    "instruments": (0.2, 0.2, np.deg2rad(0.1), 0.05, 0.05, np.deg2rad(0.1 / 60.0), 1.0),
    "a display": (0.2, 0.2, np.deg2rad(1.0), 0.05, 0.05, np.deg2rad(1.0 / 60.0), 1.0),
}
"""Resolution of x, y, psi, u, v, r, n on a ship of 130 m: positions in 0.0001', speeds in 0.1 kn."""
_NOT_HIDDEN = ("going_astern", "wind_drift")
"""Effects that are not hidden in these sets, so that published results stay comparable."""


@lru_cache(maxsize=32)
def base_set(source: str, seed: int, wind: bool = False) -> Dataset:
    """Clean set into which a fault is planted; wind: in a gale that is recorded, of an MMG ship only."""
    if source == EQUATION:
        return fitted_trials(load_mmg_ship(SHIPS[0]), seed)
    if source == HARBOUR:
        return replace(harbour90_noisy.make(seed), simulation=None)
    return _windy(source, seed) if wind else sea_trials(load_mmg_ship(source), seed)


def sources_of(wind: bool) -> tuple[str, ...]:
    """Sources of sets for a fault that needs recorded wind, or does not."""
    return SHIPS if wind else SOURCES


def _windy(name: str, seed: int) -> Dataset:
    """Trials in a recorded gale, of a ship that has its area above water (the published KCS and KVLCC2 models have
    none)."""
    ship = load_mmg_ship(name)
    areas = complete(ship.particulars)
    return sea_trials(replace(ship, A_F=areas.A_F, A_L=areas.A_L), seed, (), _WINDY, wind_recorded=True)


def clean_sets(seeds: Sequence[int]) -> Iterator[tuple[str, Callable[[], Dataset]]]:
    """Pairs (kind, maker) of sets without faults.

    Trials of MMG ships in gusts, the same with strong wind recorded, without any noise, and under every effect that is
    no sensor's; trials of the fitted model; port manoeuvres with and without noise; some of these with the resolution
    of instruments and displays.
    """
    for name in SHIPS:
        ship = load_mmg_ship(name)
        for seed in seeds:
            yield "MMG ships, noise and gusts", partial(sea_trials, ship, seed)
            yield "MMG ships, wind recorded", partial(_windy, name, seed)
            yield "fitted model, noise and gusts", partial(fitted_trials, ship, seed)
        for seed in seeds[:_CALM_SETS]:
            yield "MMG ships, no noise, calm", partial(sea_trials, ship, seed, (), _CALM)
        for i, effect in enumerate(
            name for name in EFFECTS.built_in() if name not in _NOT_HIDDEN
        ):  # nor may a plug-in renumber the published cases
            part = EFFECTS.get(effect)
            if part.family not in ("sensor", "time"):
                yield "MMG ships under real effects", partial(_with_effect, ship, seeds[i % len(seeds)], part)
    for seed in seeds:
        for make in (harbour90.make, harbour90_noisy.make):
            yield "port manoeuvres", partial(make, seed)
    for seed in seeds[:_CALM_SETS]:
        for steps in _STEPS.values():
            for name in SHIPS:
                for trials in (Trials(), _CALM):
                    yield (
                        "MMG ships, rounded",
                        partial(_rounded, partial(sea_trials, load_mmg_ship(name), seed, (), trials), steps),
                    )
            for make in (harbour90.make, harbour90_noisy.make):
                yield "port manoeuvres, rounded", partial(_rounded, partial(make, seed), steps)


def _rounded(make: Callable[[], Dataset], steps: Sequence[float]) -> Dataset:
    """Data set with the resolution of instruments or displays: in steps of lengths, angles and times of the ship's
    size."""
    data = make()
    L = data.ship.L / 130.0
    step = np.array(steps) * L ** np.array([1.0, 1.0, 0.0, 0.5, 0.5, -0.5, -0.5])

    def coarse(run: Run) -> Run:
        return replace(run, states=np.hstack([np.round(run.states[:, :7] / step) * step, run.states[:, 7:]]))

    return data.with_runs([coarse(run) for run in data.runs])


def _with_effect(ship: MMGShip, seed: int, effect: Effect) -> Dataset:
    """Trials under an effect of its typical size."""
    parameters = [p.for_length(ship.L) for p in effect.parameters]
    shaped = any(p.shape for p in parameters)
    settings = (
        effect.settings(sea_trials(ship, seed).runs[0].states[:, :2], complete(ship.particulars)) if shaped else [()]
    )
    shapes = iter(settings[0])
    q = tuple(next(shapes) if p.shape else p.typical for p in parameters)
    return sea_trials(ship, seed, (Hidden(effect, q),), name=f"{ship.name} {effect.name}")
