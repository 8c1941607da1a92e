"""Positions that a fast log repeats between the fixes of a slow receiver."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from trial import channels, logged, mapping, motion

from shipbench import load_dataset

T = np.arange(0.0, 180.05, 0.1)
POSITION = {"lat": '{ column = "lat", unit = "deg" }', "lon": '{ column = "lon", unit = "deg" }'}


def held(times: np.ndarray, every: float, late: float = 0.0) -> np.ndarray:
    """Times of the fixes that are in the log at `times`."""
    return np.maximum(np.floor((times - late) / every + 1e-6) * every, 0.0)


def body(*names: str) -> str:
    """[channels] without x and y."""
    return channels("x", "y", *names, **POSITION)


def with_positions(table: pd.DataFrame, t_lat: np.ndarray, t_lon: np.ndarray, digits: int = 9) -> pd.DataFrame:
    lat = np.round(52.0 + np.rad2deg(motion(t_lat)["x"] / 6_371_000.0), digits)
    lon = np.round(4.0 + np.rad2deg(motion(t_lon)["y"] / 6_371_000.0 / np.cos(np.deg2rad(52.0))), digits)
    return table.assign(lat=lat, lon=lon)


@pytest.mark.parametrize("every", [0.2, 0.5, 1.0, 2.0])
def test_only_rows_where_the_fix_changes_are_taken(trial_import, every):
    table = logged(T)
    fix = motion(held(T, every))
    result = trial_import(table.assign(north=fix["x"], east=fix["y"]), mapping(top="dt = 0.5", body=channels("u", "v")))
    assert result.exit_code == 0, result.output
    assert f"x, y are held between fixes, which come every {every:g} s" in result.stdout
    (run,) = load_dataset("out").runs
    for column, name in enumerate("xy"):
        np.testing.assert_allclose(run.states[:, column], motion(run.t)[name], atol=0.12)


def test_fixes_that_come_with_jitter(trial_import):
    rng = np.random.default_rng(3)
    at = np.cumsum(rng.integers(8, 13, 200))
    which = np.searchsorted(at, np.arange(len(T)), side="right")
    fix = motion(np.r_[0.0, T[np.minimum(at, len(T) - 1)]][which])
    result = trial_import(
        logged(T).assign(north=fix["x"], east=fix["y"]), mapping(top="dt = 0.5", body=channels("u", "v"))
    )
    (run,) = load_dataset("out").runs
    np.testing.assert_allclose(run.states[:, 0], motion(run.t)["x"], atol=0.2)
    assert "held between fixes" in result.stdout


@pytest.mark.parametrize("lag", [0.1, 0.3, 0.5])
def test_latitude_and_longitude_that_are_renewed_in_different_rows(trial_import, lag):
    table = with_positions(logged(T), held(T, 1.0), held(T - lag, 1.0) + lag * (lag <= T))
    result = trial_import(table, mapping(top="dt = 0.5", body=body("u", "v")))
    assert result.exit_code == 0, result.output
    assert "lat, lon are held between fixes" in result.stdout
    (run,) = load_dataset("out").runs
    s = motion(run.t)
    for column, name in enumerate("xy"):
        np.testing.assert_allclose(run.states[:, column] - run.states[0, column], s[name] - s[name][0], atol=0.4)
    step = np.hypot(*np.diff(run.states[:, :2], axis=0).T)
    np.testing.assert_allclose(step, np.hypot(s["u"], s["v"])[1:] * 0.5, atol=0.15)


def test_what_the_receiver_gives_beside_the_position_is_taken_with_it(trial_import):
    fix = logged(held(T, 1.0))
    table = logged(T).assign(north=fix["north"], east=fix["east"], surge=fix["surge"], sway=fix["sway"])
    trial_import(table, mapping(top="dt = 0.5"))
    (run,) = load_dataset("out").runs
    np.testing.assert_allclose(run.states[:, 4], motion(run.t)["v"], atol=0.002)
    np.testing.assert_allclose(run.states[:, 5], motion(run.t)["r"], atol=0.0005)  # it has a sensor of its own


@pytest.mark.parametrize("digits", [5, 6])
def test_coarse_positions_are_not_held(trial_import, digits):
    result = trial_import(with_positions(logged(T), T, T, digits), mapping(body=body("u", "v")))
    assert result.exit_code == 0, result.output
    assert "held" not in result.stdout


def test_single_precision_is_not_held(trial_import):
    table = with_positions(logged(T[::5]), T[::5], T[::5]).astype({"lat": "float32", "lon": "float32"})
    result = trial_import(table, mapping(body=body("u", "v")))
    assert "held" not in result.stdout


def test_a_receiver_that_freezes_and_leaps_stays_in_the_log(trial_import):
    seconds = np.arange(0.0, 181.0)
    table = logged(seconds)
    table.loc[100:119, ["north", "east"]] = table.loc[100, ["north", "east"]].to_numpy()
    result = trial_import(table)
    assert "held" not in result.stdout
    (run,) = load_dataset("out").runs
    assert np.ptp(run.states[100:120, 0]) == 0.0


def test_a_ship_that_lies_still_before_it_moves_keeps_its_berth(trial_import):
    fix = motion(held(np.maximum(T - 60.0, 0.0), 1.0))
    table = logged(np.maximum(T - 60.0, 0.0)).assign(time=T, north=fix["x"], east=fix["y"])
    table.loc[T < 60.0, ["surge", "sway"]] = 0.0
    trial_import(table, mapping())
    (run,) = load_dataset("out").runs
    assert (run.t[0], run.t[-1]) == (0.0, pytest.approx(180.0, abs=1.0))
