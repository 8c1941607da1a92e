"""The draft of a mapping: what it guesses is called a guess, and after a look it imports."""

from __future__ import annotations

import re
import tomllib
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from trial import SHIP, logged, write
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data.base import load_dataset


@pytest.fixture
def propose(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "ship.toml", SHIP)

    def run(*logs, options=()):
        return CliRunner().invoke(app, ["data", "import", *map(str, logs), "--propose", "draft.toml", *options])

    return run


def columns(text: str) -> dict[str, tuple[str, str]]:
    plan = tomllib.loads(text)
    return {ours: (entry["column"], entry["unit"]) for ours, entry in plan["channels"].items()}


def test_the_draft_of_a_clear_log_imports_as_it_is(propose, tmp_path):
    table = logged(np.arange(0.0, 60.0, 0.5)).rename(columns={
        "surge": "u_velo [kn]", "sway": "vm_velo [m/s]", "HDG": "HDG (deg)", "ROT": "ROT [deg/min]",
        "rpm": "shaft speed [rpm]",
        "rudder": "Rudder Angle [°]", "rudder order": "rudder_cmd [deg]", "time": "t [s]",
    }).assign(remark="calm")  # fmt: skip
    result = propose(write(tmp_path, "log.csv", table))
    assert result.exit_code == 0, result.output
    text = (tmp_path / "draft.toml").read_text()
    assert columns(text) == {
        "x": ("north", "m"), "y": ("east", "m"), "psi": ("HDG (deg)", "deg"), "u": ("u_velo [kn]", "kn"),
        "v": ("vm_velo [m/s]", "m/s"),
        "r": ("ROT [deg/min]", "deg/min"), "n": ("shaft speed [rpm]", "rpm"), "delta": ("Rudder Angle [°]", "deg"),
        "delta_c": ("rudder_cmd [deg]", "deg"),
    }  # fmt: skip
    for line in re.findall(r"(?m)^\w+ = \{.*$", text):
        assert "# GUESS" in line
    assert "1 column was not taken: remark" in result.stdout
    done = CliRunner().invoke(
        app, ["data", "import", "log.csv", "--map", "draft.toml", "--ship", "ship.toml", "--out", "out"]
    )
    assert done.exit_code == 0, done.output
    assert len(load_dataset("out")) == 1


@pytest.mark.parametrize(
    "name",
    [
        "Rudder angle [deg] (port +)",
        "Rudder [deg], + = PS",
        "rudder (deg) positive to port",
        "rudder_deg_port_positive",
    ],
)
def test_a_rudder_that_is_positive_to_port_by_its_name_is_drafted_so(propose, tmp_path, name):
    table = logged(np.arange(0.0, 60.0, 0.5)).rename(
        columns={"rudder": name, "rudder order": "rudder order, starboard + [deg]"}
    )
    assert propose(write(tmp_path, "log.csv", table)).exit_code == 0
    channels = tomllib.loads((tmp_path / "draft.toml").read_text())["channels"]
    assert channels["delta"]["column"] == name
    assert channels["delta"]["sign"] == "port"
    assert "sign" not in channels["delta_c"]


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        ({"Date": "05/03/2024", "Time (UTC)": "13:59:00.250"}, (["Date", "Time (UTC)"], "%d/%m/%Y %H:%M:%S.%f")),
        ({"Date": "2024-03-05", "Time": "13:59:00"}, (["Date", "Time"], "iso")),
        ({"Time": "03/25/2024 01:59:00 PM"}, ("Time", "%m/%d/%Y %I:%M:%S %p")),
        ({"Time": "25.03.24 13:59"}, ("Time", "%d.%m.%y %H:%M")),
        ({"Timestamp": "2024/03/25 13:59:00"}, ("Timestamp", "%Y/%m/%d %H:%M:%S")),
        ({"Timestamp": "2024-03-25T13:59:00Z"}, ("Timestamp", "iso")),
        ({"Time": "13:59:00"}, ("Time", "%H:%M:%S")),
    ],
)  # fmt: skip
def test_formats_of_time_stamps_are_recognised(propose, tmp_path, stamps, expected):
    table = logged(np.arange(0.0, 5.0)).drop(columns="time").assign(**stamps)
    assert propose(write(tmp_path, "log.csv", table)).exit_code == 0
    clock = tomllib.loads((tmp_path / "draft.toml").read_text())["time"]
    assert (clock.get("columns") or clock.get("column"), clock["format"]) == expected
    stamp = " ".join(stamps.values())
    assert expected[1] == "iso" or datetime.strptime(stamp, expected[1]).minute == 59


