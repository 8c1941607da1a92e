"""Check for apparent wind, as an instrument on board shows it, in place of the true wind: the true wind does not change
because the ship turns or speeds up.

Every way to record a wind (off the bow or from north, with the ship's own motion in it or without, clockwise or not,
where it comes from or blows to, m/s, knots, km/h) is converted to a true wind. A reading is accepted if its wind
changes less than the wind as recorded, within `wind_window` and from run to run, by the part that heading and motion of
the ship add, and significantly. A ship on one steady course identifies nothing.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..physics.wind import KINDS, true_wind
from ..records import Dataset, Run
from ..signals import PSI, U, V
from ..units import unit_factor
from .finding import Curve, Finding, Picture, toml_line
from .recording import Recording
from .statistics import clustered_fit, clusters
from .thresholds import THRESHOLDS

CHANNELS = ("wind_speed", "wind_from")
_WORDS = {
    "true": "the true wind from north", "true-bow": "the true wind off the bow",
    "apparent": "the apparent wind, off the bow",
    "apparent-north": "the apparent wind, from north",
}  # fmt: skip


@dataclass(frozen=True)
class WindReading:
    """Interpretation of the wind channels: kind of `KINDS`; sign: of `[signs]`, "clockwise" for the standard one;
    angle, speed: units."""

    kind: str = "true"
    sign: str = "clockwise"
    angle: str = "rad"
    speed: str = "m/s"

    @property
    def errors(self) -> int:
        """Number of separate departures from the standard."""
        ours = WindReading()
        return sum(
            a != b
            for a, b in (
                (self.kind, ours.kind),
                (self.sign, ours.sign),
                (self.angle, ours.angle),
                (self.speed, ours.speed),
            )
        )

    def wind(
        self, psi: np.ndarray, u: np.ndarray, v: np.ndarray, speed: np.ndarray, come_from: np.ndarray
    ) -> np.ndarray:
        """True wind W exp(i wind_from) [m/s], east as imaginary part, (T,)."""
        angle = come_from * unit_factor("wind_from", self.angle) * (-1.0 if self.sign == "counterclockwise" else 1.0)
        if self.sign == "to":
            angle = angle + np.pi
        north, east = true_wind(psi, u, v, speed * unit_factor("wind_speed", self.speed), angle, self.kind)
        return np.asarray(north) + 1j * np.asarray(east)

    def applied(self, dataset: Dataset) -> Dataset:
        """Data set with the true wind in its channels."""
        runs = []
        for run in dataset.runs:
            wind, inputs = self.wind(*_recorded(run)), run.inputs.copy()
            for channel, values in zip(CHANNELS, (np.abs(wind), np.angle(wind)), strict=True):
                inputs[:, run.inputs_names.index(channel)] = values
            runs.append(replace(run, inputs=inputs))
        return replace(dataset, runs=tuple(runs))

    def lines(self) -> dict[str, Any]:
        """Lines for dataset.toml."""
        units = {
            c: u for c, u, ours in (("wind_from", self.angle, "rad"), ("wind_speed", self.speed, "m/s")) if u != ours
        }
        return {
            **({"wind": self.kind} if self.kind != "true" else {}), **({"units": units} if units else {}),
            **({"signs": {"wind_from": self.sign}} if self.sign != "clockwise" else {}),
        }  # fmt: skip


def _recorded(run: Run) -> np.ndarray:
    """Recorded psi, u, v, wind_speed and wind_from, (5, T)."""
    return np.vstack([run.states[:, [PSI, U, V]].T, *(run.inputs[:, run.inputs_names.index(c)] for c in CHANNELS)])


def _readings(angle: str) -> list[WindReading]:
    """Readings that changes of the wind can distinguish: sense and unit of speed show only where heading or motion of
    the ship are in it."""
    found = []
    for kind in KINDS:
        signs = {"true": ("clockwise",), "true-bow": ("clockwise", "counterclockwise")}.get(
            kind, ("clockwise", "counterclockwise", "to")
        )
        speeds = ("m/s", "kn", "km/h") if kind.startswith("apparent") else ("m/s",)
        found += [WindReading(kind, sign, angle, speed) for sign, speed in itertools.product(signs, speeds)]
    return found


@dataclass(frozen=True)
class _Windows:
    """Windows (W,) that overlap by half: wind at both ends (east as imaginary part), heading at the beginning, run."""

    begin: np.ndarray
    end: np.ndarray
    psi: np.ndarray
    owner: np.ndarray

    @property
    def changes(self) -> np.ndarray:
        return self.end - self.begin

    @property
    def departures(self) -> np.ndarray:
        """Differences from the mean of all runs."""
        return self.begin - self.begin.mean()


def _ends(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Records at the beginnings and at the ends of all windows, (5, W) each, and the run of each, (W,)."""
    ahead = max(1, round(THRESHOLDS.value("window") * recording.froude / recording.dt))
    begins, ends, owner = [], [], []
    for i, run in enumerate(recording.runs):
        at = np.arange(0, len(run) - ahead, max(1, ahead // 2))
        rows = _recorded(run)
        begins.append(rows[:, at])
        ends.append(rows[:, at + ahead])
        owner.append(np.full(len(at), i))
    return np.hstack(begins), np.hstack(ends), np.concatenate(owner)


def _evidence(plain: _Windows, reading: WindReading, read: _Windows) -> tuple[float, float]:
    """Sum of the logs of the ratios of squares, and joint t, of changes and departures: by how much they are smaller in
    the windows `read` than in `plain`."""
    size = unit_factor("wind_speed", reading.speed)  # a smaller unit alone makes every change smaller
    before, bow = size * plain.changes, KINDS[reading.kind][0]
    seen = before if reading.sign == "clockwise" else -before if reading.sign == "to" else np.conj(before)
    put_in = (
        np.abs(seen * np.exp(1j * bow * plain.psi) - read.changes) + 1e-3
    )  # had the ship kept the heading of the beginning
    gain, cluster = np.abs(before) ** 2 - np.abs(read.changes) ** 2, clusters(plain.owner)
    within = clustered_fit(gain / put_in, put_in[:, None], cluster)
    gain = np.abs(size * plain.departures) ** 2 - np.abs(read.departures) ** 2
    between = clustered_fit(gain, np.ones((len(gain), 1)), cluster)
    t = [float(f.value[0] / f.sd[0]) for f in (within, between)]
    ratios = [
        _squares(size * a) / max(_squares(b), 1e-12)
        for a, b in ((plain.changes, read.changes), (plain.departures, read.departures))
    ]
    joint = float(np.sum(t) / 2.0**0.5) if min(t) > -THRESHOLDS.value("within_error") else 0.0
    return float(np.sum(np.log(ratios))), joint


def _squares(change: np.ndarray) -> float:
    return float(np.mean(np.abs(change) ** 2))


def wind_reading(recording: Recording) -> tuple[WindReading, _Windows, _Windows] | None:
    """Reading of the wind channels, their windows as recorded and with this reading; None where they are true wind in
    SI."""
    if not set(CHANNELS) <= set(recording.dataset.inputs):
        return None
    first = [
        run.inputs[0, run.inputs_names.index("wind_from")] for run in recording.runs
    ]  # later it may be continuous beyond a turn
    angle = "deg" if np.max(np.abs(first)) > 2.0 * np.pi + 0.01 else "rad"
    ours = WindReading(angle=angle)
    begin, end, owner = _ends(recording)

    def windows(reading: WindReading) -> _Windows:
        return _Windows(reading.wind(*begin), reading.wind(*end), begin[0], owner)

    plain = windows(ours)
    enough = len(plain.changes) >= THRESHOLDS.count("windows")
    if enough and _squares(plain.changes) > THRESHOLDS.value("wind_change") ** 2:
        read = {reading: windows(reading) for reading in _readings(angle)}
        found = {reading: _evidence(plain, reading, w) for reading, w in read.items() if reading != ours}
        best = max(log for log, _ in found.values())
        alike = best - np.log(THRESHOLDS.value("similar"))
        chosen = min((k for k, (log, _) in found.items() if log > alike), key=lambda k: (k.errors, -found[k][0]))
        if found[chosen][1] > THRESHOLDS.value("within_error"):
            return chosen, plain, read[chosen]
    return None if angle == "rad" else (ours, plain, plain)


def correct_wind(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Recording with the true wind in its channels, and the finding."""
    found = wind_reading(recording)
    if found is None:
        return recording, []
    reading, plain, read = found
    size, window = unit_factor("wind_speed", reading.speed), THRESHOLDS.value("window") * recording.froude
    text = f"wind_speed and wind_from are {said(reading)}"
    if reading.kind != "true":
        text += (
            ": as the ship turns and speeds up, the wind as recorded changes by "
            f"{size * _squares(plain.changes) ** 0.5:.3g} m/s over "
        )
        text += f"{window:.3g} s, read so by {_squares(read.changes) ** 0.5:.3g} m/s, and departs from its mean over "
        text += f"all runs by {size * _squares(plain.departures) ** 0.5:.3g} m/s, "
        text += f"read so by {_squares(read.departures) ** 0.5:.3g} m/s"
    declared = _declared(recording, reading)
    todo = (
        f"dataset.toml says {' and '.join(declared)}, which the data contradict: try without that first."
        if declared
        else ""
    )
    curves = tuple(
        Curve(label, c.begin.imag, c.begin.real, ".") for label, c in (("as recorded", plain), ("as proposed", read))
    )
    finding = Finding(
        "gross", "error", "wind not true" if reading.kind != "true" else "unit", f"{text}.",
        "" if declared else toml_line(reading.lines()), todo,
        CHANNELS if reading.kind != "true" else ("wind_from",),
        picture=Picture("The wind", "from east [m/s]", "from north [m/s]", curves),
    )  # fmt: skip
    return recording.with_dataset(reading.applied(recording.dataset)), [finding]


def _declared(recording: Recording, reading: WindReading) -> list[str]:
    """Entries of dataset.toml that the reading contradicts, as TOML."""
    given = {"wind": recording.given.get("wind")}
    given |= {f"[{table}] {c}": recording.given.get(table, {}).get(c) for table in ("units", "signs") for c in CHANNELS}
    lines = reading.lines()
    wanted = {"wind"} & set(lines) | {f"[{table}] {c}" for table in ("units", "signs") for c in lines.get(table, {})}
    return [f'{key} = "{given[key]}"' for key in sorted(wanted) if given[key] is not None]


def said(reading: WindReading) -> str:
    """Words for a reading, with non-standard units."""
    units = [u for u, ours in ((reading.angle, "rad"), (reading.speed, "m/s")) if u != ours]
    sense = {"counterclockwise": " counterclockwise", "to": ", where it blows to"}.get(reading.sign, "")
    return _WORDS[reading.kind] + sense + (f", in {' and '.join(units)}" if units else "")
