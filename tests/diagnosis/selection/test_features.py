"""The forms of an unexplained force, evaluated at every step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.selection.features import Feature, of_forces, of_sensors
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import start
from shipbench.estimation.linearisation import Linearisation, Scales
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.trials import Trials, sea_trials


def _features(plant: Plant) -> tuple[dict[str, list[Feature]], Linearisation]:
    lin = Linearisation(plant, Scales(plant), start(plant)[0], plant.seg.states[..., :6].copy())
    lin.columns()
    return of_forces(lin), lin


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant.of(sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=6, samples=80)))


@pytest.mark.parametrize("of", [of_forces, of_sensors])
def test_every_feature_is_of_order_one_over_the_samples_that_are_there(plant, of):
    found = of(_features(plant)[1])
    for variable, forms in found.items():
        for form in forms:
            real = plant.seg.mask[:, -form.on.shape[1] :].T
            assert np.sqrt(np.mean(form.on[:, real] ** 2, axis=1)) == pytest.approx(np.ones(form.size)), (
                variable,
                form.form,
            )
            if variable in ("heading", "position", "run"):
                assert np.abs(form.on[:, real].mean(axis=1)).max() < 1e-9


def test_errors_of_sensors_follow_the_samples(plant):
    found = of_sensors(_features(plant)[1])
    (turn,) = (f for f in found["yaw rate"] if f.form == "r")
    assert turn.on.shape == (1, plant.steps + 1, len(plant.seg.run))
    assert np.corrcoef(turn.on[0].T[plant.seg.mask], plant.seg.states[plant.seg.mask][:, 5])[0, 1] > 0.99


def test_what_changes_its_sign_with_the_mirror_image_is_odd(plant):
    found, _ = _features(plant)
    odd = {
        f.form
        for v in ("speed", "sway velocity", "yaw rate", "rudder", "revolutions", "revolutions and rudder")
        for f in found[v]
        if f.odd
    }
    assert odd == {"v", "v|v|", "r", "r|r|", "delta", "delta|delta|", "n delta", "n|n| delta"}


def test_features_are_what_their_names_say_between_the_knots_too(plant):
    found, lin = _features(plant)
    (form,) = (f for f in found["revolutions and rudder"] if f.form == "n|n| |delta|")
    act, _ = plant.midway(plant.path)
    n, delta = act[..., 0], act[..., 1]
    expected = n * np.abs(n) * np.abs(delta)
    assert np.corrcoef(form.on[0].ravel(), expected.ravel())[0, 1] == pytest.approx(1.0)
    assert np.array_equal(form.on, form.aside)  # rudder and revolutions are the same beside the trajectory
    (speed,) = (f for f in found["speed"] if f.form == "u")
    moved = lin.turn == 3
    assert (speed.aside - speed.on)[0][moved] == pytest.approx(
        lin.away[moved] * np.median(speed.on[0] / lin.middle[0, ..., 3])
    )


def test_periods_are_told_in_seconds_of_this_ship_and_one_is_near_to_any(plant):
    found, _ = _features(plant)
    slow, of_waves = (
        [float(f.form.split()[4]) for f in found[variable] if f.form.startswith("cos")]
        for variable in ("time", "waves")
    )
    assert min(slow) > 1.8 * plant.c.L**0.5 > max(of_waves)
    periods = slow + of_waves
    longest = plant.seg.dt * plant.steps
    assert periods[0] == pytest.approx(longest, rel=0.01)
    assert periods[-1] == pytest.approx(8.0 * plant.froude, rel=0.01)
    assert np.max(np.diff(longest / np.array(periods))) < 0.55  # cycles in the longest run: half of one and rounding


def test_thrusters_that_are_not_used_are_not_looked_at(plant):
    assert "thrusters" not in _features(plant)[0]
    assert (
        "thrusters"
        in _features(Plant.of(sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=4, samples=40))))[0]
    )


@pytest.mark.parametrize("blows", [True, False])
def test_a_measured_wind_pushes_only_where_it_blows_and_abeam_to_one_side(blows: bool):
    """What air at rest does is a resistance: none of these forms follows it."""
    data = sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=6, samples=80, wind=(6.0, -5.0)), wind_recorded=True)
    if not blows:
        data = data.with_runs(
            [replace(run, inputs=run.inputs * (np.array(run.inputs_names) != "wind_speed")) for run in data.runs]
        )
    forms = _features(Plant.of(data))[0]["measured wind"]
    assert [f.form for f in forms if np.any(f.on)] == ([f.form for f in forms] if blows else [])
    if blows:
        assert {f.form for f in forms if f.odd} == {"V^2 sin(gamma)", "V^2 sin(2 gamma)"}


def test_without_a_measured_wind_no_force_follows_it(plant):
    assert "measured wind" not in _features(plant)[0]
