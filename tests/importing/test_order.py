"""Rows out of order, ships that share a log, and clocks that were set: sorted, split or refused, never joined
wrongly."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from every_day import every
from trial import channels, logged, mapping, motion, write

from shipbench import load_dataset
from shipbench.importing import ordering, recordings
from shipbench.importing.blocks import Block
from shipbench.importing.cells import Counts
from shipbench.importing.mapping import Source
from shipbench.importing.steps import steps_marked
from shipbench.importing.thresholds import THRESHOLDS

T = np.arange(0.0, 180.5, 0.5)
SECONDS = np.arange(0.0, 181.0)


def log_with_clock(stamps: np.ndarray, true: np.ndarray, noise: float = 0.0) -> pd.DataFrame:
    """The trial as sampled at the true times, with the stamps of another clock."""
    table = logged(true).assign(time=stamps)
    for name in ("north", "east"):
        table[name] += noise * np.random.default_rng(1).normal(size=len(true))
    return table


def greatest_leap(data) -> float:
    """Longest way [m] within a sample of any run; the ship makes 4.4 m/s at most."""
    return max(float(np.hypot(*np.diff(run.states[:, :2], axis=0).T).max()) for run in data.runs)


def backwards(how: str, more: str = "") -> str:
    return mapping(time=f'column = "time"\nbackwards = "{how}"\n{more}')


@pytest.mark.parametrize(("step", "rate"), [(1.0, 1.0), (1.0, 2.0), (2.0, 1.0), (5.0, 2.0), (60.0, 1.0)])
@pytest.mark.parametrize("how", ["drop", "split", "sort"])
def test_a_clock_that_was_set_back_is_joined_nowhere(trial_import, how, step, rate):
    true = np.arange(0.0, 180.1, 1.0 / rate)
    result = trial_import(log_with_clock(np.where(true > 90.0, true - step, true), true), backwards(how))
    assert result.exit_code == 0, result.output
    data = load_dataset("out")
    assert [r.id for r in data.runs] == ["log", "log_2"]
    assert greatest_leap(data) < 4.7
    assert len({r.meta.group for r in data.runs}) == 1  # the ship went on: never in two folds
    assert "the clock was set back" in result.stdout
    for run, zero in zip(data.runs, (0.0, step), strict=True):
        np.testing.assert_allclose(run.states[:, 0], motion(run.t + zero)["x"], atol=0.05)


def test_a_clock_that_was_set_back_by_one_sample_is_found_where_nothing_is_said(trial_import):
    result = trial_import(log_with_clock(np.where(SECONDS > 90, SECONDS - 1, SECONDS), SECONDS))
    assert result.exit_code == 0, result.output
    assert len(load_dataset("out").runs) == 2
    assert greatest_leap(load_dataset("out")) < 4.7


def test_time_that_goes_back_is_refused_with_what_may_be_set(trial_import):
    result = trial_import(log_with_clock(np.where(SECONDS > 90, SECONDS - 4, SECONDS), SECONDS))
    assert result.exit_code == 2
    for word in ('"sort"', '"drop"', '"split"', "from 90 s to 87 s"):
        assert word in result.stderr


@pytest.mark.parametrize("noise", [0.0, 0.5])
@pytest.mark.parametrize("kind", ["one row", "a burst", "sent again", "shuffled"])
@pytest.mark.parametrize("how", ["drop", "sort"])
def test_late_rows_are_no_clock_that_was_set_back(trial_import, how, kind, noise):
    order = {
        "one row": np.r_[:50, 51:54, 50, 54:361], "a burst": np.r_[:50, 53:56, 50:53, 56:361],
        "sent again": np.r_[:60, 50:361],
        "shuffled": np.r_[:20, 20 + np.argsort(np.arange(341) + np.random.default_rng(0).uniform(0, 4, 341))],
    }[kind]  # fmt: skip
    table = log_with_clock(T, T, noise).iloc[order]
    result = trial_import(table, backwards(how))
    assert result.exit_code == 0, result.output
    (run,) = load_dataset("out").runs
    assert "clock was set back" not in result.stdout
    np.testing.assert_allclose(run.states[:, 0], motion(run.t)["x"], atol=0.2 + 3 * noise)
    if how == "sort":
        assert run.t[-1] == 180.0
        assert "rows sorted by time" in result.stdout


def test_rows_of_instruments_one_after_another_are_sorted(trial_import):
    table = logged(T)
    first = table.assign(HDG=np.nan, rpm=np.nan, rudder=np.nan, ROT=np.nan)
    second = table.assign(north=np.nan, east=np.nan, surge=np.nan, sway=np.nan, **{"rudder order": np.nan})
    result = trial_import(pd.concat([first, second]), backwards("sort"))
    assert result.exit_code == 0, result.output
    (run,) = load_dataset("out").runs
    assert run.t[-1] == 180.0


def test_more_rows_than_are_sorted_in_memory_are_refused(trial_import, monkeypatch):
    row = THRESHOLDS.rows["readings_in_memory"]
    monkeypatch.setitem(THRESHOLDS.rows, row.name, replace(row, value=1000))
    result = trial_import(logged(T), backwards("sort"))
    assert result.exit_code == 2
    assert "Sort the file itself" in result.stderr


@pytest.mark.parametrize("context", [40, 5000])
def test_blocks_of_any_size_give_the_same(trial_import, monkeypatch, context):
    monkeypatch.setattr(ordering, "CONTEXT", context)
    result = trial_import(log_with_clock(np.where(T > 90.0, T - 4.0, T), T), backwards("drop"))
    assert result.exit_code == 0, result.output
    assert [(r.t[0], r.t[-1]) for r in load_dataset("out").runs] == [(0.0, 90.0), (86.5, 175.5)]


def test_a_ship_at_rest_shows_nothing_and_the_stamps_decide(trial_import):
    still = logged(T).assign(north=5.0, east=7.0, surge=0.0, sway=0.0)
    result = trial_import(still.assign(time=np.where(T > 90, T - 4.0, T)), backwards("drop"))
    assert len(load_dataset("out").runs) == 2, result.output
    late = still.iloc[np.r_[:50, 51:54, 50, 54:361]]
    trial_import(late, backwards("drop"), "--force")
    assert len(load_dataset("out").runs) == 1


@pytest.mark.parametrize("ahead", [1.0, 1.5, 2.0])
@pytest.mark.parametrize(("rate", "noise"), [(1.0, 0.0), (1.0, 0.3), (10.0, 0.1)])
@pytest.mark.parametrize("speeds", [True, False])
def test_a_clock_that_steps_ahead_in_a_pause_is_joined_nowhere(trial_import, ahead, rate, noise, speeds):
    true = np.arange(0.0, 180.1, 1.0 / rate)
    table = log_with_clock(np.where(true > 90.0, true + ahead, true), true, noise)
    plan = mapping() if speeds else mapping(body=channels("u", "v"))
    result = trial_import(table, plan)
    assert result.exit_code == 0, result.output
    data = load_dataset("out")
    assert len(data.runs) == 2, result.stdout
    assert len({r.meta.group for r in data.runs}) == 1
    (found,) = re.findall(r"stepped ahead by about ([\d.]+) s", result.stdout)
    assert float(found) == pytest.approx(ahead, abs=0.05 + noise)


@pytest.mark.parametrize("back", [2.0, 4.0])
def test_a_clock_that_was_set_back_within_a_pause_is_found(trial_import, back):
    true = np.r_[np.arange(0.0, 90.5), np.arange(96.0, 181.0)]
    result = trial_import(
        log_with_clock(np.where(true > 90.0, true - back, true), true), mapping(tables="[split]\ngap = 5.0")
    )
    assert len(load_dataset("out").runs) == 2, result.stdout
    assert "stepped back by about" in result.stdout


@pytest.mark.parametrize("pause", [1.0, 2.0, 8.0, 25.0])
@pytest.mark.parametrize("at", every(3, [20.0, 39.0, 60.0, 90.0, 110.0]))
@pytest.mark.parametrize(("rate", "noise"), [(1.0, 0.0), (1.0, 1.0), (10.0, 0.3)])
def test_a_plain_pause_stays_one(trial_import, pause, at, rate, noise):
    true = np.arange(0.0, 180.1, 1.0 / rate)
    table = log_with_clock(true, true, noise)[(true <= at) | (true > at + pause)]
    result = trial_import(table, mapping(tables="[split]\ngap = 30.0", body=channels("u", "v")))
    assert len(load_dataset("out").runs) == 1, result.stdout
    assert "clock" not in result.stdout


@pytest.mark.parametrize("speeds", [True, False])
@pytest.mark.parametrize("correlation", [0.0, 20.0])
@pytest.mark.parametrize("kind", ["lost rows", "reports"])
def test_thousands_of_plain_pauses_are_no_steps(kind, correlation, speeds):
    """Positions with errors of 2 m, white or lasting for 20 s, at rows that are lost by chance, or at intervals as of
    AIS reports."""
    rng = np.random.default_rng(0)
    t = np.arange(4000.0)
    t = t[rng.uniform(size=len(t)) > 0.3] if kind == "lost rows" else np.cumsum(rng.choice([2.0, 3.0, 6.0, 10.0], 800))
    s, error = motion(t), rng.normal(size=(len(t), 2)) * 2.0
    for k in range(1, len(t)) if correlation else ():
        keep = np.exp(-(t[k] - t[k - 1]) / correlation)
        error[k] = keep * error[k - 1] + np.sqrt(1.0 - keep**2) * error[k]
    names = ("x", "y", "psi", *(("u", "v") if speeds else ()))
    values = np.column_stack([s["x"] + error[:, 0], s["y"] + error[:, 1], *(s[name] for name in names[2:])])
    channels_of = {
        name: {"column": name, "unit": {"psi": "rad", "u": "m/s", "v": "m/s"}.get(name, "m")} for name in names
    }
    source = Source.model_validate({"time": {"column": "t"}, "channels": channels_of})
    met = Counts()
    assert sum(len(b.t) for b in steps_marked([Block(t, values)], source, 60.0, met)) == len(t)
    assert met.clock == []


def test_a_leap_of_the_position_in_a_pause_is_no_clock(trial_import):
    table = logged(SECONDS)[(SECONDS <= 90) | (SECONDS > 92)]
    psi = motion(np.array([90.0]))["psi"][0]
    table.loc[SECONDS[table.index] > 90, ["north", "east"]] += 12.0 * np.array([-np.sin(psi), np.cos(psi)])
    result = trial_import(table)
    assert "clock" not in result.stdout


def test_rounded_stamps_that_repeat_now_and_again_are_no_clock(trial_import):
    true = np.arange(0.0, 300.0, 0.98)
    result = trial_import(log_with_clock(np.floor(true), true))
    assert result.exit_code == 0, result.output
    assert len(load_dataset("out").runs) == 1


def test_a_leap_second_is_reported_and_joined_nowhere(trial_import):
    stamps = pd.date_range("2016-12-31 23:58:30", periods=180, freq="s").strftime("%Y-%m-%dT%H:%M:%SZ").tolist()
    table = logged(SECONDS).assign(time=[*stamps[:90], "2016-12-31T23:59:60Z", *stamps[90:]])
    result = trial_import(table, mapping(time='column = "time"\nformat = "iso"'))
    assert result.exit_code == 0, result.output
    assert "leap second: the stamp '2016-12-31T23:59:60Z'" in result.stdout
    assert len(load_dataset("out").runs) == 2
    assert greatest_leap(load_dataset("out")) < 4.7


def fleet(ships: int, rows: int = 120) -> pd.DataFrame:
    """Ships on courses of their own, their rows interleaved."""
    tables = []
    for k in range(ships):
        tables.append(
            logged(np.arange(rows) + 0.1 * k).assign(mmsi=244_000_000 + k, north=lambda d, k=k: d["north"] + 500.0 * k)
        )
    return pd.concat(tables).sort_values("time", kind="stable")


@pytest.mark.parametrize("ships", [2, 7])
def test_ships_that_share_a_log_become_a_run_each(trial_import, ships):
    result = trial_import(fleet(ships), mapping(top='run = "mmsi"'))
    assert result.exit_code == 0, result.output
    data = load_dataset("out")
    assert [r.id for r in data.runs] == [f"{244_000_000 + k}" for k in range(ships)]
    for k, run in enumerate(data.runs):
        np.testing.assert_allclose(run.states[:, 0], motion(run.t)["x"] + 500.0 * k, atol=0.05)


def test_ships_that_share_a_log_are_gathered_over_blocks(trial_import, monkeypatch, tmp_path):
    monkeypatch.setattr(recordings, "ROWS", 17)
    fleet(3).to_parquet(tmp_path / "log.parquet", row_group_size=10)
    result = trial_import([tmp_path / "log.parquet"], mapping(top='run = "mmsi"'))
    assert result.exit_code == 0, result.output
    assert [len(r.t) for r in load_dataset("out").runs] == [120, 120, 120]


def test_ships_that_share_a_log_with_late_rows_are_sorted_each(trial_import):
    table = fleet(2).iloc[np.argsort(np.arange(240) + np.random.default_rng(0).uniform(0, 9, 240))]
    refused = trial_import(table, mapping(top='run = "mmsi"'))
    assert refused.exit_code == 2
    result = trial_import(table, mapping(top='run = "mmsi"', time='column = "time"\nbackwards = "sort"'))
    assert result.exit_code == 0, result.output
    assert len(load_dataset("out").runs) == 2


def test_a_source_whose_clock_was_set_back_is_merged_without_joining(trial_import, tmp_path):
    table = logged(SECONDS)
    gps = table[["time", "north", "east", "HDG"]].assign(time=np.where(SECONDS > 90, SECONDS - 4, SECONDS))
    logs = [write(tmp_path, "gps.csv", gps), write(tmp_path, "bridge.csv", table[["time", "rpm", "rudder"]])]
    result = trial_import(logs, """
name = "trial"
dt = 1.0
[sources.gps]
files = "gps.csv"
time = { column = "time", backwards = "drop" }
channels.x = { column = "north", unit = "m" }
channels.y = { column = "east", unit = "m" }
channels.psi = { column = "HDG", unit = "deg" }
[sources.bridge]
files = "bridge.csv"
time = { column = "time" }
channels = { n = { column = "rpm", unit = "rpm" }, delta = { column = "rudder", unit = "deg" } }
""")  # fmt: skip
    assert result.exit_code == 0, result.output
    data = load_dataset("out")
    assert len(data.runs) == 2
    assert greatest_leap(data) < 4.7
    assert [(a.t[-1], b.t[0]) for a, b in itertools.pairwise(data.runs)] == [(90.0, 91.0)]
