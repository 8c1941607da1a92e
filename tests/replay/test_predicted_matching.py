"""Predicted trajectories find their runs: by id, by window id, by date, by start state; or the message says why not."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from made_tracks import apart, predicted, rows_of

from shipbench.errors import InputError
from shipbench.replay.matching import match_tracks, on_grid
from shipbench.replay.reading import Track, Tracks


@pytest.fixture
def data(toy):
    return apart(toy(runs=4, steps=40))


def track(data, run: str, begin: int = 0, end: int = 41, *, name: str = "", shift: float = 0.0, **more) -> Track:
    rows = rows_of(predicted(data), run).iloc[begin:end]
    return Track(name or run, rows["t"].to_numpy() + shift, rows.iloc[:, 2:].to_numpy().copy(), **more)


def matched(data, *tracks: Track):
    return match_tracks(Tracks(tracks), data, "theirs")


def test_equal_ids_match_and_so_do_windows_of_a_run(data):
    tracks = (
        track(data, "r00"),
        track(data, "r01", 10, 30, name="r01@10s"),
        track(data, "r01", 10, 30, name="r01@11s", shift=-10.0),
        track(data, "r02", 21, 30, name="r02@20s", shift=-20.0),
    )
    matches, notes = matched(data, *tracks)
    assert [m.run.id for m in matches] == ["r00", "r01", "r01", "r02"]
    assert [m.shift for m in matches] == [0.0, 0.0, 11.0, 20.0]
    assert notes == ["4 trajectories matched by run id"]


def test_a_run_whose_time_does_not_begin_at_zero_takes_either_count(data):
    later = data.with_runs(type(r)(r.id, r.t + 100.0, r.states, r.inputs) for r in data.runs)
    matches, _ = matched(later, track(data, "r00"), track(later, "r01"))
    assert [m.shift for m in matches] == [100.0, 0.0]


def test_a_date_decides_between_runs(data):
    zero = datetime(2026, 5, 4, 12, tzinfo=UTC)
    dated = data.with_runs(
        type(r)(r.id, r.t, r.states, r.inputs, meta={"from": (zero + timedelta(hours=i)).isoformat()})
        for i, r in enumerate(data.runs)
    )
    [match], notes = matched(dated, track(data, "r02", name="sim_7", began=zero + timedelta(hours=1, seconds=5)))
    assert (match.run.id, match.shift) == ("r01", 5.0)
    assert notes == ["sim_7 -> r01 from t = 5 s, by date and time"]


def test_a_start_state_finds_its_run_and_time(data):
    moved = track(data, "r02", 15, 35, name="theirs_03", shift=-15.0)
    moved.states[:, :3] += [0.2, -0.1, np.deg2rad(0.3)]
    [match], notes = matched(data, moved)
    assert (match.run.id, match.shift) == ("r02", 15.0)
    assert notes == ["theirs_03 -> r02 from t = 15 s, by start state: 0.51 m, 0.3 deg off"]


def test_a_start_far_from_all_runs_is_left_out_and_told_or_refused(data):
    far = track(data, "r02", name="theirs_03")
    far.states[:, 0] += 40.0
    _, notes = matched(data, track(data, "r00"), far)
    assert notes[1] == (
        "1 of 2 trajectories match no run and are left out: theirs_03 (the nearest measured state, r02 at t = 0 s, is "
        "40 m, 0 deg off)"
    ), notes
    with pytest.raises(InputError, match=r"Ids received: theirs_03. Accepted: r00, r01, r02, r03; .*40 m, 0 deg off"):
        matched(data, far)
    far.states[0] = np.nan
    with pytest.raises(InputError, match="its first state is not finite"):
        matched(data, far)


def test_a_start_that_fits_two_runs_is_not_guessed(data):
    twin = data.with_runs(
        [*data.runs, type(data.runs[0])("twin", *(getattr(data.runs[0], k) for k in ("t", "states", "inputs")))]
    )
    with pytest.raises(InputError, match="its start fits several places: r00, twin"):
        matched(twin, track(data, "r00", name="theirs_03"))


def test_finer_samples_are_interpolated_and_coarser_ones_refused(data):
    fine = track(data, "r00")
    t = np.linspace(0.0, 40.0, 101)
    finer = Track("r00", t, np.column_stack([np.interp(t, fine.t, column) for column in fine.states.T]))
    [match], _ = matched(data, finer)
    trajectory, between = on_grid(match, data, "theirs")
    assert between
    np.testing.assert_allclose(trajectory.states, fine.states, atol=0.05)
    [match], _ = matched(data, fine)
    trajectory, between = on_grid(match, data, "theirs")
    assert not between
    assert np.array_equal(trajectory.states, fine.states)
    coarse = Track("r00", fine.t[::2], fine.states[::2])
    [match], _ = matched(data, coarse)
    with pytest.raises(InputError, match="sampled every 2 s, the data set 'toy' every 1 s"):
        on_grid(match, data, "theirs")
    gap = Track("r00", np.delete(fine.t, [20, 21]), np.delete(fine.states, [20, 21], axis=0))
    [match], _ = matched(data, gap)
    with pytest.raises(InputError, match="gap, from t = 19 s to 22 s"):
        on_grid(match, data, "theirs")


@pytest.mark.parametrize("name", ["R 2", "r-02", "R2"])
def test_an_id_in_another_spelling_is_the_run_of_that_name(data, name):
    far = track(data, "r02", name=name)
    far.states[:, :3] += [4000.0, 0.0, 2.0]
    [match], notes = matched(data, far)
    assert match.run.id == "r02"
    assert notes == [f"{name} -> r02, by its name in another spelling"]


def test_a_number_is_the_run_of_that_number_where_heading_and_speed_agree(data):
    far = [track(data, f"r0{i}", name=f"Test_{i}") for i in range(4)]
    for one in far:
        one.states[:, :2] += [4000.0, -700.0]
    matches, notes = matched(data, *far)
    assert [m.run.id for m in matches] == ["r00", "r01", "r02", "r03"]
    assert notes[2] == "Test_2 -> r02, by its number; heading and speed at the start agree"
    from_one = [Track(f"Test_{i + 1}", t.t, t.states) for i, t in enumerate(far)]
    with pytest.raises(InputError, match="Name the trajectories as the runs"):
        matched(data, *from_one)
