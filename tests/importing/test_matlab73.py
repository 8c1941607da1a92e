"""MATLAB 7.3 files, written in MATLAB's layout (HDF5 behind 512 bytes, arrays transposed, the class of each as an
attribute)."""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd
import pytest
from trial import channels, logged, mapping

from shipbench.data.base import load_dataset
from shipbench.importing.mapping import Layout
from shipbench.importing.tables import open_table

h5py = pytest.importorskip("h5py", reason="needs the extra shipbench[matlab]")
T = np.arange(0.0, 60.05, 0.5)
NAMES = {"north": "track(1)", "east": "track(2)"} | {
    name: f"log.{name.replace(' ', '_')}" for name in ("HDG", "surge", "sway", "ROT", "rpm", "rudder", "rudder order")
}
PLAN = mapping()
for theirs, matlab in NAMES.items():
    PLAN = PLAN.replace(f'column = "{theirs}"', f'column = "{matlab}"')


def put(group, name: str, values: np.ndarray, kind: bytes = b"double", **options) -> None:
    """A MATLAB array: its transpose, with its class."""
    group.create_dataset(name, data=np.atleast_2d(values).T if values.ndim > 1 else values, **options).attrs[
        "MATLAB_class"
    ] = np.bytes_(kind)


def write_mat(path, table: pd.DataFrame, stamps: list[str] | None = None, **options) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        put(file, "time", table["time"].to_numpy()[None, :], **options)  # a row
        if stamps:
            put(file, "stamp", np.array([[ord(c) for c in s.ljust(30)] for s in stamps], np.uint16), b"char")
        put(file, "track", table[["north", "east"]].to_numpy(), **options)
        log = file.create_group("log")
        for name in table.columns[3:]:
            put(log, name.replace(" ", "_"), table[name].to_numpy()[:, None], **options)  # columns
        file.create_group("#refs#").create_dataset("a", data=np.arange(5.0))
        file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/")
        file["log/again"] = file["log"]  # a group in itself
        file.create_dataset("cells", data=np.array([file["time"].ref, file["track"].ref], dtype=h5py.ref_dtype))
    with path.open("r+b") as raw:
        raw.write(
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Tue Mar 05 13:59:00 2024 HDF5 schema 1.00 .".ljust(
                124
            )
            + b"\x00\x02IM"
        )


@pytest.mark.parametrize("options", [{}, {"chunks": True, "compression": "gzip"}])
def test_it_gives_the_same_data_as_the_table(trial_import, tmp_path, options, monkeypatch):
    monkeypatch.setattr("shipbench.importing.matlab73.ROWS", 50)  # several blocks
    table = logged(T)
    trial_import(table)
    expected = load_dataset("out").runs[0]
    write_mat(tmp_path / "log.mat", table, **options)
    result = trial_import([tmp_path / "log.mat"], PLAN, "--force")
    assert result.exit_code == 0, result.output
    run = load_dataset("out").runs[0]
    np.testing.assert_allclose(run.states, expected.states, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(run.inputs, expected.inputs, rtol=1e-12, atol=1e-12)


def test_time_stamps_as_rows_of_letters(trial_import, tmp_path):
    stamps = (pd.Timestamp("2024-03-05 13:59:00") + pd.to_timedelta(T, "s")).strftime("%Y-%m-%d %H:%M:%S.%f").tolist()
    write_mat(tmp_path / "log.mat", logged(T), stamps)
    result = trial_import([tmp_path / "log.mat"], PLAN.replace('column = "time"', 'column = "stamp"\nformat = "iso"'))
    assert result.exit_code == 0, result.output
    assert load_dataset("out").runs[0].meta.from_ == "2024-03-05T13:59:00.000Z"


def test_what_is_no_vector_and_what_lies_elsewhere_is_passed_over(tmp_path):
    write_mat(tmp_path / "log.mat", logged(T))
    columns = open_table(tmp_path / "log.mat", Layout()).columns
    assert {"time", "track(1)", "track(2)", "log.rudder_order"} <= set(columns)
    assert not [name for name in columns if "elsewhere" in name or "again" in name or "cells" in name or "#" in name]


def test_damaged_and_hostile_files_are_one_message(trial_import, tmp_path, monkeypatch):
    path = tmp_path / "log.mat"
    write_mat(path, logged(T))
    whole = path.read_bytes()
    for size in (600, len(whole) // 2, len(whole) - 100):
        path.write_bytes(whole[:size])
        result = trial_import([path], PLAN)
        assert result.exit_code == 2, result.output
        assert "cannot be read" in result.stderr
    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_dataset("z", (1, 10**9), np.float64, chunks=(1, 5 * 10**7), compression="gzip")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    assert "packed in pieces" in trial_import([path], PLAN).stderr
    monkeypatch.setitem(sys.modules, "h5py", None)
    result = trial_import([path], PLAN)
    assert result.exit_code == 2
    assert "pip install 'shipbench[matlab]'" in result.stderr
    assert not (tmp_path / "out").exists()


def test_rates_of_their_own_are_sources_of_one_file(trial_import, tmp_path):
    table, fast = logged(T), logged(np.arange(0.0, 60.05, 0.1))
    path = tmp_path / "log.mat"
    write_mat(path, table)
    with h5py.File(path, "r+") as file:
        put(file, "gyro/t", fast["time"].to_numpy()[:, None])
        put(file, "gyro/psi", fast["HDG"].to_numpy()[:, None])
    plan = PLAN.replace("[time]", "[sources.log.time]").replace(channels(), "")
    head, body = plan.split("[channels]")
    gyro = '[sources.gyro]\ntime = { column = "gyro.t" }\nchannels.psi = { column = "gyro.psi", unit = "deg" }\n'
    kept = "\n".join(line for line in body.splitlines() if not line.startswith("psi"))
    result = trial_import([path], f"{head}[sources.log.channels]{kept}\n{gyro}")
    assert result.exit_code == 0, result.output
    assert "psi [rad] = 'gyro.psi' (from deg), every 0.1 s" in result.stdout
    refused = trial_import([path], PLAN.replace('column = "log.HDG"', 'column = "gyro.psi"'), "--force")
    assert "differ in length" in refused.stderr
