"""Files of predicted trajectories: tables, MATLAB, data sets and logs with a mapping give the same states."""

from __future__ import annotations

import numpy as np
import pytest
from made_tracks import MOTION, apart, predicted, rows_of, same_motion, written
from scipy.io import savemat

from shipbench.data.files import write_dataset
from shipbench.data.mat import write_mat
from shipbench.errors import InputError
from shipbench.replay.reading import files_of, read_tracks

MAPPING = """name = "theirs"
dt = 5.0
[time]
column = "Time"
[channels]
x = {column = "North", unit = "m"}
y = {column = "East", unit = "m"}
psi = {column = "Heading", unit = "deg"}
u = {column = "Speed", unit = "kn"}
v = {column = "Sway", unit = "m/s"}
r = {column = "Rate", unit = "deg/s"}
"""


@pytest.fixture
def data(toy):
    return apart(toy(runs=3, steps=40))


def foreign(table):
    """One run in the columns and units of another program."""
    return table.assign(psi=np.rad2deg(table["psi"]), u=table["u"] * 3600 / 1852, r=np.rad2deg(table["r"])).rename(
        columns={"t": "Time", "x": "North", "y": "East", "psi": "Heading", "u": "Speed", "v": "Sway", "r": "Rate"}
    )


@pytest.mark.parametrize("kind", ["csv", "csv.gz", "parquet", "one file each", "mat", "structs", "data set", "export"])
def test_every_kind_of_file_gives_the_same_trajectories(data, tmp_path, kind):
    table, folder = predicted(data), tmp_path / "theirs"
    theirs = data.with_runs(
        type(run)(run.id, run.t, rows_of(table, run.id).iloc[:, 2:].to_numpy(), run.inputs) for run in data.runs
    )
    folder.mkdir()
    if kind == "one file each":
        for run in data.runs:
            written(rows_of(table, run.id).drop(columns="trajectory"), folder, f"{run.id}.csv")
    elif kind in ("mat", "structs"):
        runs = {r.id: {k: rows_of(table, r.id)[k].to_numpy() for k in ("t", *MOTION)} for r in data.runs}
        for name, run in runs.items() if kind == "mat" else []:
            savemat(folder / f"{name}.mat", run)
        if kind == "structs":
            savemat(folder / "theirs.mat", runs)
    elif kind == "data set":
        write_dataset(theirs, folder)
    elif kind == "export":
        write_mat(theirs, folder / "theirs.mat")
    else:
        written(table, folder, f"theirs.{kind}")
    found = read_tracks(folder, "", data)
    assert [t.id for t in found.tracks] == [r.id for r in data.runs]
    for track, run in zip(found.tracks, theirs.runs, strict=True):
        assert np.array_equal(track.t, run.t)
        assert same_motion(track.states, run.states)
    if kind in ("mat", "structs"):
        assert np.isnan(found.tracks[0].states[:, 6:]).all()
        assert found.notes == ("n, delta, F_b, F_s not given: taken as the commands",)
    else:
        assert found.notes == ()


@pytest.mark.parametrize("inside", [True, False])
def test_a_mapping_converts_as_for_a_log_and_its_dt_is_that_of_the_data_set(data, tmp_path, inside):
    table, folder = predicted(data), tmp_path / "theirs"
    for run in data.runs:
        written(foreign(rows_of(table, run.id)).drop(columns="trajectory"), folder, f"{run.id}.csv")
    path = (folder if inside else tmp_path) / "mapping.toml"
    path.write_text(MAPPING)
    found = read_tracks(folder, "" if inside else str(path), data)
    for track, run in zip(found.tracks, data.runs, strict=True):
        assert same_motion(track.states, rows_of(table, run.id).iloc[:, 2:].to_numpy(), 1e-6)
    assert path in files_of(folder, "" if inside else str(path))


def test_speeds_that_the_file_lacks_are_derived_as_in_an_import(data, tmp_path):
    folder = written(predicted(data, ("x", "y", "psi")), tmp_path / "theirs")
    found = read_tracks(folder, "", data)
    assert found.notes[0] == "u, v, r not given: derived from x, y and psi by a smoothing spline"
    off = np.abs(found.tracks[0].states[5:-5, 3:6] - data.runs[0].states[5:-5, 3:6])
    assert (off.mean(axis=0) < [0.15, 0.3, 0.006]).all()


def test_a_trajectory_that_ends_in_nan_keeps_what_came_before(data, tmp_path):
    table = rows_of(predicted(data, ("x", "y", "psi")), "r00")
    table.loc[30:, ["x", "y", "psi"]] = np.nan
    [track] = read_tracks(written(table, tmp_path / "theirs"), "", data).tracks
    assert np.isfinite(track.states[:30, :6]).all()
    assert np.isnan(track.states[30:, :6]).all()


def test_bad_files_are_one_message_each(data, tmp_path):
    table = predicted(data)

    def message(name: str, change) -> str:
        folder = written(change(table.copy()), tmp_path / name)
        with pytest.raises(InputError) as error:
            read_tracks(folder, "", data)
        return str(error.value)

    lacking = message("lacking", lambda t: t.rename(columns={"psi": "heading"}))
    assert "no column psi. Found: trajectory, t, x, y, heading" in lacking
    assert "--propose" in lacking
    assert "t goes from 1 s to 0 s" in message("back", lambda t: t.assign(t=t["t"].replace({2.0: 0.0, 0.0: 0.0})))
    assert "not a number" in message("words", lambda t: t.assign(x="here"))
    twice = written(table, tmp_path / "twice")
    written(rows_of(table, "r01"), twice, "again.csv")
    with pytest.raises(InputError, match="two files hold a trajectory 'r01'"):
        read_tracks(twice, "", data)
    with pytest.raises(InputError, match="no such file or folder"):
        files_of(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no trajectories"):
        files_of(tmp_path / "empty")
    savemat(tmp_path / "other.mat", {"a": np.arange(5.0)})
    with pytest.raises(InputError, match=r"no column t, x, y, psi\. Found: a"):
        read_tracks(tmp_path / "other.mat", "", data)


def test_a_log_that_is_coarser_than_the_data_set_is_refused(data, tmp_path):
    folder = tmp_path / "theirs"
    every = foreign(rows_of(predicted(data), "r00")).drop(columns="trajectory").iloc[::2]
    written(every, folder, "r00.csv")
    (folder / "mapping.toml").write_text(MAPPING)
    with pytest.raises(InputError, match=r"sampled every 2 s, the data set 'toy' every 1 s. Accepted: 1 s or finer"):
        read_tracks(folder, "", data)
