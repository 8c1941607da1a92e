"""A simulated data set, written as the instruments of another ship would log it, imported and compared with what it
was.

Three files with clocks, rates, units and signs of their own; an antenna off midship; two runs an hour apart; a receiver
that fails; noise.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.interpolate import CubicSpline
from trial import write

from shipbench.data.base import load_dataset
from shipbench.importing.mapping import load_mapping
from shipbench.physics.mmg import load_mmg_ship
from shipbench.signals import STATES, wrap_angle
from shipbench.simulate.harbour import draw_plan, fly

START = pd.Timestamp(
    "2024-10-27 00:20:00", tz="UTC"
)  # the clocks of Amsterdam are put back at 01:00 UTC, between the two runs
LENGTH, PAUSE = 240, 3600.0
LOST = (120.0, 150.0)  # of the second run, without positions
ANTENNA = (-40.0, 3.0)
LAT, LON = np.deg2rad(51.9), np.deg2rad(4.05)
A, E2 = 6378137.0, 0.0066943799901413165  # WGS84

MAPPING = """
name = "round trip"
dt = 1.0
origin = {{ lat = 51.9, lon = 4.05 }}
[sources.gps]
files = "gps*"
missing = [-9999]
antenna = {{ x = -40.0, y = 3.0 }}
time = {{ columns = ["day", "local"], format = "%d.%m.%Y %H:%M:%S.%f%z" }}
file = {{ delimiter = ";", decimal = ",", header = 2, skip = 1 }}
[sources.gps.channels]
lat = {{ column = "Breite", unit = "deg" }}
lon = {{ column = "Laenge", unit = "deg", sign = "west" }}
{speeds}
[sources.gyro]
files = "gyro*"
time = {{ column = "epoch", format = "unix_ms", shift = -0.3 }}
[sources.gyro.channels]
psi = {{ column = "heading", unit = "deg", sign = "counterclockwise" }}
{rate}
[sources.engine]
files = "engine*"
time = {{ column = "date", format = "excel" }}
channels.n = {{ column = "shaft", unit = "rev/s" }}
channels.delta = {{ column = "rudder", unit = "deg", sign = "port" }}
channels.F_b = {{ column = "bow", unit = "kN", sign = "port" }}
channels.F_s = {{ column = "stern", unit = "tf" }}
channels.n_c = {{ column = "telegraph", unit = "rpm", gap = inf }}
channels.delta_c = {{ column = "order", unit = "rad", sign = "port", gap = inf }}
"""
SPEEDS = 'sog = { column = "SOG", unit = "kn" }\ncog = { column = "COG", unit = "deg" }'
RATE = 'r = { column = "ROT", unit = "deg/min", sign = "port" }'


def geodetic(north: np.ndarray, east: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Latitude and longitude [rad] of points in the plane that touches the ellipsoid at LAT, LON, by iteration
    (Hofmann-Wellenhof)."""
    normal = A / np.sqrt(1 - E2 * np.sin(LAT) ** 2)
    x = normal * np.cos(LAT) - north * np.sin(
        LAT
    )  # in the meridian plane of the origin, then turned about the axis of the earth
    z = normal * (1 - E2) * np.sin(LAT) + north * np.cos(LAT)
    across = np.hypot(x, east)
    lat = np.full_like(north, LAT)
    for _ in range(6):
        n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
        lat = np.arctan2(z + E2 * n * np.sin(lat), across)
    return lat, LON + np.arctan2(east, x)


@pytest.fixture(scope="module")
def simulated() -> tuple[np.ndarray, np.ndarray]:
    """States (2, LENGTH + 1, 10) and commands (2, LENGTH + 1, 4) at 1 s."""
    ship, rng = load_mmg_ship("container130"), np.random.default_rng(11)
    return fly(ship, draw_plan(rng, 2, ship.L, LENGTH, 30), rng, LENGTH, 30)


def instruments(folder, states: np.ndarray, commands: np.ndarray, noise: float):
    """The three files. Between the samples the motion is a spline; at whole seconds it is the simulated one."""
    rng = np.random.default_rng(3)
    parts: dict[str, list[pd.DataFrame]] = {"gps": [], "gyro": [], "engine": []}
    for k, run in enumerate(states):
        zero, motion = START + pd.Timedelta(PAUSE * k, "s"), CubicSpline(np.arange(LENGTH + 1.0), run)
        t = np.clip(
            np.sort(np.arange(0.0, LENGTH + 0.1, 0.2) + rng.uniform(-0.05, 0.05, 5 * LENGTH + 1)), 0.0, LENGTH
        ).round(3)
        x, y, psi, u, v, r = motion(t)[:, :6].T
        north = x + ANTENNA[0] * np.cos(psi) - ANTENNA[1] * np.sin(psi) + noise * rng.standard_normal(len(t))
        east = y + ANTENNA[0] * np.sin(psi) + ANTENNA[1] * np.cos(psi) + noise * rng.standard_normal(len(t))
        u, v = u - r * ANTENNA[1], v + r * ANTENNA[0]
        vn, ve = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
        lat, lon = geodetic(north, east)
        local = (zero + pd.to_timedelta(t, "s")).tz_convert("Europe/Amsterdam")
        gps = pd.DataFrame({
            "Breite": np.rad2deg(lat).round(8), "Laenge": -np.rad2deg(lon).round(8),
            "SOG": np.hypot(vn, ve) * 3600 / 1852,
            "COG": np.rad2deg(np.arctan2(ve, vn)) % 360, "local": local.strftime("%H:%M:%S.%f%z"),
            "day": local.strftime("%d.%m.%Y"),
        })  # fmt: skip
        if k == 1:
            gps.loc[(t > LOST[0]) & (t < LOST[1]), ["Breite", "Laenge"]] = -9999.0
        t = np.arange(0.0, LENGTH + 0.05, 0.1)
        s = motion(t)
        gyro = pd.DataFrame(
            {
                "epoch": ((zero.timestamp() + t + 0.3) * 1000).round().astype(np.int64),
                "heading": -np.rad2deg(s[:, 2]) % 360,
            }
        )
        gyro["ROT"] = -np.rad2deg(s[:, 5]) * 60.0
        s, c, days = run, commands[k], (zero.timestamp() + np.arange(LENGTH + 1.0)) / 86400 + 25569
        changed = np.r_[True, np.any(np.diff(c[:, :2], axis=0) != 0.0, axis=1)]
        order = np.where(changed[:, None], c[:, :2], np.nan)  # logged on change
        engine = pd.DataFrame({
            "date": days, "shaft": s[:, 6] / 60, "rudder": -np.rad2deg(s[:, 7]), "bow": -s[:, 8] / 1e3,
            "stern": s[:, 9] / 9806.65,
            "telegraph": order[:, 0], "order": -order[:, 1],
        })  # fmt: skip
        for name, part in (("gps", gps), ("gyro", gyro), ("engine", engine)):
            parts[name].append(part)
    table = pd.concat(parts["gps"]).to_csv(index=False, sep=";", decimal=",").split("\n", 1)
    paths = [write(folder, "gps.txt", f"Empfaenger 7; Brücke\n{table[0]}\ndeg;deg;kn;deg;;\n{table[1]}")]
    for name, ending in (("gyro", "parquet"), ("engine", "xlsx")):
        path = folder / f"{name}.{ending}"
        whole = pd.concat(parts[name], ignore_index=True)
        whole.to_parquet(path) if ending == "parquet" else whole.to_excel(path, index=False)
        paths.append(path)
    return paths