def test_instruments_become_sources_and_nautical_names_are_known(propose, tmp_path):
    t = np.arange(0.0, 60.0)
    stamps = (pd.Timestamp("2024-05-04") + pd.to_timedelta(t, "s")).strftime("%Y-%m-%dT%H:%M:%SZ")
    gps = pd.DataFrame({"UTC": stamps, "Latitude": 52.0 + t * 1e-5, "Longitude": 4.0 + 0 * t, "SOG": 8.0, "COG": 359.0})
    gyro = pd.DataFrame({"unixTime": 1.7e9 + t, "Heading": 180.0 + t, "ROT": 30.0})
    result = propose(write(tmp_path, "gps.csv", gps), write(tmp_path, "gyro.csv", gyro))
    assert result.exit_code == 0, result.output
    plan = tomllib.loads((tmp_path / "draft.toml").read_text())
    first, second = plan["sources"].values()
    assert (first["files"], first["time"]) == ("gps.csv", {"column": "UTC", "format": "iso"})
    assert second["time"] == {"column": "unixTime", "format": "unix"}
    assert {k: v["unit"] for k, v in (first["channels"] | second["channels"]).items()} == {
        "lat": "deg", "lon": "deg", "sog": "kn", "cog": "deg", "psi": "deg", "r": "deg/min",
    }  # fmt: skip
    assert "no rudder angle" in result.stdout


def test_a_slow_source_has_a_gap_of_its_own_and_an_unknown_one_is_left_to_the_reader(propose, tmp_path):
    t = np.arange(0.0, 100.0)
    wind = pd.DataFrame({"t [s]": t[::10], "TWS [kn]": 12.0, "TWD [deg]": 200.0})
    other = pd.DataFrame({"t [s]": t, "cheese": 1.0})
    propose(*(write(tmp_path, n, d) for n, d in (("ship.csv", logged(t)), ("wind.csv", wind), ("other.csv", other))))
    plan = tomllib.loads((tmp_path / "draft.toml").read_text())
    assert plan["split"]["gap"] == 3
    assert len(plan["sources"]) == 2
    assert plan["sources"]["source2"]["channels"]["wind_speed"] == {"column": "TWS [kn]", "unit": "kn", "gap": 30}
    command = ["data", "import", "ship.csv", "wind.csv", "--map", "draft.toml", "--ship", "ship.toml", "--out", "out"]
    assert CliRunner().invoke(app, command).exit_code == 0
    assert "belongs to no source" in CliRunner().invoke(app, [*command, "other.csv", "--force"]).stderr


def test_vectors_of_several_lengths_in_one_matlab_file_are_instruments(propose, tmp_path):
    from scipy.io import savemat

    slow, fast = np.arange(0.0, 60.0), np.arange(0.0, 60.0, 0.1)
    gps = {"t": slow, "lat": 52 + 4e-5 * slow, "lon": 4 + 0 * slow}
    savemat(tmp_path / "log.mat", {"gps": gps, "gyro": {"t": fast, "heading": 0.01 * fast}, "gain": np.ones(3)})
    assert propose(tmp_path / "log.mat").exit_code == 0
    sources = tomllib.loads((tmp_path / "draft.toml").read_text())["sources"].values()
    assert [set(source["channels"]) for source in sources] == [{"lat", "lon"}, {"psi"}]
    done = CliRunner().invoke(
        app, ["data", "import", "log.mat", "--map", "draft.toml", "--ship", "ship.toml", "--out", "out"]
    )
    assert done.exit_code == 0, done.output
    assert load_dataset("out").runs[0].t[-1] == pytest.approx(59.0)


