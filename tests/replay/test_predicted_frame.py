"""A frame or unit that differs is told with its size, its cause and the line that corrects it; a right one is not."""

from __future__ import annotations

import numpy as np
import pytest
from made_tracks import apart, predicted, rows_of

from shipbench.predictors.predictions import Trajectory
from shipbench.replay.frame import frame_notes, prediction_notes
from shipbench.signals import STATES

FAULTS = {
    "degrees": (lambda t: t.assign(psi=np.rad2deg(t["psi"])), "angles in degrees", "psi = radians(psi)"),
    "left": (lambda t: t.assign(y=-t["y"], psi=-t["psi"], v=-t["v"], r=-t["r"]), "y to the left", "y = -y, psi = -psi"),
    "exchanged": (lambda t: t.assign(x=t["y"], y=t["x"]), "north and east exchanged", "x, y = y, x"),
    "mathematics": (
        lambda t: t.assign(x=t["y"], y=t["x"], psi=np.rad2deg(np.pi / 2 - t["psi"]), v=-t["v"], r=-t["r"]),
        "counterclockwise from east in degrees",
        "psi = pi/2 - radians(psi)",
    ),
    "origin": (lambda t: t.assign(x=t["x"] + 5000.0, y=t["y"] - 700.0), "another origin", "x = x -5000, y = y +700"),
    "knots": (lambda t: t.assign(u=t["u"] * 3600 / 1852), "knots", "u = u / 1.9438"),
}


@pytest.fixture
def data(toy):
    return apart(toy(runs=6, steps=40))


def notes_on(data, change):
    table = change(predicted(data, growth=0.1))
    pairs = [(Trajectory(0.0, rows_of(table, run.id).iloc[:, 2:].to_numpy()), run) for run in data.runs]
    return frame_notes(pairs, data.ship, data.dt)


@pytest.mark.parametrize("fault", FAULTS)
def test_the_cause_is_named_with_the_line_that_corrects_it(data, fault):
    change, cause, line = FAULTS[fault]
    [note] = notes_on(data, change)
    assert cause in note, note
    assert line in note, note


def test_the_frame_of_the_data_set_gives_no_note(data):
    assert notes_on(data, lambda t: t) == []
    assert frame_notes([], data.ship, data.dt) == []


def test_trajectories_that_all_begin_at_zero_are_told(data):
    def at_zero(table):
        first = table.groupby("trajectory")[["x", "y"]].transform("first")
        return table.assign(x=table["x"] - first["x"], y=table["y"] - first["y"])

    [note] = notes_on(data, at_zero)
    assert "each trajectory starts at x = y = 0" in note
    assert "x = x + x_start" in note


def test_what_no_usual_frame_explains_is_told_with_its_size(data):
    rng = np.random.default_rng(0)
    [turned] = notes_on(data, lambda t: t.assign(psi=t["psi"] + 2.0))
    assert "differ by 115 deg" in turned
    assert "No usual frame explains it" in turned
    [moved] = notes_on(
        data, lambda t: t.assign(x=t["x"] + t["trajectory"].map({r.id: rng.normal(0, 900) for r in data.runs}))
    )
    assert "No common origin explains it" in moved


def test_states_that_a_simulation_returns_are_told_apart_alike(data):
    S = np.stack([run.states[1:] for run in data.runs])
    assert prediction_notes(S, data.runs, data.ship, data.dt) == []
    S[..., 2] = np.rad2deg(S[..., 2])
    [note] = prediction_notes(S, data.runs, data.ship, data.dt)
    assert note.endswith("angles in degrees; correct the states that the simulation returns by psi = radians(psi).")


@pytest.mark.parametrize(
    ("name", "factor", "said"),
    [("n", 1 / 60, "rev/s"), ("delta", np.rad2deg(1.0), "deg"), ("delta", -1.0, "by delta = -delta.")],
)
def test_actuators_in_another_unit_are_told(harbour, name, factor, said):
    S = np.stack([run.states[1:] for run in harbour.runs])
    S[..., STATES.index(name)] *= factor
    [note] = prediction_notes(S, harbour.runs, harbour.ship, harbour.dt)
    assert said in note
    assert note.endswith(f"Check whether it takes {name}_c alike.")


def test_a_simulation_that_starts_at_zero_is_told(data):
    S = np.stack([run.states[1:] for run in data.runs])
    S[..., :2] -= np.stack([run.states[:1, :2] for run in data.runs])
    [note] = prediction_notes(S, data.runs, data.ship, data.dt)
    assert "starts at x = y = 0" in note


def test_noise_of_a_small_speed_is_no_other_unit(data):
    S = np.stack([run.states[1:] for run in data.runs[:1]])
    S[..., 4] = 1.94 * S[..., 4] + 0.01
    assert prediction_notes(S, data.runs[:1], data.ship, data.dt) == []


def test_turns_to_the_other_side_are_told_and_right_ones_are_not(harbour):
    S = np.stack([run.states[1:] for run in harbour.runs])
    assert prediction_notes(S, harbour.runs, harbour.ship, harbour.dt) == []
    S[..., 5] = 2.0 * S[:, :1, 5] - S[..., 5]
    [note] = prediction_notes(S, harbour.runs, harbour.ship, harbour.dt)
    assert "correlation -1.00 of the changes in 16 s" in note
    assert note.endswith("give it -delta_c.")
