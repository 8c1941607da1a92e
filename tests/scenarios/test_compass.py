"""A compass that is off by a constant, with velocities of a log or of satellites, which the same compass turned into
the ship's axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.diagnose import diagnose
from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import PSI, STATES, U, V
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials


def trials(ship: str, runs: int = 24) -> Dataset:
    plan = Trials(runs=runs)
    return (
        published_trials(PUBLISHED[ship], 5015, (), plan)
        if ship in PUBLISHED
        else sea_trials(load_mmg_ship(ship), 5, (), plan)
    )


def read_by(data: Dataset, bias: float, velocities: bool) -> Dataset:
    """The runs by a compass that reads too much by `bias` [rad]; velocities: over ground from satellites, in its
    axes."""

    def turned(states: np.ndarray) -> np.ndarray:
        states = states.copy()
        states[:, PSI] += bias
        if velocities:
            c, s, u, v = np.cos(bias), np.sin(bias), states[:, U].copy(), states[:, V].copy()
            states[:, U], states[:, V] = c * u + s * v, c * v - s * u
        return states

    return data.with_runs([replace(run, states=turned(run.states)) for run in data.runs])


def test_the_track_agrees_with_velocities_that_the_compass_turned():
    """Their vector in the earth's axes stays; the effect says the same as the compass does."""
    S = np.random.default_rng(0).standard_normal((2, 5, 10))
    effect, bias = EFFECTS.get("heading_bias"), 0.05
    for velocities in (False, True):
        out = effect.measure(S, (bias, float(velocities)), 1.0)
        earth, recorded = ((X[..., U] + 1j * X[..., V]) * np.exp(1j * X[..., PSI]) for X in (S, out))
        np.testing.assert_allclose(recorded, earth * (1.0 if velocities else np.exp(1j * bias)), atol=1e-12)
        np.testing.assert_allclose(out[..., PSI], S[..., PSI] + bias)
        others = [i for i in range(len(STATES)) if i not in (PSI, U, V)]
        np.testing.assert_array_equal(out[..., others], S[..., others])
    np.testing.assert_array_equal(effect.measure(S, (bias,), 1.0), effect.measure(S, (bias, 0.0), 1.0))


CASES = [("kcs", 3.0, True, 12)] + [
    pytest.param(ship, degrees, velocities, 24, marks=pytest.mark.long)
    for ship in ("kcs", "container130", "mariner")
    for degrees in (1.5, -3.0, 5.0)
    for velocities in (False, True)
]


@pytest.mark.long
@pytest.mark.parametrize(("ship", "degrees", "velocities", "runs"), CASES)
def test_a_compass_error_is_named_in_either_form_and_nothing_else_is(
    ship: str, degrees: float, velocities: bool, runs: int
):
    """With the velocities it was a list of 12 degrees, and the ship file in doubt."""
    found = diagnose(read_by(trials(ship, runs), np.deg2rad(degrees), velocities), gain=False)
    assert ([c.effect for c in found.causes], found.unknown) == (["heading_bias"], None)
    parameters = found.causes[0].parameters
    low, high = np.rad2deg(parameters["bias"].ci95)
    assert low < degrees < high < low + 1.0
    assert parameters["turned_velocities"].value == float(velocities)
