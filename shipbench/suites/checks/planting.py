"""Planting of faults into clean data sets, in the table and dataset.toml as a user would provide them.

Sizes are those of a ship of 130 m; lengths go with L, times and speeds with sqrt(L/130).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ...physics.wind import KINDS
from ...records import Dataset
from ...signals import wrap_angle

DEG, KNOT = 180.0 / np.pi, 3600.0 / 1852.0


@dataclass
class Planting:
    """Clean set to be changed: table, keys of dataset.toml, scales of length and time against 130 m, dt [s], random
    numbers."""

    table: pd.DataFrame
    toml: dict[str, Any]
    length: float
    time: float
    dt: float
    rng: np.random.Generator

    @property
    def ids(self) -> list[str]:
        """Names of the runs."""
        return list(self.table["trajectory"].unique())

    def rows(self, run: str) -> np.ndarray:
        """Labels of a run's rows."""
        return self.table.index[self.table["trajectory"] == run].to_numpy()

    def pick(self, number: int) -> list[str]:
        """Draw some runs."""
        return [str(r) for r in self.rng.choice(self.ids, number, replace=False)]

    def moment(self, run: str, samples: int = 1) -> int:
        """Draw a position in the run's rows, away from its ends, followed by so many samples."""
        return int(self.rng.integers(15, len(self.rows(run)) - 15 - samples))

    def busy(self, run: str, channel: str, samples: int) -> int:
        """Position from which the channel changes most over so many samples: a standstill shows there."""
        v = self.table.loc[self.rows(run), channel].to_numpy()
        return 5 + int(np.argmax(np.abs(v[5 + samples : -5] - v[5 : -5 - samples])))


def planting(dataset: Dataset, seed: int) -> Planting:
    """Data set as table and TOML, in standard units."""
    from ...signals import STATES

    frames = []
    for run in dataset.runs:
        frame = pd.DataFrame(np.column_stack([run.t, run.states, run.inputs]), columns=["t", *STATES, *dataset.inputs])
        frame.insert(0, "trajectory", run.id)
        frames.append(frame)
    toml = {"name": dataset.name, "dt": dataset.dt, "actuators": dataset.actuators}
    length = dataset.ship.L / 130.0
    return Planting(
        pd.concat(frames, ignore_index=True),
        toml,
        length,
        float(length**0.5),
        dataset.dt,
        np.random.default_rng([seed, 7]),
    )


def times(**factors: float) -> Callable[[Planting], None]:
    """Multiply columns by factors; commands go with their actuators."""

    def plant(p: Planting) -> None:
        for channel, factor in factors.items():
            p.table[channel] *= factor
            if f"{channel}_c" in p.table:
                p.table[f"{channel}_c"] *= factor

    return plant


def silent_log(share: float) -> Callable[[Planting], None]:
    """Record surge and sway as a hundredth of themselves, sensor noise about zero, in the slowest `share` of the
    samples."""

    def plant(p: Planting) -> None:
        slow = np.abs(p.table["u"]) < np.quantile(np.abs(p.table["u"]), share)
        p.table.loc[slow, ["u", "v"]] *= 0.01

    return plant


def late(*channels: str, seconds: float) -> Callable[[Planting], None]:
    """Record channels `seconds` (at 130 m) late; the first samples of every run, which would need the time before it,
    are left out."""

    def plant(p: Planting) -> None:
        lag, keep = seconds * p.time, []
        for run in p.ids:
            at = p.rows(run)
            t = p.table.loc[at, "t"].to_numpy()
            for channel in channels:
                p.table.loc[at, channel] = np.interp(t - lag, t, p.table.loc[at, channel].to_numpy())
            keep.append(at[int(np.ceil(lag / p.dt)) :])
        p.table = p.table.loc[np.concatenate(keep)].reset_index(drop=True)
        p.table["t"] -= p.table.groupby("trajectory")["t"].transform("first")

    return plant


def vector_late(p: Planting) -> None:
    """Record the velocities 5 s (at 130 m) late as a vector in the earth's axes."""
    turn = np.exp(1j * p.table["psi"])
    vector = (p.table["u"] + 1j * p.table["v"]) * turn
    p.table["u"], p.table["v"] = np.real(vector), np.imag(vector)
    p.table["heading"] = p.table["psi"]
    late("u", "v", seconds=5.0)(p)
    own = (p.table["u"] + 1j * p.table["v"]) * np.exp(-1j * p.table.pop("heading"))
    p.table["u"], p.table["v"] = np.real(own), np.imag(own)


def enu(v: float, r: float) -> Callable[[Planting], None]:
    """Record x east, y north and psi counterclockwise from east; factors `v` and `r` of sway and yaw rate."""

    def plant(p: Planting) -> None:
        p.table[["x", "y"]] = p.table[["y", "x"]].to_numpy()
        p.table["psi"] = np.pi / 2.0 - p.table["psi"]
        p.table["v"] *= v
        p.table["r"] *= r

    return plant


