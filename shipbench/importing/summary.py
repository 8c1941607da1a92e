"""Summary of an import, for the terminal, for --json and for the notes of dataset.toml."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from ..names import brief
from ..signals import COMMANDS, STATES
from .cells import Counts
from .channels import all_channels
from .clock import is_absolute, moment
from .entries import unit_of
from .mapping import Mapping
from .runs import Piece, shortest_run
from .stretches import Cut

_SHOWN = 12


class Summary:
    """Record of the import while it runs; `complete` before it is read."""

    def __init__(self, mapping: Mapping) -> None:
        self.mapping, self.table = mapping, Path()
        self.runs: list[dict[str, Any]] = []
        self.meta: dict[str, dict[str, Any]] = {}
        self.columns: tuple[str, ...] = ()
        self.cuts: dict[str, list[float]] = {}  # reason -> seconds of each
        self.seconds = 0.0
        self.steps: dict[str, float] = {}
        self.times: dict[str, list[float]] = {}  # derived signal -> time constants
        self.scatter: dict[str, list[float]] = {}
        self.met = Counts()
        self.doubtful: Counter[str] = Counter()
        self.interpolated = 0
        self.part_length: float | None = None
        self._before: list[str] = []  # runs of the last stretch before the clock was set back
        self._last: list[str] = []
        self._stretch = 0
        self.absolute = is_absolute(next(iter(mapping.sources.values())).time)

    def add(self, run: str, file: str, piece: Piece, group: str | None, stretch: int) -> None:
        """Add a run that was written, of the recording's stretch of that number; `group` names the pieces of one
        uninterrupted stretch."""
        begin, end = float(piece.t[0]), float(piece.t[-1])
        written: list[Any] = [moment(begin), moment(end)] if self.absolute else [round(begin, 6), round(end, 6)]
        self.meta[run] = {"file": file, "from": written[0], "to": written[1]}
        if piece.origin is not None:
            self.meta[run]["origin"] = {"lat": piece.origin[0], "lon": piece.origin[1]}
        if group is not None:
            self.meta[run]["group"] = group
        self.runs.append({"id": run, "seconds": round(end - begin, 6), "samples": len(piece.t), **self.meta[run]})
        self._follow(run, stretch)
        self.columns = tuple(piece.columns)
        for name, smoothed in piece.derived.items():
            self.times.setdefault(name, []).append(smoothed.time_constant)
            self.scatter.setdefault(name, []).append(smoothed.noise)

    def recording(self, goes_on: bool) -> None:
        """Begin another recording; `goes_on`: the one before, after its clock was set back."""
        self._before = self._last if goes_on and not self.mapping.split.window else []
        self._last, self._stretch = [], 0

    def _follow(self, run: str, stretch: int) -> None:
        """Put the first stretch after a clock was set back into the group of the last one before: the ship moved on."""
        if stretch != self._stretch:
            self._last, self._stretch = [], stretch
        self._last.append(run)
        if stretch == 1 and self._before:
            group = self.meta[self._before[0]].get("group", f"{self._before[0]}_goes_on")
            for name in (*self._before, run):
                self.meta[name]["group"] = group
            for written in self.runs:
                written.update(self.meta[written["id"]])

    def cut(self, reason: str, seconds: float) -> None:
        """Add time that a rule of the mapping left out."""
        self.cuts.setdefault(reason, []).append(seconds)

    def gap(self, cut: Cut) -> None:
        """Add time in which some channel had no samples."""
        told = [f"{name} (longest pause bridged {self.mapping.gap(name):g} s)" for name in cut.channels]
        self.cut(f"no samples of {', '.join(told[:4])}{' and others' if len(told) > 4 else ''}", cut.end - cut.start)

    def span(self, seconds: float, shortened: float | None) -> None:
        """Add the length of a recording; `shortened` where its parts had to be shorter than the mapping says, to keep
        memory small."""
        self.seconds += seconds
        self.part_length = shortened or self.part_length

    def complete(self, met: Counts) -> None:
        """Take over what reading found."""
        self.met = met

    def converted(self) -> list[str]:
        """Lines, one a channel: its origin and the conversion of its numbers."""
        lines = []
        for name, channel in all_channels(self.mapping).items():
            steps = [f"from {channel.unit}"] if channel.unit != unit_of(name) else []
            steps += [f"{channel.sign} positive"] if channel.sign else []
            steps += [f"factor {channel.factor:g}"] if channel.factor != 1.0 else []
            steps += [f"offset {channel.offset:+g} {channel.unit}"] if channel.offset else []
            rate = self.steps.get(name, math.inf)
            every = f", every {rate:.4g} s" if math.isfinite(rate) else ""
            lines.append(f"{name} [{unit_of(name)}] = {channel}{' (' + ', '.join(steps) + ')' if steps else ''}{every}")
        return lines

    def derived(self) -> list[str]:
        """Lines on signals that were derived, since no column of the log holds them."""
        mapping, lines = self.mapping, []
        if mapping.has("lat"):
            fixed = mapping.origin
            where = (
                "the first position of each stretch (origin in [runs])"
                if fixed is None
                else f"{fixed.lat:g}, {fixed.lon:g} deg"
            )
            lines.append(f"x, y from lat, lon: the plane that touches the WGS84 ellipsoid at {where}")
        for source in mapping.sources.values():
            if source.antenna:
                lines.append(
                    f"positions moved to midship from an antenna at x = {source.antenna.x:g} m, y = "
                    f"{source.antenna.y:g} m"
                )
            if source.speed_sensor:
                lines.append(
                    f"u, v moved to midship from x = {source.speed_sensor.x:g} m, y = {source.speed_sensor.y:g} m"
                )
        if from_course := self.from_course():
            lines.append(f"{', '.join(from_course)} from sog, cog and psi (over ground)")
        for names, base, unit, factor in (
            (("u", "v"), "x, y and psi", "m", 1.0),
            (("r",), "psi", "deg", 180.0 / math.pi),
        ):
            found = [n for n in names if n in self.times]
            if found:
                times, noise = self.times[found[0]], factor * float(np.median(self.scatter[found[0]]))
                spread = (
                    f"{min(times):.3g} to {max(times):.3g} s"
                    if max(times) > 1.005 * min(times)
                    else f"{times[0]:.3g} s"
                )
                lines.append(
                    f"{', '.join(found)} from {base} by a cubic smoothing spline, time constant {spread}; scatter "
                    f"taken out {noise:.2g} {unit}"
                )
        if mapping.has("apparent_wind_speed") and not mapping.has("wind_speed"):
            lines.append("true wind from the apparent wind, psi, u and v")
        return lines

    def from_course(self) -> list[str]:
        """Speeds that are the velocity over ground, rotated by the heading."""
        return [n for n in "uv" if self.mapping.has("sog") and not self.mapping.has(n)]

    def left_out(self) -> list[str]:
        """Lines on cut or skipped parts, with the reason."""
        lines = [f"{sum(s):.6g} s in {len(s)} place{'s' * (len(s) > 1)}: {reason}" for reason, s in self.cuts.items()]
        lines += [f"{count} {what}" for what, count in self.met.what.items() if count]
        return lines

    def notes(self) -> list[str]:
        """Notes for dataset.toml and the terminal."""
        lines = self.derived()
        if self.mapping.split.window:
            lines.append(
                f"runs are windows of {self.mapping.split.window:g} s; those of one recording may follow each other "
                "without a pause"
            )
        lines += [
            f"DOUBTFUL: {count} samples of {what}: outliers, or a wrong unit"
            for what, count in self.doubtful.items()
            if count
        ]
        lines += [
            *self.met.clock[:_SHOWN],
            *([f"... and {len(self.met.clock) - _SHOWN} more of the clock"] if len(self.met.clock) > _SHOWN else []),
        ]
        lines += [f"DOUBTFUL: {count} {what}" for what, count in self.met.doubtful.items() if count]
        lines += [
            (
                f"{name} reaches {most:.4g} deg: taken as counted on over north. If it is in steps of 0.01 deg: unit = "
                '"cdeg"'
            )
            for name, most in self.met.reach.items()
        ]
        if self.interpolated:
            lines.append(
                f"{self.interpolated} headings were interpolated linearly across 360/0 (359, 240, 120, 1): left out"
            )
        lines += self.met.notes
        if self.part_length is not None:
            lines.append(f"densely sampled: parts of at most {self.part_length:g} s, to keep memory small")
        return lines

    def actuators(self) -> str:
        """Kind of the actuators as in the mapping, else by the mapped channels."""
        measured = any(self.mapping.has(name) for name in STATES[6:])
        return self.mapping.actuators or ("measured" if measured else "commanded")

    def description(self) -> dict[str, Any]:
        """Content of dataset.toml."""
        files = ", ".join(self.met.forms)
        own = {"derived": [name for name in "uvr" if name in self.times], "from_course": self.from_course()}
        source = self.mapping.source or f"imported from {files if len(files) < 200 else f'{len(self.met.forms)} logs'}"
        return {
            "name": self.mapping.name, "ship": "ship.toml", "dt": self.mapping.dt, "actuators": self.actuators(),
            "source": source,
            "licence": self.mapping.licence, "notes": self.notes(),
            **{key: names for key, names in own.items() if names}, "runs": self.meta,
        }  # fmt: skip

    def no_runs(self) -> str:
        """Message where no run is left."""
        why = "; ".join(self.left_out()[:6]) or "no channel has two samples"
        steps = ", ".join(f"{n} {s:.4g} s" for n, s in self.steps.items() if math.isfinite(s)) or "unknown"
        return (
            f"no run is left of {self.seconds:g} s of log. Left out: {why}. Usual time between samples: {steps}. "
            f"Accepted: runs of at least {shortest_run(self.mapping):g} s in which every mapped channel has samples. "
            "Set split.gap (or a channel's own gap; inf for a command that is logged only when it changes), "
            "split.shortest, or leave a channel out."
        )

    def document(self) -> dict[str, Any]:
        """Values for --json."""
        return {
            "out": str(self.table.parent), "table": self.table.name, "name": self.mapping.name, "dt": self.mapping.dt,
            "actuators": self.actuators(),
            "runs": self.runs, "seconds": sum(r["seconds"] for r in self.runs), "log_seconds": self.seconds,
            "log_rows": self.met.rows,
            "forms": self.met.forms, "columns": list(self.columns), "channels": self.converted(),
            "derived": self.derived(),
            "left_out": self.left_out(), "notes": self.notes(),
        }  # fmt: skip

    def __repr__(self) -> str:
        return brief("\n".join(self.lines()) if self.table.name else f"<Summary of {self.mapping.name}, not complete>")

    def lines(self) -> list[str]:
        """Lines for the terminal."""
        dt, seconds = self.mapping.dt, sum(r["seconds"] for r in self.runs)
        runs = f"{len(self.runs)} run{'s' * (len(self.runs) > 1)}"
        of = f"{_duration(seconds)} of {_duration(self.seconds)} of log"
        lines = [f"{self.mapping.name}: {runs}, {of}, dt = {dt:g} s, actuators {self.actuators()}"]
        lines += [f"  {r['id']}: {r['seconds']:g} s, {r['from']} to {r['to']}" for r in self.runs[:_SHOWN]]
        if len(self.runs) > _SHOWN:
            lines.append(f"  ... and {len(self.runs) - _SHOWN} more")
        missing = [
            n for n, c in zip(STATES[6:], COMMANDS, strict=True) if n not in self.columns and c not in self.columns
        ]
        blocks = {
            "read": [
                f"{what}: {count} file{'s' * (count > 1)}" for what, count in Counter(self.met.forms.values()).items()
            ],
            "channels": self.converted(),
            "notes": self.notes(),
            "left out": self.left_out(),
            "not recorded": [f"{', '.join(missing)}: taken as zero when the data set is loaded"] if missing else [],
        }
        for title, entries in blocks.items():
            if entries:
                lines += [f"{title}:", *(f"  {entry}" for entry in entries)]
        return lines


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:g} s"
    return f"{seconds / 60:.3g} min" if seconds < 7200 else f"{seconds / 3600:.2f} h"
