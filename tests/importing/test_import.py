"""A log in, a data set out: what the user sees and what the loader reads."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from trial import channels, logged, mapping, motion, write
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data.base import load_dataset
from shipbench.run_meta import RunMeta

T = np.arange(0.0, 120.05, 0.1)
DAY_FIRST = "%d/%m/%Y %H:%M:%S.%f"


def check_motion(run, t=None, atol=2e-3, names=("x", "y", "psi", "u", "v", "r", "n", "delta")):
    """The run's states are those of the formula at its times (or at `t`)."""
    truth = motion(run.t if t is None else t)
    for j, name in enumerate(("x", "y", "psi", "u", "v", "r", "n", "delta")):
        if name in names:
            scale = {"x": 20, "y": 20}.get(name, 1)
            np.testing.assert_allclose(run.states[:, j], truth[name], atol=atol * scale, err_msg=name)


def test_a_log_with_its_own_names_and_units_becomes_a_data_set(trial_import):
    result = trial_import(logged(T))
    assert result.exit_code == 0, result.output
    assert "1 run, 2 min of 2 min of log, dt = 1 s, actuators measured" in result.stdout
    assert "u [m/s] = 'surge' (from kn), every 0.1 s" in result.stdout
    data = load_dataset("out")
    assert data.dt == 1.0
    run = data.runs[0]
    assert run.id == "log"
    assert len(run) == 121
    check_motion(run)
    # Commands are means over [t_k, t_k+1): here they change at whole seconds.
    np.testing.assert_allclose(run.inputs[:-1, 1], motion(run.t)["delta_c"][:-1], atol=1e-12)
    assert run.meta == RunMeta(file="log.csv", from_=0.0, to=120.0)