def test_decimal_commas_and_german_dates_are_seen(propose, tmp_path):
    table = logged(np.arange(0.0, 30.0))
    table["time"] = (pd.Timestamp("2024-05-04") + pd.to_timedelta(table["time"], "s")).dt.strftime("%d.%m.%Y %H:%M:%S")
    path = tmp_path / "log.csv"
    table.to_csv(path, index=False, sep=";", decimal=",")
    propose(path)
    plan = tomllib.loads((tmp_path / "draft.toml").read_text())
    assert plan["file"]["decimal"] == ","
    assert plan["time"]["format"] == "%d.%m.%Y %H:%M:%S"
    done = CliRunner().invoke(
        app, ["data", "import", "log.csv", "--map", "draft.toml", "--ship", "ship.toml", "--out", "out"]
    )
    assert done.exit_code == 0, done.output


def test_what_is_not_found_is_told_and_never_filled_in(propose, tmp_path):
    result = propose(write(tmp_path, "log.csv", pd.DataFrame({"a": np.arange(9.0), "b": np.arange(9.0)})))
    assert result.exit_code == 0
    for missing in ("for the time", "for psi", "no position"):
        assert missing in result.stdout
    done = CliRunner().invoke(app, ["data", "import", "log.csv", "--map", "draft.toml", "--ship", "ship.toml"])
    assert done.exit_code == 2


def test_an_existing_draft_is_kept_unless_forced(propose, tmp_path):
    log = write(tmp_path, "log.csv", logged(np.arange(9.0)))
    write(tmp_path, "draft.toml", "mine")
    assert propose(log).exit_code == 2
    assert (tmp_path / "draft.toml").read_text() == "mine"
    assert propose(log, options=["--force"]).exit_code == 0


def test_names_with_quotes_and_escapes_stay_valid_toml(propose, tmp_path):
    table = logged(np.arange(9.0)).rename(columns={"HDG": 'heading "true" \\ [deg]'})
    assert propose(write(tmp_path, "log.csv", table)).exit_code == 0
    assert columns((tmp_path / "draft.toml").read_text())["psi"][0] == 'heading "true" \\ [deg]'


def test_the_mapping_in_the_docs_imports_a_log(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[3] / "docs/import-a-log.md").read_text()
    (plan,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    write(tmp_path, "mapping.toml", plan)
    write(tmp_path, "ship.toml", SHIP)
    t = np.arange(0.0, 700.0)
    stamps = (pd.Timestamp("2024-05-04") + pd.to_timedelta(t, "s")).strftime("%Y-%m-%d %H:%M:%S")
    table = pd.DataFrame(
        {"UTC": stamps, "Latitude": 52 + 4e-5 * t, "Longitude": 4.0, "HDG": 0.0, "shaft [rpm]": 90.0, "rudder": 5.0}
    )
    table.to_csv("bridge.csv", index=False)
    done = CliRunner().invoke(
        app, ["data", "import", "bridge.csv", "--map", "mapping.toml", "--ship", "ship.toml", "--out", "my_trial"]
    )
    assert done.exit_code == 0, done.output
    data = load_dataset("my_trial")
    assert [len(run) for run in data.runs] == [301, 301]
    np.testing.assert_allclose(
        data.runs[0].states[:, 3], 4e-5 * 111_270, rtol=1e-3
    )  # a degree of latitude at 52 north is 111.27 km
    np.testing.assert_allclose(data.runs[0].states[:, 7], -np.deg2rad(5.0), rtol=1e-9)


def test_the_columns_of_the_readme_are_taken_and_clearance_is_no_depth(propose, tmp_path):
    """A rudder of 5 without a unit is no angle in radians, and what is below the keel is less than the depth by the
    draught."""
    table = pd.DataFrame(
        {
            "t": np.arange(40.0),
            "HDG": 10.0,
            "shaft [rpm]": 80.0,
            "shaft power [kW]": 900.0,
            "rudder": 5.0 * np.sin(np.arange(40.0)),
            "UKC [m]": 4.0,
        }
    )
    assert propose(write(tmp_path, "log.csv", table)).exit_code == 0
    channels = tomllib.loads(Path("draft.toml").read_text())["channels"]
    assert channels["n"] == {"column": "shaft [rpm]", "unit": "rpm"}
    assert channels["delta"] == {"column": "rudder", "unit": "deg"}
    assert "depth" not in channels