def swapped(p: Planting) -> None:
    """Exchange x and y."""
    p.table[["x", "y"]] = p.table[["y", "x"]].to_numpy()


def from_east(p: Planting) -> None:
    """Record the heading counterclockwise from east."""
    p.table["psi"] = wrap_angle(np.pi / 2.0 - p.table["psi"].to_numpy())
    p.table["psi"] = p.table.groupby("trajectory")["psi"].transform(lambda s: np.unwrap(s))


def earth(first: str, second: str) -> Callable[[Planting], None]:
    """Record the velocity north and east in the channels `first` and `second`."""

    def plant(p: Planting) -> None:
        vector = (p.table["u"] + 1j * p.table["v"]) * np.exp(1j * p.table["psi"])
        p.table[first], p.table[second] = np.real(vector), np.imag(vector)

    return plant


def through_water(p: Planting) -> None:
    """Record velocities through water that flows at 0.5 m/s (at 130 m) in a drawn direction."""
    way = 0.5 * p.time * np.exp(1j * p.rng.uniform(-np.pi, np.pi)) * np.exp(-1j * p.table["psi"])
    p.table["u"] -= np.real(way)
    p.table["v"] -= np.imag(way)


def off_midship(p: Planting) -> None:
    """Record the position of an antenna 8 m forward and 2 m to starboard of midship (at 130 m)."""
    arm = (8.0 + 2.0j) * p.length * np.exp(1j * p.table["psi"])
    p.table["x"] += np.real(arm)
    p.table["y"] += np.imag(arm)


def plus(share_of_runs: float = 1.0, **offsets: float) -> Callable[[Planting], None]:
    """Add `offsets` to channels, in a share of the runs; those of r at 130 m."""

    def plant(p: Planting) -> None:
        for run in p.ids if share_of_runs == 1.0 else p.pick(max(1, round(share_of_runs * len(p.ids)))):
            for channel, offset in offsets.items():
                p.table.loc[p.rows(run), channel] += offset / (p.time if channel == "r" else 1.0)

    return plant


def repeated(p: Planting) -> None:
    """Repeat the position of the sample before in 5 % of the samples."""
    at = p.rng.random(len(p.table)) < 0.05
    at[0] = False
    at &= (p.table["trajectory"] == p.table["trajectory"].shift()).to_numpy()
    for k in np.flatnonzero(at):
        p.table.loc[k, ["x", "y"]] = p.table.loc[k - 1, ["x", "y"]].to_numpy()