def test_what_it_writes_runs_through_the_benchmark(trial_import, undrawn):
    trial_import(logged(np.arange(0.0, 400.0, 0.5)), None, "--window", "60")
    assert CliRunner().invoke(app, ["data", "check", "out"]).exit_code == 0
    assert CliRunner().invoke(app, ["data", "describe", "out"]).exit_code == 0
    result = CliRunner().invoke(app, ["run", "-m", "hold", "-d", "out", "--horizon", "30", "--folds", "2", "-q"])
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("kind", ["csv.gz", "parquet", "mat", "xlsx", "semicolon", "bom", "utf-16", "units row"])
def test_every_kind_of_file_gives_the_same_data(trial_import, tmp_path, kind):
    table, plan = logged(T[::5]), mapping()
    trial_import(table)
    expected = load_dataset("out").runs[0]
    path = tmp_path / f"log.{kind}"
    if kind == "parquet":
        table.to_parquet(path)
    elif kind == "mat":
        from scipy.io import savemat

        nested = {name.replace(" ", "_"): table[name].to_numpy() for name in table if name not in ("time", "north")}
        savemat(
            path,
            {
                "time": table["time"].to_numpy(),
                "log": nested,
                "track": np.column_stack([table["time"], table["north"]]),
            },
        )
        names = {"north": "track(2)"} | {
            name: f"log.{name.replace(' ', '_')}" for name in table if name not in ("time", "north")
        }
        for theirs, matlab in names.items():
            plan = plan.replace(f'column = "{theirs}"', f'column = "{matlab}"')
    elif kind == "xlsx":
        table.to_excel(path, index=False)
    elif kind == "semicolon":
        table.to_csv(path, index=False, sep=";", decimal=",")
        plan = mapping(tables='[file]\ndecimal = ","')
    elif kind in ("bom", "utf-16"):
        table.to_csv(path, index=False, encoding="utf-8-sig" if kind == "bom" else kind)
    elif kind == "units row":
        header, rest = table.to_csv(index=False).split("\n", 1)
        path.write_text(f"Logger 3000; Port of Call\n\n{header}\ns,m,m,deg,kn,m/s,deg/min,rpm,deg,deg\n{rest}")
        plan = mapping(tables="[file]\nheader = 3\nskip = 1")
    else:
        table.to_csv(path, index=False)
    result = trial_import([path], plan, "--force")
    assert result.exit_code == 0, result.output
    run = load_dataset("out").runs[0]
    np.testing.assert_allclose(run.states, expected.states, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(run.inputs, expected.inputs, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("time", "stamps"),
    [
        ('column = "time"\nformat = "ms"', lambda t: (1000 * t).round().astype(int)),
        ('column = "time"\nformat = "unix"', lambda t: 1.6e9 + t),
        ('column = "time"\nformat = "iso"', lambda t: pd.Timestamp("2024-02-29 23:59:00") + pd.to_timedelta(t, "s")),
        ('column = "time"\nformat = "iso"',
            lambda t: [f"{s.isoformat()}+02:00" for s in pd.Timestamp("2024-02-29") + pd.to_timedelta(t, "s")]),
        ('column = "time"\nformat = "excel"', lambda t: 45000.25 + t / 86400),
        ('column = "time"\nformat = "matlab"', lambda t: 739000.25 + t / 86400),
        (f'column = "time"\nformat = "{DAY_FIRST}"',
            lambda t: (pd.Timestamp("2024-02-29") + pd.to_timedelta(t, "s")).strftime(DAY_FIRST)),
        ("rate = 2.0", lambda t: np.zeros(len(t))),
    ],
)  # fmt: skip
def test_every_form_of_time_gives_the_same_samples(trial_import, time, stamps):
    table = logged(T[::5])
    table["time"] = stamps(table["time"].to_numpy())
    result = trial_import(table, mapping(time=time))
    assert result.exit_code == 0, result.output
    run = load_dataset("out").runs[0]
    np.testing.assert_allclose(run.t, np.arange(121.0), atol=1e-6)
    check_motion(run)


def test_time_stamps_are_kept_in_the_metadata(trial_import):
    table = logged(T[::5])
    table["time"] = pd.Timestamp("2024-07-01 12:00:00") + pd.to_timedelta(table["time"], "s")
    trial_import(table, mapping(time='column = "time"\nformat = "iso"\nzone = "Europe/Amsterdam"'))
    assert load_dataset("out").runs[0].meta.from_ == "2024-07-01T10:00:00.000Z"


def test_date_and_time_in_two_columns_and_two_decimals_of_a_second(trial_import):
    table = logged(T[::5])
    stamps = pd.Timestamp("2024-02-29 23:59:30") + pd.to_timedelta(table.pop("time"), "s")
    table.insert(0, "date", stamps.dt.strftime("%Y-%m-%d"))
    table.insert(1, "clock", stamps.dt.strftime("%H:%M:%S.%f").str[:-4])
    result = trial_import(table, mapping(time='columns = ["date", "clock"]\nformat = "iso"'))
    assert result.exit_code == 0, result.output
    check_motion(load_dataset("out").runs[0])


@pytest.mark.parametrize(
    ("clock", "stamps", "told"),
    [
        ('zone = "Europe/Amsterdam"', ["2024-10-27 02:30:00", "2024-10-27 02:30:01"], "no one meaning"),
        ('zone = "UTC"', ["2024-10-27 02:30:00Z", "2024-10-27 02:30:01Z"], "zone of their own"),
        ("", ["2024-10-27 02:30:00Z", "2024-10-27 02:30:01"], "1 of 2 time stamps have a zone"),
        ("", ["2024-10-27 02:30:00", "yesterday"], "not of the format 'iso'"),
    ],
)  # fmt: skip
def test_time_stamps_that_do_not_name_one_moment_are_refused(trial_import, clock, stamps, told):
    table = logged(T[:2])
    table["time"] = stamps
    result = trial_import(table, mapping(time=f'column = "time"\nformat = "iso"\n{clock}'))
    assert result.exit_code == 2
    assert told in result.stderr


def test_typed_time_stamps_of_parquet(trial_import, tmp_path):
    table = logged(T[::5])
    table["time"] = pd.Timestamp("2024-07-01 12:00:00", tz="Europe/Paris") + pd.to_timedelta(table["time"], "s")
    table.to_parquet(tmp_path / "log.parquet")
    assert "accepted for it: 'iso'" in trial_import([tmp_path / "log.parquet"]).stderr
    result = trial_import([tmp_path / "log.parquet"], mapping(time='column = "time"\nformat = "iso"'))
    assert result.exit_code == 0, result.output
    run = load_dataset("out").runs[0]
    assert run.meta.from_ == "2024-07-01T10:00:00.000Z"
    check_motion(run)


def test_a_header_in_latin_1(trial_import, tmp_path):
    path = tmp_path / "log.csv"
    logged(T[::5]).rename(columns={"rudder": "rudder [°]"}).to_csv(path, index=False, encoding="latin-1")
    plan = mapping(body=channels(delta='{ column = "rudder [°]", unit = "deg" }'))
    told = trial_import([path], plan)
    assert told.exit_code == 0
    assert "log.csv is not UTF-8; read as Latin-1" in told.stdout
    named = trial_import([path], plan.replace("[channels]", '[file]\nencoding = "latin-1"\n[channels]'), "--force")
    assert named.exit_code == 0
    assert "is not UTF-8" not in named.stdout
    assert (
        "is not utf-8 text"
        in trial_import([path], plan.replace("[channels]", '[file]\nencoding = "utf-8"\n[channels]'), "--force").stderr
    )


def test_a_gap_splits_and_is_never_bridged(trial_import):
    t = np.r_[np.arange(0, 50, 0.5), np.arange(57.25, 130, 0.5)]
    result = trial_import(logged(t))
    data = load_dataset("out")
    assert [(r.id, r.t[0], r.t[-1]) for r in data.runs] == [("log_001", 0.0, 49.0), ("log_002", 57.25, 129.25)]
    for run in data.runs:
        check_motion(run)
    assert "7.75 s in 1 place: no samples of x (longest pause bridged 3 s)" in result.stdout


def test_a_channel_without_values_splits_and_its_tail_is_cut(trial_import):
    table = logged(T)
    table.loc[(T > 50) & (T < 60), "HDG"] = np.nan
    table.loc[T > 110, "rudder"] = np.nan
    result = trial_import(table)
    assert [(r.t[0], r.t[-1]) for r in load_dataset("out").runs] == [(0.0, 50.0), (60.0, 110.0)]
    assert "no samples of psi" in result.stdout
    assert "no samples of delta" in result.stdout


def test_windows_share_no_sample_and_the_rest_is_told(trial_import):
    result = trial_import(logged(T), None, "--window", "50")
    data = load_dataset("out")
    assert [(r.t[0], r.t[-1]) for r in data.runs] == [(0.0, 50.0), (51.0, 101.0)]
    assert "18 s in 1 place: shorter than 50 s" in result.stdout


def test_a_run_longer_than_the_longest_comes_in_parts_of_one_group(trial_import):
    trial_import(logged(T), mapping(tables="[split]\nlongest = 40.0"))
    data = load_dataset("out")
    assert [(r.t[0], r.t[-1]) for r in data.runs] == [(0.0, 40.0), (41.0, 81.0), (82.0, 120.0)]
    assert {r.meta.group for r in data.runs} == {"log_stretch_001"}
    for run in data.runs:
        check_motion(run)  # also at the cuts: the filter sees beyond them


def test_a_run_column_names_the_runs_and_time_may_start_anew(trial_import):
    table = pd.concat(
        [
            logged(T[:500]).assign(test="ZZ 10/10"),
            logged(T[:400]).assign(test="=1+1"),
            logged(T[:300]).assign(test="ZZ 10/10"),
        ]
    )
    result = trial_import(table, mapping(top='run = "test"'))
    assert result.exit_code == 0, result.output
    assert [r.id for r in load_dataset("out").runs] == [
        "ZZ_10_10",
        "1_1",
        "ZZ_10_10_2",
    ]  # no name is a formula in a spreadsheet


def test_standing_still_is_cut(trial_import):
    table = logged(np.arange(0.0, 400.0, 0.5))
    lying = (table["time"] > 100) & (table["time"] < 300)
    table.loc[lying, ["surge", "sway"]] = 0.01
    result = trial_import(table, None, "--still", "0.5")
    runs = load_dataset("out").runs
    assert len(runs) == 2
    assert runs[0].t[-1] == pytest.approx(100, abs=10)
    assert runs[1].t[0] == pytest.approx(300, abs=10)
    assert "standing still (below 0.5 m/s)" in result.stdout


def test_times_of_day_count_on_over_midnight_and_rows_may_end_with_a_delimiter(trial_import):
    table = logged(T[::5])
    table["time"] = (pd.Timestamp("2024-02-29 23:59:00") + pd.to_timedelta(table["time"], "s")).dt.strftime(
        "%H:%M:%S.%f"
    )
    header, rows = table.to_csv(index=False).split("\n", 1)
    result = trial_import(
        f"{header}\n{rows.replace(chr(10), f',{chr(10)}')}", mapping(time='column = "time"\nformat = "%H:%M:%S.%f"')
    )
    assert result.exit_code == 0, result.output
    run = load_dataset("out").runs[0]
    assert run.meta.from_ == 86_340.0
    check_motion(run, run.t - 86_340.0)


def test_several_files_of_one_layout_are_runs_of_their_own(trial_import, tmp_path):
    paths = [write(tmp_path, f"day {k}.csv", logged(T[: 400 + 100 * k])) for k in range(3)]
    result = trial_import(paths)
    assert result.exit_code == 0, result.output
    assert [r.id for r in load_dataset("out").runs] == ["day_0", "day_1", "day_2"]


SOURCES = """
name = "merged"
dt = 1.0
[sources.gps]
files = "gps*"
antenna = { x = 12.0, y = -1.5 }
[sources.gps.time]
column = "utc"
format = "iso"
[sources.gps.channels]
lat = { column = "lat", unit = "deg" }
lon = { column = "lon", unit = "deg" }
sog = { column = "SOG", unit = "kn" }
cog = { column = "COG", unit = "deg" }
[sources.gyro]
files = "gyro*"
[sources.gyro.time]
column = "t"
format = "unix"
[sources.gyro.channels]
psi = { column = "hdg", unit = "deg" }
r = { column = "rot", unit = "deg/s", sign = "port" }
[sources.rudder]
files = "orders*"
[sources.rudder.time]
column = "t"
format = "unix"
shift = -0.5
[sources.rudder.channels]
delta_c = { column = "order", unit = "deg", sign = "port", gap = inf }
"""


def instruments(folder, end=150.0):
    """GPS at 1 Hz with an antenna ahead of midship, gyro at 10 Hz, rudder orders logged on change with a clock half a
    second fast."""
    start = pd.Timestamp("2024-05-04 10:00:00")
    epoch = start.timestamp()
    t = np.arange(0.0, end, 1.0) + 0.03 * np.sin(np.arange(0.0, end))
    s = motion(t)
    north = s["x"] + 12.0 * np.cos(s["psi"]) + 1.5 * np.sin(s["psi"])
    east = s["y"] + 12.0 * np.sin(s["psi"]) - 1.5 * np.cos(s["psi"])
    u, v = s["u"] + 1.5 * s["r"], s["v"] + 12.0 * s["r"]
    vn, ve = u * np.cos(s["psi"]) - v * np.sin(s["psi"]), u * np.sin(s["psi"]) + v * np.cos(s["psi"])
    lat0 = np.deg2rad(52.0)
    meridian = 6378137.0 * (1 - 0.00669438) / (1 - 0.00669438 * np.sin(lat0) ** 2) ** 1.5
    normal = 6378137.0 / np.sqrt(1 - 0.00669438 * np.sin(lat0) ** 2)
    gps = pd.DataFrame({
        "utc": (start + pd.to_timedelta(t, "s")).strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
        "lat": 52.0 + np.rad2deg(north / meridian),
        "lon": 4.0 + np.rad2deg(east / normal / np.cos(lat0)), "SOG": np.hypot(vn, ve) * 3600 / 1852,
        "COG": np.rad2deg(np.arctan2(ve, vn)) % 360,
    })  # fmt: skip
    t = np.arange(-3.0, end, 0.1)
    g = motion(t)
    gyro = pd.DataFrame({"t": epoch + t, "hdg": np.rad2deg(g["psi"]) % 360, "rot": -np.rad2deg(g["r"])})
    t = np.arange(0.0, end, 20.0)
    orders = pd.DataFrame({"t": epoch + t + 0.5, "order": -np.rad2deg(motion(t)["delta_c"])})
    return [
        write(folder, name, table) for name, table in (("gps1.csv", gps), ("gyro.csv", gyro), ("orders.csv", orders))
    ]


def test_gps_gyro_and_rudder_at_their_own_rates_are_merged_on_time(trial_import, tmp_path):
    result = trial_import(instruments(tmp_path), SOURCES)
    assert result.exit_code == 0, result.output
    data = load_dataset("out")
    run = data.runs[0]
    assert data.actuators == "commanded"
    at = run.t - 3.0  # the gyro began 3 s before the rest; time counts from the first sample
    truth = motion(at)
    # Position is relative to where the antenna was first, which is where the plane touches the earth.
    first = motion(at[:1])
    moved = np.array(
        [
            first["x"] + 12 * np.cos(first["psi"]) + 1.5 * np.sin(first["psi"]),
            first["y"] + 12 * np.sin(first["psi"]) - 1.5 * np.cos(first["psi"]),
        ]
    )
    np.testing.assert_allclose(run.states[:, :2], np.column_stack([truth["x"], truth["y"]]) - moved.T, atol=0.1)
    check_motion(run, at, names=("psi", "r"))
    # 1 Hz with jitter, interpolated; the motion is a sine of 25 s
    np.testing.assert_allclose(run.states[:, 3], truth["u"], atol=0.02)
    np.testing.assert_allclose(run.states[:, 4], truth["v"], atol=0.02)
    np.testing.assert_allclose(run.inputs[:-1, 1], truth["delta_c"][:-1], atol=1e-6)
    assert run.meta.origin.lat == pytest.approx(52.0, abs=0.01)
    for told in ("u, v from sog, cog and psi (over ground)", "x, y from lat, lon", "antenna at x = 12 m, y = -1.5 m"):
        assert told in result.stdout
        assert any(told in note for note in data.notes)


def test_apparent_wind_becomes_true_wind(trial_import):
    table = logged(T)
    s = motion(T)
    wind, come_from = 9.0, 0.3
    ahead = wind * np.cos(come_from - s["psi"]) + s["u"]
    abeam = wind * np.sin(come_from - s["psi"]) + s["v"]
    table["AWS"], table["AWA"] = np.hypot(ahead, abeam), np.rad2deg(np.arctan2(abeam, ahead)) % 360
    extra = {
        "apparent_wind_speed": '{ column = "AWS", unit = "m/s" }',
        "apparent_wind_from": '{ column = "AWA", unit = "deg" }',
    }
    result = trial_import(table, mapping(body=channels(**extra)))
    assert result.exit_code == 0, result.output
    data = load_dataset("out")
    assert data.inputs[4:] == ("wind_speed", "wind_from")
    np.testing.assert_allclose(data.runs[0].inputs[:, 4], wind, atol=0.02)
    np.testing.assert_allclose(np.cos(data.runs[0].inputs[:, 5] - come_from), 1.0, atol=1e-4)


def test_slow_and_fast_channels_in_one_file_with_empty_cells(trial_import):
    table = logged(T)
    table.loc[np.arange(len(T)) % 10 != 0, ["north", "east"]] = np.nan
    table.loc[np.arange(len(T)) % 5 != 2, ["rudder", "rudder order"]] = np.nan
    result = trial_import(table)
    assert result.exit_code == 0, result.output
    run = load_dataset("out").runs[0]
    assert run.t[0] == pytest.approx(0.2)
    check_motion(run, names=("psi", "u", "v", "r", "delta"))
    check_motion(run, names=("x", "y"), atol=5e-3)  # 1 Hz, interpolated over a fifth of a second


def test_stamps_at_whole_seconds_are_spread_when_asked_for(trial_import):
    table = logged(T)
    table["time"] = np.floor(table["time"] + 1e-9)
    refused = trial_import(table)
    assert refused.exit_code == 2
    assert 'repeated = "spread"' in refused.stderr
    result = trial_import(table, mapping(time='column = "time"\nrepeated = "spread"'))
    assert result.exit_code == 0, result.output
    check_motion(load_dataset("out").runs[0])


def test_a_row_that_repeats_a_time_with_other_channels_is_kept(trial_import):
    table = logged(T[::5])
    a, b = table.copy(), table.copy()
    a[["HDG", "ROT"]] = np.nan
    b[[c for c in b if c not in ("time", "HDG", "ROT")]] = np.nan
    trial_import(pd.concat([a, b]).sort_values("time", kind="stable"))
    check_motion(load_dataset("out").runs[0])


@pytest.mark.long
def test_the_size_of_the_blocks_does_not_change_the_result(trial_import, monkeypatch):
    t = np.r_[np.arange(0, 700, 0.5), np.arange(720, 1500, 0.5)]
    plan = mapping(body=channels("u", "v", "r"), tables="[split]\nlongest = 200.0")
    trial_import(logged(t), plan)
    whole = load_dataset("out")
    assert len(whole) == 8
    monkeypatch.setattr("shipbench.importing.delimited.TEXT_BLOCK", 4000)
    trial_import(logged(t), plan, "--force")
    assert load_dataset("out").fingerprint == whole.fingerprint


def test_json_is_one_document_and_quiet_is_quiet(trial_import):
    result = trial_import(logged(T), None, "--json", "-q")
    document = json.loads(result.stdout)
    assert result.stderr == ""
    assert document["runs"][0] == {
        "id": "log",
        "seconds": 120.0,
        "samples": 121,
        "file": "log.csv",
        "from": 0.0,
        "to": 120.0,
    }
    assert document["table"] == "trajectories.csv"
    quiet = trial_import(logged(T), None, "-q", "--force")
    assert quiet.stderr == ""
    assert quiet.stdout.count("\n") == 3  # the data set, what was written, what to type next
    assert "Written: out" in quiet.stdout


def test_large_data_are_parquet(trial_import, monkeypatch):
    monkeypatch.setattr("shipbench.importing.writer.CSV_ROWS", 100)
    assert "trajectories.parquet" in trial_import(logged(T)).stdout
    check_motion(load_dataset("out").runs[0])


def test_name_dt_and_shortest_of_the_mapping_can_be_replaced(trial_import):
    trial_import(logged(T), None, "--name", "other", "--dt", "0.5", "--shortest", "10")
    data = load_dataset("out")
    assert (data.name, data.dt, len(data.runs[0])) == ("other", 0.5, 241)
