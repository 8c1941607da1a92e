"""What most users have: a trial and main dimensions, or commands without the places of the actuators; and ships that go
astern for long."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.diagnose import diagnose
from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.ship import Ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.ships import draw_ship

CURRENT = Hidden(EFFECTS.get("current"), (0.25, -0.2))


def trials(*hidden: Hidden, ship: str = "kcs", **plan: int) -> Dataset:
    return sea_trials(load_mmg_ship(ship), 17, hidden, Trials(**{"runs": 16, "samples": 100, **plan}))


def with_main_dimensions_alone(data: Dataset) -> Dataset:
    own = data.ship
    return replace(data, ship=Ship(name=own.name, L=own.L, B=own.B, T=own.T, displacement=own.displacement))


def with_commands_alone(data: Dataset) -> Dataset:
    runs = [replace(run, states=np.concatenate([run.states[:, :6], run.inputs[:, :4]], axis=1)) for run in data.runs]
    return replace(data.with_runs(runs), actuators="commanded")


@pytest.mark.long
@pytest.mark.parametrize(
    ("ship", "known"),
    [
        ("kcs", with_main_dimensions_alone), ("kvlcc2_l7", with_main_dimensions_alone),
        ("kvlcc2_l7", with_commands_alone),
        pytest.param("kcs", with_commands_alone, marks=pytest.mark.long),
    ],
)  # fmt: skip
def test_nothing_is_named_where_nothing_is_hidden(ship, known):
    verdict = diagnose(known(trials(ship=ship)), gain=False)
    assert (verdict.verdict, [c.effect for c in verdict.causes]) == ("none", [])


@pytest.mark.long
@pytest.mark.parametrize(
    "known", [with_main_dimensions_alone, pytest.param(with_commands_alone, marks=pytest.mark.long)]
)
def test_a_current_is_found_with_its_size(known):
    verdict = diagnose(known(trials(CURRENT)), gain=False)
    assert [c.effect for c in verdict.causes] == ["current"]
    assert verdict.causes[0].parameters["speed"].value == pytest.approx(np.hypot(0.25, 0.2), rel=0.1)


@pytest.mark.long
def test_a_warning_says_how_far_off_an_estimated_propeller_is():
    full, bare = trials(), with_main_dimensions_alone(trials())
    assert not diagnose(full, gain=False).warnings
    (warning,) = diagnose(bare, gain=False).warnings
    assert warning.startswith("the ship file does not give the propeller's diameter, kt: the runs suggest ")


@pytest.mark.long
def test_a_ship_that_goes_astern_for_long_has_nothing_missing():
    """Six minutes astern in one run of six: the rudder works from its trailing edge, the hull the other way round."""
    data = sea_trials(draw_ship(np.random.default_rng(77), "test", False), 40, (), Trials(runs=6, samples=600))
    assert np.mean(data.runs[5].states[:, 3] < 0.0) > 0.5
    verdict = diagnose(data, gain=False)
    assert (verdict.verdict, verdict.causes, verdict.warnings) == ("none", (), ())


@pytest.mark.long
@pytest.mark.parametrize(("typical", "named"), [(0.045, False), (0.1, True)])
def test_what_is_certain_but_tiny_is_not_named(typical: float, named: bool):
    """Exact sensors in a calm see a gyro that is 0.1 deg off."""
    bias = EFFECTS.get("heading_bias")
    verdict = diagnose(
        trials(Hidden(bias, (typical * bias.parameters[0].typical,)), runs=8, noise=0, gusts=0), gain=False
    )
    (line,) = (c for c in verdict.candidates if c.effect == "heading_bias")
    assert line.score > 30.0
    assert ("not practically significant" in line.rejected_because, [c.effect for c in verdict.causes]) == (
        not named,
        ["heading_bias"] if named else [],
    )
    assert line.detectable["bias"] >= 0.05 * bias.parameters[0].typical
