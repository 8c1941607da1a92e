"""A data set that is exported and read again is the same data set."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat, savemat
from toy_ship import sail
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data.base import load_dataset
from shipbench.data.files import write_dataset
from shipbench.data.mat import read_mat, write_mat
from shipbench.records import Dataset, Run
from shipbench.ship import Propeller, Rudder, Ship, Thrusters
from shipbench.signals import COMMANDS, STATES

ODD_IDS = ("1-2 (port)", "日本/é", "001", "NA", " spaced ", "a,b\"c'", "x" * 80)


def odd() -> Dataset:
    """Runs of different length, odd names, environment channels, metadata of every kind, and numbers with all their
    digits."""
    rng = np.random.default_rng(3)
    runs = []
    for i, name in enumerate(ODD_IDS):
        S, C = sail(5 + 3 * i, i)
        S = S + rng.standard_normal(S.shape) * 1e-3 / 3
        environment = np.column_stack(
            [rng.uniform(0, 9, len(S)), rng.uniform(-9, 9, len(S)), np.full(len(S), 1e-7 / 3)]
        )
        meta = (
            {
                "manoeuvre": "zig-zag 10°/10°",
                "group": i,
                "calm": True,
                "list": [1.5, "two"],
                "crew": {"watch": "B", "12": 0.1},
            }
            if i
            else {}
        )
        names = (*COMMANDS, "wind_speed", "wind_from", "depth")
        runs.append(Run(name, 0.1 / 3 + np.arange(len(S)) * 0.7, S, np.hstack([C, environment]), names, meta))
    ship = Ship(
        name="Ørsted 7", L=50.0, B=8.0, T=3.0, mass=9e5,
        propeller=Propeller(diameter=2.0, blades=4, kt=(0.3, -0.3, -0.1)),
        rudder=Rudder(area=4.0, x=-24.0), thrusters=Thrusters(x_bow=20.0, max_force=1e4),
    )  # fmt: skip
    return Dataset(
        "odd set",
        ship,
        0.7,
        tuple(runs),
        "commanded",
        "a formula",
        "CC BY 4.0",
        "container130",
        ("one — note", "two"),
        ("u", "r"),
    )


def assert_same(ours: Dataset, theirs: Dataset) -> None:
    assert theirs.fingerprint == ours.fingerprint  # every sample, run name, dt, the inputs and the ship, bit for bit
    for field in ("name", "source", "licence", "simulation", "notes", "actuators", "derived"):
        assert getattr(theirs, field) == getattr(ours, field), field
    assert [r.meta for r in theirs.runs] == [r.meta for r in ours.runs]


@pytest.fixture
def cli(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path / "cache"))
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.mark.parametrize(
    ("arguments", "result"),
    [
        (("--out", "o", "--format", "csv"), "o"),
        (("--out", "o", "--format", "parquet"), "o"),
        (("--out", "o", "--format", "mat"), "o/dataset.mat"),
        (("--out", "deep/er/o.mat"), "deep/er/o.mat"),
    ],
)
def test_export_and_reading_again_gives_the_same_data_set(cli, arguments, result):
    data = odd()
    write_dataset(data, "mine")
    done = cli("data", "export", "mine", *arguments)
    assert done.exit_code == 0, done.output
    assert_same(data, load_dataset(result))
    left = [p.name for p in Path(arguments[1]).parent.rglob("*") if p.name.startswith(".") or "tmp" in p.name]
    assert left == []


def test_csv_is_text_with_the_contracts_columns_and_every_digit(cli):
    data = odd()
    write_dataset(data, "mine")
    cli("data", "export", "mine", "--out", "o", "--format", "csv")
    table = pd.read_csv("o/trajectories.csv", dtype={"trajectory": str}, keep_default_na=False)
    assert list(table.columns) == ["trajectory", "t", *STATES, *data.inputs]
    own = table[table.trajectory == ODD_IDS[1]]
    np.testing.assert_array_equal(own["y"].to_numpy(), data.runs[1].states[:, 1])


def test_the_mat_file_is_what_a_matlab_user_expects(tmp_path):
    data = odd()
    write_mat(data, tmp_path / "o.mat")
    found = loadmat(tmp_path / "o.mat", squeeze_me=False)
    runs, run, about = found["runs"], found["runs"][0, 2], found["dataset"][0, 0]
    assert runs.shape == (1, len(ODD_IDS))
    assert run["t"].shape == (12, 1)
    assert run["states"].shape == (12, 10)
    assert run["commands"].shape == (12, 4)
    assert run["environment"].shape == (12, 3)
    assert run["id"][0] == "001"

    def texts(cell):
        return tuple(str(c[0][0]) for c in cell)

    names, units = run["names"][0, 0], run["units"][0, 0]
    assert texts(names["states"]) == STATES
    assert texts(names["environment"]) == ("wind_speed", "wind_from", "depth")
    assert texts(units["states"])[2:8] == ("rad", "m/s", "m/s", "rad/s", "rpm", "rad")
    assert texts(units["commands"]) == ("rpm", "rad", "N", "N")
    assert float(about["dt"][0, 0]) == 0.7
    assert float(about["ship"][0, 0]["propeller"][0, 0]["diameter"][0, 0]) == 2.0
    assert str(about["licence"][0]) == "CC BY 4.0"
    with (tmp_path / "o.mat").open("rb") as file:
        assert file.read(19) == b"MATLAB 5.0 MAT-file"


def test_one_run_without_environment_and_metadata_comes_back_too(tmp_path):
    S, C = sail(1, 0)
    data = Dataset("one", odd().ship, 1.0, (Run("", np.arange(2.0), S, C),))
    write_mat(data, tmp_path / "one.mat")
    assert_same(data, read_mat(tmp_path / "one.mat"))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"not a mat file",
        b"MATLAB 5.0 MAT-file" + b" " * 105 + b"\x00\x01IM" + b"\xff" * 64,
        "cut",
        "other",
        "short",
    ],
)
def test_a_file_that_is_no_data_set_is_one_message(cli, tmp_path, content):
    path = tmp_path / "bad.mat"
    if content == "cut":
        write_mat(odd(), path)
        path.write_bytes(path.read_bytes()[:900])
    elif content == "other":
        savemat(path, {"dataset": 3.0, "runs": np.arange(4.0)})
    elif content == "short":
        write_mat(odd(), path)
        found = loadmat(path)
        found["runs"][0, 0]["states"] = found["runs"][0, 0]["states"][:-1]
        savemat(path, {k: found[k] for k in ("dataset", "runs")})
    else:
        path.write_bytes(content)
    result = cli("data", "check", path)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: ")
    assert "bad.mat" in result.stderr or "states (5, 10)" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--out", "o"), "no format is given"),
        (("--out", "o", "--format", "xlsx"), "--format xlsx; accepted: csv, parquet, mat"),
        (("--out", "o.mat", "--format", "csv"), "--format is csv"),
        (("--out", "toyset", "--format", "parquet"), "would be overwritten"),
        (("--out", "toyset/../toyset", "--format", "csv"), "would be overwritten"),
        (("--out", "file", "--format", "csv"), "cannot write the data set to file"),
        (
            (
                "--out",
                "file/x.mat",
            ),
            "cannot write file/x.mat",
        ),
    ],
)
def test_what_cannot_be_exported_is_one_message_and_leaves_nothing(cli, toy_folder, tmp_path, arguments, message):
    folder = toy_folder()
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    Path("file").write_text("a file\n")
    result = cli("data", "export", "toyset", *arguments)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before
    assert sorted(p.name for p in tmp_path.iterdir() if p.name != "cache") == ["file", "toyset"]
