"""Tables of MATLAB through mat-io, and files that declare more than they hold."""

from __future__ import annotations

import warnings

import h5py
import numpy as np
import pandas as pd
import pytest
from trial import channels, logged, mapping

from shipbench.data.base import load_dataset

T = np.arange(0.0, 60.05, 0.5)
PLAN = mapping(
    time='column = "T.time"',
    body=channels().replace('column = "', 'column = "T.').replace("rudder order", "rudder_order"),
)


@pytest.fixture
def save(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        matio = pytest.importorskip("matio")

    def write(version: str, **variables) -> list:
        path = tmp_path / "log.mat"
        matio.save_to_mat(str(path), variables, version=version)
        return [path]

    return write


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_a_table_is_read_under_the_names_of_its_variables(trial_import, save, version):
    table = logged(T).rename(columns={"rudder order": "rudder_order"})
    result = trial_import(save(version, T=table, other=np.arange(5.0)), PLAN)
    assert result.exit_code == 0, result.output
    found = load_dataset("out").runs[0].states
    trial_import(logged(T), None, "--force")
    np.testing.assert_allclose(found, load_dataset("out").runs[0].states, atol=1e-9)


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_a_timetable_in_a_struct_has_its_row_times(trial_import, save, version):
    table = logged(T).rename(columns={"rudder order": "rudder_order"}).drop(columns="time")
    table.index = pd.Index(pd.Timestamp("2025-06-01") + pd.to_timedelta(T, "s"), name="Time")
    plan = PLAN.replace('"T.', '"S.log.').replace('"S.log.time"', '"S.log.Time"\nformat = "iso"')
    result = trial_import(save(version, S={"log": table}), plan)
    assert result.exit_code == 0, result.output
    assert load_dataset("out").runs[0].t[-1] == 60.0


def test_an_object_that_is_not_read_says_how_to_save_it(trial_import, tmp_path):
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        table = file.create_dataset("T", data=np.array([[3707764736], [2], [1], [1], [1], [1]], np.uint32))
        table.attrs["MATLAB_class"], table.attrs["MATLAB_object_decode"] = np.bytes_("table"), np.int32(3)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    refused = trial_import([path], PLAN)
    assert refused.exit_code == 2
    assert (
        "holds objects of MATLAB (T) that are not read. Save it in MATLAB with writetable(T, 'log.csv')"
        in refused.stderr
    )


@pytest.mark.parametrize("chunks", [(1, 1000), None])
def test_a_file_that_declares_more_than_it_holds_is_refused(trial_import, tmp_path, chunks):
    path = tmp_path / "log.mat"
    with h5py.File(path, "w") as file:
        file.create_dataset("time", (1, 10**12), np.float64, chunks=chunks)
    refused = trial_import([path], PLAN)
    assert refused.exit_code == 2
    assert "'time' declares 1000000000000 values and holds 0% of them" in refused.stderr
