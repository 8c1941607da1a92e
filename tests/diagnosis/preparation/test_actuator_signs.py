"""Rudder and thrusters recorded to the other side, told by the fit of the plain model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_fit

from shipbench.checking.units import check_units, corrected, merged
from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.preparation import actuator_signs as turned
from shipbench.diagnosis.preparation.actuator_signs import turned_actuators
from shipbench.diagnosis.selection.analysis import plain_model
from shipbench.effects.base import EFFECTS
from shipbench.estimation.forward import Plant
from shipbench.estimation.laplace import Fit
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import DELTA, F_B, F_S, STATES
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.cases import UNITS, draw_case, misread

PLAN = Trials(runs=12)


def found(data: Dataset) -> dict[str, float]:
    return {f.channel: f.factor for f in turned_actuators(data, plain_model(Plant.of(data)))}


def port_trials(seed: int, *hidden: Hidden) -> Dataset:
    return sea_trials(load_mmg_ship("container130"), seed, hidden, PLAN)


@pytest.mark.long
def test_a_rudder_to_port_is_told_where_turns_are_too_few_for_kinematics():
    error = next(i for i, item in enumerate(UNITS) if item[0] == "rudder to port")
    whole = draw_case("unit", error, 0).dataset()
    data = whole.with_runs(whole.runs[:12])
    assert check_units(data) == []
    result = diagnose(data, gain=False)
    assert result.verdict == "found"
    assert [(c.effect, list(c.parameters)) for c in result.causes] == [
        ("unit_or_sign_error", ["delta_factor"]), ("unit_or_sign_error", ["delta_c_factor"]),
    ]  # fmt: skip
    assert "lift of the rudder falls with its angle" in result.causes[0].evidence


@pytest.mark.parametrize("name", PUBLISHED)
@pytest.mark.long
def test_so_it_is_on_ships_in_other_equations_and_read_rightly_there_is_nothing(name: str):
    data = published_trials(PUBLISHED[name], 2, (), PLAN)
    assert found(data) == {}
    assert found(misread(data, (DELTA,), -1.0)) == {"delta": -1.0, "delta_c": -1.0}


@pytest.mark.long
@pytest.mark.parametrize("channels", [(F_B,), (F_S,), (F_B, F_S)], ids=["bow", "stern", "both"])
def test_thrusters_to_port_are_told(channels: tuple[int, ...]):
    wanted = {STATES[c] + end: -1.0 for c in channels for end in ("", "_c")}
    assert found(misread(port_trials(4), channels, -1.0)) == wanted


@pytest.mark.long
@pytest.mark.parametrize("as_recorded", [0.0, 54.0])
def test_thrusters_are_not_turned_for_another_rest_of_the_fit(monkeypatch, as_recorded: float):
    """Of four runs a fit took swell for noise of the sway velocity; read to the other side, for forces, 54 better; as
    recorded with those, too."""
    data = port_trials(4)
    null = plain_model(Plant.of(data))
    pushed = float(np.sum(null.plant.seg.states[..., [F_B, F_S]] * [1.0, 0.3]))

    def first(plant: Plant, null: Fit, like: Fit | None = None) -> Fit:
        as_they_are = np.isclose(np.sum(plant.seg.states[..., [F_B, F_S]] * [1.0, 0.3]), pushed)
        return made_fit(log_evidence=54.0 if not as_they_are else as_recorded if like is not None else 0.0)

    monkeypatch.setattr(turned, "first_fit", first)
    assert bool(turned_actuators(data, null)) is (as_recorded == 0.0)


@pytest.mark.long
@pytest.mark.parametrize("size", [-0.6, pytest.param(0.6, marks=pytest.mark.long)])
def test_weak_or_strong_thrusters_are_not_to_port(size: float):
    assert found(port_trials(4, Hidden(EFFECTS.get("thruster_gain"), (size,)))) == {}


@pytest.mark.long
def test_an_order_that_was_blamed_for_its_actuator_is_cleared():
    data = port_trials(4)
    alone = data.with_runs(
        replace(run, states=np.where(np.arange(10) == F_B, -run.states, run.states)) for run in data.runs
    )
    blamed = check_units(alone)
    assert [(f.channel, f.factor) for f in blamed] == [("F_b_c", -1.0)]
    data = corrected(alone, blamed)
    both = merged([*blamed, *turned_actuators(data, plain_model(Plant.of(data)))])
    assert [(f.channel, f.factor) for f in both] == [("F_b", -1.0)]
