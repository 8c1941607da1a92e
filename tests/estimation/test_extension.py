"""Physics extended by effects in a model spec: what was hidden in MMG data is found, saved, printed and run."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from every_day import every
from typer.testing import CliRunner

from shipbench.data.files import write_dataset
from shipbench.effects.base import EFFECTS
from shipbench.errors import InputError
from shipbench.estimation import extension as effects
from shipbench.physics.mmg import load_mmg_ship
from shipbench.predictors.base import make_predictor, parse_spec
from shipbench.predictors.physics import Physics
from shipbench.predictors.physics_model.effects_fit import _Extended
from shipbench.predictors.physics_model.fit import Data
from shipbench.records import Dataset, Run
from shipbench.ship import complete
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.ships import scaled

SHIP = load_mmg_ship("container130")


@cache
def trials(seed: int, *hidden: tuple[str, tuple[float, ...]], runs: int = 12, samples: int = 80) -> Dataset:
    causes = [Hidden(EFFECTS.get(name), q) for name, q in hidden]
    return sea_trials(SHIP, seed, causes, Trials(runs=runs, samples=samples))


def fitted(spec: str, data: Dataset) -> Physics:
    return make_predictor(parse_spec(spec)).fit(data)


def values(model: Physics) -> tuple[float, ...]:
    assert model.extension is not None
    return model.extension.values[0]


def rollout_error(model: Physics, data: Dataset, channels: slice = slice(0, 2)) -> float:
    batch = data.batch()
    return float(np.sqrt(np.mean((model.predict(batch.s0, batch.U) - batch.truth)[..., channels] ** 2)))


def commanded(data: Dataset) -> Dataset:
    runs = (Run(r.id, r.t, np.concatenate([r.states[:, :6], r.inputs], axis=1), r.inputs) for r in data.runs)
    return replace(data, actuators="commanded", runs=tuple(runs))


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_a_hidden_current_is_found_and_the_rollouts_gain_on_runs_not_fitted(seed):
    hidden = ("current", (0.3, -0.25))
    data, unseen = trials(seed, hidden), trials(seed + 100, hidden)
    plain, extended, hull = (
        fitted(s, data) for s in ("physics", "physics+current", "physics+current+hull_derivatives")
    )
    np.testing.assert_allclose(
        values(extended), hidden[1], atol=0.3 * 0.39
    )  # eq. (2)'s hull is off by more than the current alone can make good
    np.testing.assert_allclose(values(hull), hidden[1], atol=0.2 * 0.39)
    assert rollout_error(extended, unseen) < 0.6 * rollout_error(plain, unseen)
    assert rollout_error(hull, unseen) < rollout_error(extended, unseen)


@pytest.mark.parametrize(
    "of", every(3, [("heading_bias", (-0.05, 0.0)), ("yaw_rate_bias", (0.003,)), ("speed_scale", (0.08,))])
)
def test_a_fault_of_a_sensor_is_found_within_a_fifth(of):
    name, q = of
    data, unseen = trials(2, (name, q)), trials(102, (name, q))
    plain, extended = fitted("physics", data), fitted(f"physics+{name}", data)
    np.testing.assert_allclose(values(extended), q, rtol=0.2)
    assert rollout_error(extended, unseen) < 0.95 * rollout_error(plain, unseen)


@pytest.mark.parametrize(
    ("name", "q"),
    [("rudder_delay", (2.5,)), ("rudder_lag", (4.0,)), ("rudder_backlash", (0.05,)), ("shaft_rate_limit", (1.0,))],
)
def test_a_gear_is_found_from_command_and_actuator(name, q):
    data = trials(1, (name, q))
    plain, extended = fitted("physics", data), fitted(f"physics+{name}", data)
    np.testing.assert_allclose(values(extended), q, rtol=0.1)
    channel = slice(6, 7) if name.startswith("shaft") else slice(7, 8)
    same_law = name in (
        "rudder_lag",
        "shaft_rate_limit",
    )  # the plain fit has a time constant and a rate limit too: the effect only names them
    assert rollout_error(extended, data, channel) < (1.001 if same_law else 0.7) * rollout_error(plain, data, channel)


@pytest.mark.long
def test_a_rudder_offset_in_data_of_the_models_own_structure_is_found_and_takes_the_place_of_p4():
    base = trials(3)
    truth = fitted("physics+rudder_offset[offset=0.05]", base)
    truth.p = np.array([0.02, 1e3, 7e3, 50.0, 0.0, 2.2, 0.0, -2.0, 0.03, 0.0, 1.2])
    batch = base.batch()
    S = np.concatenate([batch.s0[:, None], truth.predict(batch.s0, batch.U)], axis=1)
    data = base.with_runs(Run(r.id, r.t, S[i], r.inputs) for i, r in enumerate(base.runs))
    found = make_predictor(parse_spec("physics[iterations=40,tolerance=1e-9]+rudder_offset")).fit(data)
    np.testing.assert_allclose(values(found), 0.05, rtol=0.05)
    assert found.p[4] == 0.0
    assert "zero: rudder_offset" in found.describe()
    assert rollout_error(found, data) < 0.1


def test_a_rudder_offset_in_mmg_data_has_its_sign_and_lowers_the_cost():
    for sign in (1.0, -1.0):
        data = trials(2, ("rudder_offset", (sign * 0.05,)))
        plain, extended = fitted("physics", data), fitted("physics+rudder_offset+hull_derivatives", data)
        assert extended.extension is not None
        low, high = extended.extension.ci95[0]
        assert sign * low > 0
        assert sign * high > 0
        assert extended.cost < 0.8 * plain.cost


def test_a_rate_limit_is_found_in_the_motion_where_only_commands_are_recorded():
    data = commanded(trials(3, ("rudder_rate_limit", (0.02,)), samples=120))
    plain, extended = fitted("physics", data), fitted("physics+rudder_rate_limit", data)
    np.testing.assert_allclose(values(extended), 0.02, rtol=0.25)
    assert extended.cost < 0.85 * plain.cost
    batch = data.batch()
    np.testing.assert_array_equal(extended.predict(batch.s0, batch.U)[..., 6:], batch.U)


@pytest.mark.parametrize("spec", [
    "physics+current+heading_bias", "physics+rudder_delay+current[speed=0.3,to=1.0]",
    "physics+bank_suction[bearing=1.57,line=900]",
    "physics+change_point[effect=rudder_offset,time=30]+position_delay",
])  # fmt: skip
def test_saved_and_loaded_it_predicts_and_prints_the_same(spec, tmp_path):
    data = trials(4, runs=4, samples=40)
    model = fitted(spec, data)
    model.save(tmp_path / "m")
    loaded = make_predictor(parse_spec(str(tmp_path / "m")))
    batch = data.batch()
    np.testing.assert_array_equal(loaded.predict(batch.s0, batch.U), model.predict(batch.s0, batch.U))
    np.testing.assert_array_equal(loaded.predict(batch.s0[0], batch.U[0]), loaded.predict(batch.s0[:1], batch.U[:1])[0])
    assert loaded.describe() == model.describe()


def test_given_values_are_held_and_the_others_are_fitted():
    data = trials(4, runs=4, samples=40)
    held = fitted("physics+current[speed=0.3,to=1.0]+rudder_gain[gain=0.1]", data)
    np.testing.assert_allclose(values(held), [0.3 * np.cos(1.0), 0.3 * np.sin(1.0)])
    assert held.extension is not None
    assert held.extension.values[1] == (0.1,)
    assert np.isnan(held.extension.ci95).all()
    shape = values(fitted("physics+bank_suction[bearing=1.57,line=900]", data))
    assert shape[2:] == (1.57, 900.0, 0.0)
    assert shape[0] != 0.0
    chosen = values(fitted("physics+bank_suction", data))
    assert chosen[2:] in EFFECTS.get("bank_suction").settings(data.batch().truth[:, :, :2], complete(data.ship))


def test_a_change_within_the_run_acts_from_its_time_on():
    data = trials(4, runs=4, samples=40)
    model = fitted("physics+change_point[effect=current,time=20,speed=0.5,to=0]", data)
    before = fitted("physics", data)
    before.p = model.p
    batch = data.batch()
    late, never = model.predict(batch.s0, batch.U), before.predict(batch.s0, batch.U)
    np.testing.assert_allclose(
        late[:, :19], never[:, :19], rtol=1e-10, atol=1e-10
    )  # with and without effects: two codes
    assert np.abs(late - never)[:, 25:, 0].min() > 0.01


def test_the_plain_physics_keeps_no_trace_of_effects(tmp_path):
    model = fitted("physics", trials(4, runs=4, samples=40))
    model.save(tmp_path / "m")
    assert "effect" not in json.dumps(json.loads((tmp_path / "m" / "model.json").read_text()))
    assert "effect" not in model.describe()
    assert set(model._arrays()) == {"p", "ci95", "actuators"}


def test_the_columns_of_the_fit_are_the_finite_differences_of_the_predictions():
    data = trials(4, runs=3, samples=30)
    model = fitted("physics+current+antenna_offset+wind", data)
    batch = data.batch()
    assert model.extension is not None
    record = Data(model.c, batch, model.actuator_path(batch.s0, batch.U), None, model.dt, model.substeps)
    problem = _Extended(record, model.extension, model.particulars, lambda _: record.path, False)
    q = np.concatenate([model.p / problem.p_scale, [0.8, -0.4, 0.3, 0.6, 1.1, -0.5]])
    model.p, model.extension = problem.p_scale * q[:11], problem.extension_at(q)
    e, J = problem.linearise(q)
    np.testing.assert_allclose(e, (model.predict(batch.s0, batch.U) - batch.truth)[..., :6] * problem.weight, atol=1e-9)
    for i in range(len(q)):
        step = np.where(np.arange(len(q)) == i, 1e-4, 0.0)
        slope = (problem.residuals(q + step) - problem.residuals(q - step)) / 2e-4
        np.testing.assert_allclose(J[..., i], slope, atol=1e-3 * np.abs(slope).max())


@pytest.mark.parametrize("name", ["heading_bias", "yaw_rate_bias", "antenna_offset", "speed_scale", "position_delay"])
def test_the_start_behind_a_sensor_is_the_one_that_it_shows(name):
    effect = EFFECTS.get(name)
    sensors = [(effect, tuple(p.typical for p in effect.parameters)), (EFFECTS.get("heading_bias"), (0.1,))]
    s0 = trials(4, runs=4, samples=40).batch().s0
    start = effects.true_start(s0, sensors, 1.0)
    heading, u, v = start[:, 2], start[:, 3], start[:, 4]
    ahead = start.copy()
    ahead[:, 0] += u * np.cos(heading) - v * np.sin(heading)
    ahead[:, 1] += u * np.sin(heading) + v * np.cos(heading)
    ahead[:, 2] += start[:, 5]
    np.testing.assert_allclose(effects.measured(np.stack([start, ahead], axis=1), sensors, 1.0)[:, 0], s0, atol=1e-6)
    assert np.abs(start - s0).max() > 1e-4


@pytest.mark.parametrize(("spec", "message"), [
    ("hold+current", "effects extend 'physics' and 'neural_ode'"),
    ("physics+currant", "unknown effect 'currant'.*Did you mean 'current'"),
    ("physics+current+current", "named 2 times"),
    ("physics+current[sped=0.3]", "effect 'current' has no parameter 'sped'.*speed"),
    ("physics+current[speed=0.3]", "give both speed and to"),
    ("physics+rudder_offset[offset=two]", "accepted: a number"),
    ("physics+unit_or_sign_error", "dataset.toml"),
    ("physics+change_point", "needs an effect and the time"),
    ("physics+change_point[effect=rudder_lag,time=20]", "only forces can begin within a run"),
    ("physics+current[speed=0.3", "cannot be read"),
])  # fmt: skip
def test_a_faulty_spec_is_one_clear_message(spec, message):
    with pytest.raises(InputError, match=message):
        make_predictor(parse_spec(spec))


@pytest.mark.parametrize(("spec", "message"), [
    ("physics+rudder_lag[lag=-1]", r"'rudder_lag': lag = -1 s; accepted: 0 to 30 s on a ship of 130 m"),
    ("neural_ode+mass_change[share=-3]", r"share = -3; accepted: -0.5 to 1 on"),
    ("physics+current[speed=50,to=0]", r"north = 50 m/s; accepted: -6 to 6 m/s"),
])  # fmt: skip
def test_a_given_value_that_no_ship_has_is_refused_before_anything_is_fitted(spec, message):
    with pytest.raises(InputError, match=message):
        fitted(spec, trials(3, runs=6, samples=40))


def test_a_river_s_current_on_a_boat_is_within_what_may_be_found():
    """Currents and winds do not follow Froude's law: 1.8 m/s are a third of what a ship of 130 m may have, on a boat of
    25 m much of it."""
    boat, hidden = scaled(SHIP, 25.0), (1.3, -1.2)
    data = sea_trials(boat, 5, [Hidden(EFFECTS.get("current"), hidden)], Trials(runs=8, samples=60))
    np.testing.assert_allclose(values(fitted("physics+current", data)), hidden, rtol=0.15)


@pytest.mark.long
def test_it_runs_beside_the_plain_physics_on_the_command_line(tmp_path, undrawn):
    from shipbench.cli.app import app

    write_dataset(trials(3, ("current", (0.3, 0.3)), runs=6, samples=40), tmp_path / "tiny")
    specs = ["physics", "physics+current", "physics+current[speed=0.42,to=0.785]+rudder_delay"]
    models = [part for spec in specs for part in ("-m", spec)]
    command = [
        "run",
        *models,
        "-d",
        str(tmp_path / "tiny"),
        "--folds",
        "2",
        "--horizon",
        "40",
        "--out",
        str(tmp_path / "out"),
    ]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    for spec in specs:
        folder = tmp_path / "out" / "cells" / "trials" / spec / "fold0-seed0"
        assert (folder / "predictions.npz").is_file()
        assert parse_spec(str(folder / "model")).path == folder / "model"
    text = (tmp_path / "out" / "cells" / "trials" / "physics+current" / "fold0-seed0" / "equations.txt").read_text()
    assert "speed = " in text
    assert "m/s [" in text


@pytest.mark.parametrize("model", ["physics", "neural_ode"])
def test_an_effect_of_the_wind_is_skipped_where_no_wind_is_measured(model, harbour):
    refused = make_predictor(parse_spec(f"{model}+wind_coefficients")).skip(harbour)
    assert "wind_speed and wind_from" in refused
    assert make_predictor(parse_spec(f"{model}+current")).skip(harbour) is None