def errors(run, states: np.ndarray, commands: np.ndarray) -> dict[str, np.ndarray]:
    """Differences from the simulated signals at the same moments; the runs begin between the simulation's samples,
    where the receiver does.

    Motion by the spline that the instruments saw, the actuators by their samples at 1 Hz, commands held from second to
    second.
    """
    k, first = divmod((pd.Timestamp(run.meta.from_) - START).total_seconds(), PAUSE)
    assert k in (0, 1)
    at, seconds = first + run.t - run.t[0], np.arange(LENGTH + 1.0)
    motion = CubicSpline(seconds, states[int(k)])(at)[:, :6]
    actuators = np.column_stack([np.interp(at, seconds, column) for column in states[int(k)][:, 6:].T])
    second, part = np.divmod(at[:-1] + 1e-6, 1.0)
    held = commands[int(k)][:, :2]
    means = (1 - part)[:, None] * held[second.astype(int)] + part[:, None] * held[
        np.minimum(second.astype(int) + 1, LENGTH)
    ]
    found = dict(zip(STATES, (run.states - np.hstack([motion, actuators])).T, strict=True))
    found["psi"] = wrap_angle(found["psi"])  # a compass does not count turns
    return found | dict(zip(("n_c", "delta_c"), (run.inputs[:-1, :2] - means).T, strict=True))


# largest error of any sample, without noise; heading, position and speed at 5 and 10 Hz, the engine at 1 Hz
TOLERANCES = {
    "x": 0.02, "y": 0.02, "psi": np.deg2rad(0.02), "u": 0.002, "v": 0.002, "r": np.deg2rad(0.01), "n": 1e-3,
    "delta": 1e-5, "F_b": 1.0, "F_s": 1.0,
    "n_c": 1e-3, "delta_c": 1e-5,
}  # fmt: skip


def test_measured_speeds_come_back(trial_import, tmp_path, simulated):
    states, commands = simulated
    result = trial_import(instruments(tmp_path, states, commands, 0.0), MAPPING.format(speeds=SPEEDS, rate=RATE))
    assert result.exit_code == 0, result.output
    data = load_dataset("out")
    assert data.derived == ()
    assert [run.t[-1] - run.t[0] for run in data.runs] == pytest.approx([LENGTH, 120, 90], abs=1.5)
    for run in data.runs:
        for name, error in errors(run, states, commands).items():
            assert np.abs(error).max() < TOLERANCES[name], (run.id, name)


def test_the_readmes_mapping_is_accepted(tmp_path):
    block = re.search(r"```toml\n(.*?)```", (Path(__file__).parents[2] / "docs/import-a-log.md").read_text(), re.DOTALL)
    assert block is not None
    plan = load_mapping(write(tmp_path, "mapping.toml", block[1]))
    assert (plan.name, plan.dt, plan.split.window) == ("my_trial", 1.0, 300.0)
    assert set(plan.sources["log"].channels) == {"lat", "lon", "psi", "n", "delta"}


def test_derived_speeds_agree_within_the_stated_tolerance(trial_import, tmp_path, simulated):
    """0.1 m of noise at 5 Hz: a difference of samples would be wrong by 0.7 m/s."""
    states, commands = simulated
    result = trial_import(instruments(tmp_path, states, commands, 0.1), MAPPING.format(speeds="", rate=""))
    assert result.exit_code == 0, result.output
    assert "u, v from x, y and psi by a cubic smoothing spline" in result.stdout
    data = load_dataset("out")
    assert data.derived == ("u", "v", "r")
    assert len(data.runs) == 3
    every = [errors(run, states, commands) for run in data.runs]
    for name, within, worst in (
        ("u", 0.015, 0.08),
        ("v", 0.015, 0.08),
        ("r", np.deg2rad(0.005), np.deg2rad(0.05)),
    ):  # r.m.s. and largest, m/s, rad/s
        error = np.concatenate([e[name] for e in every])
        assert np.sqrt(np.mean(error**2)) < within, name
        assert np.abs(error).max() < worst, name