def frozen(*channels: str, seconds: float = 15.0) -> Callable[[Planting], None]:
    """Freeze channels for `seconds` (at 130 m) in an eighth of the runs, where the heading changes most."""

    def plant(p: Planting) -> None:
        samples = round(seconds * p.time / p.dt)
        turning = p.table.groupby("trajectory")["psi"].agg(np.ptp).sort_values(ascending=False)
        for run in [str(r) for r in turning.index[: len(p.ids) // 2 : 4]]:
            at = p.rows(run)
            k = p.busy(run, "psi", samples)
            p.table.loc[at[k : k + samples], list(channels)] = p.table.loc[at[k], list(channels)].to_numpy()

    return plant


def stuck_rudder(p: Planting) -> None:
    """Freeze the rudder for 25 s (at 130 m) after a large step of its command."""
    swing = p.table.groupby("trajectory")["delta_c"].agg(np.ptp)
    run = str(swing.index[int(np.argmax(swing))])
    at = p.rows(run)
    command = p.table.loc[at, "delta_c"].to_numpy()
    k = int(np.argmax(np.abs(np.diff(command)) >= 0.4 * np.ptp(command)))
    p.table.loc[at[k : k + round(25.0 * p.time / p.dt)], "delta"] = p.table.loc[at[k], "delta"]


def spiked(channel: str, size: float, power: float) -> Callable[[Planting], None]:
    """Add outliers of `size` at 130 m, scaled with L to that power, to single samples in four runs."""

    def plant(p: Planting) -> None:
        for run in p.pick(4):
            p.table.loc[p.rows(run)[p.moment(run)], channel] += p.rng.choice([-1.0, 1.0]) * size * p.length**power

    return plant


def jumped(channel: str, size: float, power: float) -> Callable[[Planting], None]:
    """Add a lasting step of `size` at 130 m, scaled with L to that power, in two runs."""

    def plant(p: Planting) -> None:
        for run in p.pick(2):
            p.table.loc[p.rows(run)[p.moment(run) :], channel] += p.rng.choice([-1.0, 1.0]) * size * p.length**power

    return plant


def without_rows(p: Planting) -> None:
    """Remove four rows from two runs."""
    for run in p.pick(2):
        k = p.moment(run, 4)
        p.table = p.table.drop(index=p.rows(run)[k : k + 4])


def nan(where: str) -> Callable[[Planting], None]:
    """Replace values by NaN in two runs: velocities, whole rows, or the last 20 rows."""

    def plant(p: Planting) -> None:
        for run in p.pick(2):
            at, k = p.rows(run), p.moment(run, 4)
            columns = ["u", "v"] if where == "channels" else [c for c in p.table if c != "trajectory"]
            p.table.loc[at[-20:] if where == "tail" else at[k : k + 4], columns] = np.nan

    return plant


def text(p: Planting) -> None:
    """Write a word into three cells of u."""
    p.table["u"] = p.table["u"].astype(object)
    for k in p.rng.choice(len(p.table), 3, replace=False):
        p.table.loc[k, "u"] = "error"


def time(kind: str) -> Callable[[Planting], None]:
    """Change the time stamps: another dt in dataset.toml, a start at 1000 samples, a stamp twice, or uneven steps."""

    def plant(p: Planting) -> None:
        if kind == "dt":
            p.toml["dt"] = 2.0 * p.dt
        elif kind == "late":
            p.table.loc[p.rows(p.pick(1)[0]), "t"] += 1000.0 * p.dt
        elif kind == "twice":
            p.table = p.table.loc[np.sort(np.append(p.table.index.to_numpy(), p.rows(p.ids[1])[20]))].reset_index(
                drop=True
            )
        else:
            p.table["t"] += p.rng.uniform(-0.1, 0.1, len(p.table)) * p.dt

    return plant


def copied(kind: str) -> Callable[[Planting], None]:
    """Add a run with samples of another: the whole, a piece, or an overlap with new samples after it."""

    def plant(p: Planting) -> None:
        at = p.rows(p.ids[3])
        part = {"whole": at, "piece": at[20 : 20 + len(at) // 2], "overlap": at[len(at) // 2 :]}[kind]
        copy = p.table.loc[part].assign(trajectory="copy")
        if kind == "overlap":  # goes on with other samples after the shared half
            more = p.table.loc[p.rows(p.ids[4])[: len(at) // 2]].assign(trajectory="copy")
            copy = pd.concat([copy, more])
        copy["t"] = np.arange(len(copy)) * p.dt
        copy[["u", "v", "r"]] = copy[["u", "v", "r"]].round(9)
        p.table = pd.concat([p.table, copy], ignore_index=True)

    return plant


def cut_log(p: Planting) -> None:
    """Cut one run into two that continue each other."""
    at = p.rows(p.ids[2])
    p.table.loc[at[len(at) // 2 :], "trajectory"] = "second_half"
    p.table.loc[at[len(at) // 2 :], "t"] -= p.table.loc[at[len(at) // 2], "t"]
    order = np.concatenate([np.setdiff1d(p.table.index, at[len(at) // 2 :]), at[len(at) // 2 :]])
    p.table = p.table.loc[order].reset_index(drop=True)


def commands(p: Planting) -> None:
    """Record the commands of the sample before as actuator positions."""
    for name in ("n", "delta", "F_b", "F_s"):
        p.table[name] = p.table.groupby("trajectory")[f"{name}_c"].shift(1).fillna(p.table[f"{name}_c"])


def commands_only(p: Planting) -> None:
    """Record the commands as actuator positions, without command columns."""
    commands(p)
    p.table = p.table.drop(columns=["n_c", "delta_c", "F_b_c", "F_s_c"])


def wind_to(p: Planting) -> None:
    """Record the direction that the wind blows to."""
    p.table["wind_from"] = wrap_angle(p.table["wind_from"].to_numpy() + np.pi)


def felt_wind(kind: str, speed: float = 1.0, angle: float = 1.0) -> Callable[[Planting], None]:
    """Record the apparent wind of an instrument of `kind` (of `KINDS`), in other units."""

    def plant(p: Planting) -> None:
        psi, u, v, come_from = (p.table[c].to_numpy() for c in ("psi", "u", "v", "wind_from"))
        from_bow, moving = KINDS[kind]
        wind = p.table["wind_speed"].to_numpy() * np.exp(1j * come_from) + moving * (u + 1j * v) * np.exp(1j * psi)
        p.table["wind_speed"] = np.abs(wind) * speed
        p.table["wind_from"] = np.remainder(np.angle(wind) - from_bow * psi, 2.0 * np.pi) * angle

    return plant


def wrapped(p: Planting) -> None:
    """Turn the whole set so that a run crosses south."""
    swing = p.table.groupby("trajectory")["psi"].agg(np.ptp)
    psi = p.table.loc[p.rows(str(swing.index[int(np.argmax(swing))])), "psi"]
    turn = np.pi - 0.5 * float(psi.min() + psi.max())
    z = (p.table["x"] + 1j * p.table["y"]) * np.exp(1j * turn)
    p.table["x"], p.table["y"] = np.real(z), np.imag(z)
    p.table["psi"] = wrap_angle(p.table["psi"].to_numpy() + turn)


def degrees_wrapped(p: Planting) -> None:
    """Record the heading in degrees from 0 to 360."""
    p.table["psi"] = np.rad2deg(p.table["psi"]) % 360.0


def coarse(p: Planting) -> None:
    """Record the rudder in steps of 0.56 deg."""
    step = np.deg2rad(0.56)
    p.table["delta"] = np.round(p.table["delta"] / step) * step
