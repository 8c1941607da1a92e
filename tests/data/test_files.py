"""Data sets on disk: round trip, units and signs, and one clear message for every kind of bad input."""

from __future__ import annotations

import gzip

import numpy as np
import pandas as pd
import pytest

from shipbench.data import files
from shipbench.data.files import read_dataset, write_dataset
from shipbench.errors import InputError
from shipbench.records import Dataset


@pytest.fixture
def folder(tmp_path, harbour: Dataset):
    write_dataset(harbour.subset([0, 1]), tmp_path / "d", format="csv")
    return tmp_path / "d"


def _edit(path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def _change(folder, change) -> None:
    """Apply `change` to the table of trajectories."""
    path = folder / "trajectories.csv"
    table = pd.read_csv(path)
    changed = change(table)
    (table if changed is None else changed).to_csv(path, index=False)


@pytest.mark.parametrize("format", ["csv", "csv.gz", "parquet"])
def test_what_is_written_is_read_back_bit_for_bit(tmp_path, harbour, format):
    write_dataset(harbour, tmp_path, format=format)
    again = read_dataset(tmp_path)
    assert again.fingerprint == harbour.fingerprint
    assert again.simulation == "container130"
    assert [r.meta for r in again.runs] == [r.meta for r in harbour.runs]


def test_a_correction_of_nothing_changes_no_bit(folder):
    """Runs without corrections are read on a shorter way."""

    def wrap(table):
        table["psi"] = (table["psi"] + 3.0) % (2 * np.pi)

    _change(folder, wrap)
    plain = read_dataset(folder)
    assert all(np.abs(np.diff(r.states[:, 2])).max() < 1.0 for r in plain.runs)
    with (folder / "dataset.toml").open("a") as file:
        file.write("\n[bias]\nr = 0.0\n")
    corrected = read_dataset(folder)
    assert corrected.fingerprint == plain.fingerprint
    assert [r.states.flags.f_contiguous for r in corrected.runs] == [r.states.flags.f_contiguous for r in plain.runs]


def test_runs_without_corrections_make_no_table_of_their_own(folder, monkeypatch):
    monkeypatch.setattr(files, "correct_run", None)
    assert len(read_dataset(folder)) == 2


def test_units_and_signs_are_converted_to_ours(folder, harbour):
    def change(table):
        table["psi"] = np.rad2deg(table["psi"]) % 360.0
        table["u"] *= 3600.0 / 1852.0
        table[["n", "n_c"]] /= 60.0
        table[["delta", "delta_c"]] = -np.rad2deg(table[["delta", "delta_c"]])
        table["y"] *= -1.0

    _change(folder, change)
    with (folder / "dataset.toml").open("a") as file:
        file.write(
            '\n[units]\npsi = "deg"\nu = "kn"\nn = "rev/s"\ndelta = "deg"\n[signs]\ndelta = "port"\ny = "west"\n'
        )
    for ours, theirs in zip(harbour.subset([0, 1]).runs, read_dataset(folder).runs, strict=True):
        turns = (theirs.states[0, 2] - ours.states[0, 2]) / (2 * np.pi)
        assert turns == pytest.approx(round(turns))
        theirs.states[:, 2] -= 2 * np.pi * round(turns)
        np.testing.assert_allclose(theirs.states, ours.states, atol=1e-9)
        np.testing.assert_allclose(theirs.inputs, ours.inputs, atol=1e-9)


def test_their_column_names_are_mapped(folder, harbour):
    _change(folder, lambda table: table.rename(columns={"u": "SOG_long"}))
    with (folder / "dataset.toml").open("a") as file:
        file.write('\n[columns]\nSOG_long = "u"\n')
    assert read_dataset(folder).fingerprint == harbour.subset([0, 1]).fingerprint


def test_missing_thrusters_are_zero_and_said_so(folder):
    _change(folder, lambda table: table.drop(columns=["F_b", "F_s", "F_b_c", "F_s_c"]))
    data = read_dataset(folder)
    assert not data.runs[0].states[:, 8:].any()
    assert any("F_b" in note and "zero" in note for note in data.notes)


def test_missing_commands_are_the_actuators_and_said_so(folder):
    _change(folder, lambda table: table.drop(columns=["delta_c"]))
    data = read_dataset(folder)
    np.testing.assert_array_equal(data.runs[0].inputs[:, 1], data.runs[0].states[:, 7])
    assert any("delta_c" in note for note in data.notes)


def test_environment_channels_become_inputs(folder):
    _change(folder, lambda table: table.assign(wind_speed=5.0, wind_from=1.0))
    assert read_dataset(folder).inputs[-2:] == ("wind_speed", "wind_from")


def _drop(column):
    return lambda folder: _change(folder, lambda table: table.drop(columns=[column]))


def _set(column, row, value):
    def change(table):
        table[column] = table[column].astype(object)
        table.loc[row, column] = value

    return lambda folder: _change(folder, change)


def _write(name, content: bytes):
    return lambda folder: (folder / name).write_bytes(content)


def _gzip_cut(folder):
    raw = gzip.compress((folder / "trajectories.csv").read_bytes())
    (folder / "trajectories.csv").unlink()
    (folder / "trajectories.csv.gz").write_bytes(raw[: len(raw) // 2])


BAD = {
    "no trajectories": (lambda f: (f / "trajectories.csv").unlink(), "trajectories.parquet"),
    "no ship file": (lambda f: (f / "ship.toml").unlink(), "ship.toml"),
    "missing column": (_drop("psi"), "psi"),
    "missing time": (_drop("t"), "'t'"),
    "NaN": (_set("v", 7, np.nan), "v is nan"),
    "text": (_set("u", 3, "4,2"), "row 5.*'4,2'"),
    "gap in time": (lambda f: _change(f, lambda t: t.drop(index=[5, 6])), "uniform"),
    "wrong dt": (lambda f: _edit(f / "dataset.toml", "dt = 1.0", "dt = 0.5"), "0.5 s"),
    "one sample": (lambda f: _change(f, lambda t: t.iloc[:42]), "has 1 sample"),
    "empty": (_write("trajectories.csv", b""), "cannot be read"),
    "header only": (_write("trajectories.csv", b"trajectory,t\n"), "no rows"),
    "binary": (_write("trajectories.csv", bytes(range(256)) * 20), "trajectories.csv"),
    "truncated gzip": (_gzip_cut, "cannot be read"),
    "unknown key": (lambda f: _edit(f / "dataset.toml", "dt = 1.0", "dt = 1.0\nlicense = 'x'"), "license"),
    "unknown actuators": (lambda f: _edit(f / "dataset.toml", '"measured"', '"guessed"'), "guessed"),
    "not TOML": (_write("dataset.toml", b"name = "), "not valid TOML"),
    "unknown unit": (lambda f: _edit(f / "dataset.toml", "notes = []", "notes = []\nunits = {u = 'knot'}"), "kn"),
    "unknown sign": (lambda f: _edit(f / "dataset.toml", "notes = []", "notes = []\nsigns = {delta = 'left'}"), "port"),
    "unit of nothing": (
        lambda f: _edit(f / "dataset.toml", "notes = []", "notes = []\nunits = {heading = 'deg'}"),
        "heading",
    ),
    "ship without length": (lambda f: _edit(f / "ship.toml", "L = 130.0\n", ""), "L: "),
    "ship without mass": (lambda f: _edit(f / "ship.toml", "displacement = 9402.0\n", ""), "displacement"),
    "ship with a negative beam": (lambda f: _edit(f / "ship.toml", "B = 18.2", "B = -18.2"), "B: "),
    "ship with an unknown key": (lambda f: _edit(f / "ship.toml", "B = 18.2", "B = 18.2\nbeam = 3"), "beam"),
}


@pytest.mark.parametrize("fault", BAD)
def test_bad_input_is_named(folder, fault):
    spoil, expected = BAD[fault]
    spoil(folder)
    with pytest.raises(InputError, match=expected):
        read_dataset(folder)
