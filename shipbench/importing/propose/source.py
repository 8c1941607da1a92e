"""Draft of one kind of file: its clock, its channels and notes on them."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ..clock import is_absolute
from ..mapping import Clock
from ..thresholds import THRESHOLDS
from .assign import Assigned, assign
from .clock import Time, find_time, read_time, refusal, usual_step
from .columns import Column, Sample
from .evidence import examine
from .headless import identify
from .units import set_units


@dataclass
class SourceDraft:
    """Draft of one kind of file. `kept` holds the entries of a partial mapping, `extra` further keys of the source
    (run, missing, ...), `why` their comments."""

    name: str
    logs: list[Path]
    sample: Sample
    found: Assigned
    time: Time | None
    kept: dict[str, Any]
    time_spec: dict[str, Any] | None
    extra: dict[str, Any] = field(default_factory=dict)
    why: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    named: bool = False

    @property
    def pattern(self) -> str:
        return str(self.kept.get("files", self.sample.path.name))

    @property
    def file(self) -> dict[str, Any]:
        return self.sample.file

    @property
    def time_why(self) -> str:
        return self.time.why if self.time else "as given"

    @property
    def step(self) -> float:
        """Typical time between two rows of one run [s]."""
        t = self.times
        return 1.0 if t is None else usual_step(t)

    @property
    def times(self) -> np.ndarray | None:
        """Times of the sample (n,), NaN where a row is of another than the first run."""
        if self.time is None:
            return None
        run = next((c for c in self.sample.columns if c.name == self.extra.get("run")), None)
        if run is None:
            return self.time.t
        cells = np.array(run.cells.to_pylist(), object)
        return np.where(cells == cells[0], self.time.t, np.nan)

    @property
    def left(self) -> list[Column]:
        """Columns that are not in use."""
        used = (
            self.found.used()
            | set(self.time.names if self.time else ())
            | set((self.time_spec or {}).get("columns", ()))
        )
        used |= {(self.time_spec or {}).get("column", "")}
        return [c for c in self.sample.columns if c.name not in used]


def draft_source(name: str, logs: list[Path], sample: Sample, kept: dict[str, Any]) -> SourceDraft:
    """Draft for logs of one kind.

    Args:
        sample: the beginning of the first of them.
        kept: the source's keys in the partial mapping.
    """
    notes = list(sample.notes)
    time = _given_time(kept["time"], sample) if "time" in kept else find_time(sample.columns)
    spec = dict(kept["time"]) if "time" in kept else dict(time.spec) if time else None
    if time is None:
        notes += [told] if (told := refusal(sample.columns)) else []
        notes.append(
            f"MISSING: no column of {sample.path.name} was taken for the time; write [time] column and format, or "
            "rate = 10.0 [Hz]."
        )
    else:
        notes += time.notes
    own = set(time.names) if time else set()
    others = [c for c in sample.columns if c.name not in own]
    found = assign(others, kept.get("channels", {}), kept.get("run"))
    if time is not None:
        identify(others, time.t, found)
    set_units(found)
    draft = SourceDraft(name, logs, sample, found, time, kept, spec)
    draft.extra = {k: v for k, v in kept.items() if k in ("missing", "antenna", "speed_sensor")}
    if found.run:
        draft.extra["run"] = found.run
        draft.why["run"] = "" if "run" in kept else "  # GUESS: each value is a run, or a vessel, of its own"
    _marks_of_missing(draft)
    if time is not None and "time" not in kept:
        _disorder(draft)
        time.spec.update(spec or {})
    if time is not None:
        form = time.spec.get("format")
        examine(sample, time, found, {k: draft.extra[k] for k in ("run", "missing") if k in draft.extra})
        if time.spec.get("format") != form and draft.time_spec is not None:
            draft.time_spec["format"] = time.spec["format"]
            t = read_time(time.spec, sample.columns)
            draft.time = Time(
                time.spec, t, usual_step(t), time.names, "from the recorded speed along the track", time.notes
            )
            draft.notes[:] = [n for n in draft.notes if "seconds are taken" not in n]
            notes = [n for n in notes if "seconds are taken" not in n]
    draft.notes = notes
    return draft


def _given_time(spec: dict[str, Any], sample: Sample) -> Time:
    try:
        t = read_time(spec, sample.columns)
    except (InputError, ValueError) as error:
        raise InputError(f"[time] of the partial mapping does not fit {sample.path}: {error}") from None
    names = tuple(spec.get("columns", ())) or ((spec["column"],) if "column" in spec else ())
    return Time(dict(spec), t, usual_step(t), names, "as given")


def _marks_of_missing(draft: SourceDraft) -> None:
    """Add the words without a digit in columns of numbers to the marks of a missing value."""
    if "missing" in draft.kept:
        return
    marks: Counter[str] = Counter()
    for entry in draft.found.entries.values():
        for column in entry.columns:
            if column.is_text and len(column.known):
                marks.update(
                    t for t in column.texts(len(column.cells)) if not re.search(r"\d", t) and t.casefold() not in _EMPTY
                )
    if marks:
        draft.extra["missing"] = list(marks)
        draft.why["missing"] = f"  # GUESS: words in columns of numbers, {sum(marks.values())} times at the beginning"


_EMPTY = {"", "na", "n/a", "nan", "null", "none", "#n/a", "nat"}


def _disorder(draft: SourceDraft) -> None:
    """Choose how the import reads times that repeat or go back."""
    t, spec = draft.times, draft.time_spec
    if t is None or spec is None:
        return
    known = t[np.isfinite(t)]
    steps = np.diff(known)
    if len(steps) == 0:
        return
    back = steps < 0
    if (steps == 0).mean() > THRESHOLDS.value("coarse_stamps") and spec.get("format") not in ("unix+ns",):
        spec["repeated"] = "spread"
        draft.found.notes.append(
            f"NOT SURE: {(steps == 0).mean():.0%} of the rows repeat the time of the row before; they are spread "
            "evenly until the next stamp."
        )
    if back.any() and not _over_midnight(spec, steps):
        often = back.mean() > THRESHOLDS.value("rows_out_of_order")
        spec["backwards"] = "sort" if often else "split"
        what = (
            "rows are not in the order of time; sorted" if often else "what follows is taken as a recording of its own"
        )
        draft.found.notes.append(
            f"NOT SURE: time goes back in {int(back.sum())} places, by up to {-steps.min():.4g} s: {what}."
        )


def _over_midnight(spec: dict[str, Any], steps: np.ndarray) -> bool:
    form = spec.get("format", "")
    daily = form == "hhmmss" or ("%" in form and "%d" not in form)
    return daily and bool((steps[steps < 0] < -THRESHOLDS.value("new_day")).all())


def channel_gaps(draft: SourceDraft, gap: float) -> None:
    """Gap limits of channels that are sampled more slowly than `gap` [s] allows; none for a command that is logged on
    change."""
    t = draft.times
    if t is None:
        return
    for entry in draft.found.entries.values():
        if "gap" in entry.spec or "as given" in entry.why or not entry.columns:
            continue
        cells = entry.columns[0].cells
        there = (
            np.array([v is not None and str(v).strip() != "" for v in cells.to_pylist()])
            if entry.columns[0].is_text
            else np.isfinite(entry.columns[0].values)
        )
        there &= np.isfinite(t)
        steps = np.diff(np.unique(t[there]))
        if len(steps) < 2:
            continue
        usual = float(np.median(steps))
        pause = THRESHOLDS.count("gap_steps") * usual
        on_change = entry.channel.endswith("_c") and there.mean() < THRESHOLDS.value("logged_on_change")
        if on_change and steps.max() > pause:
            entry.spec["gap"] = math.inf
            entry.why.append("logged when it changes")
        elif usual > THRESHOLDS.value("slow_channel") and pause > gap * (1 + 1e-9):
            entry.spec["gap"] = float(f"{pause:.3g}")


def missing_channels(sources: Sequence[SourceDraft]) -> list[str]:
    """Channels that a data set needs and no source has."""
    seen = {e.channel for s in sources for e in s.found.entries.values() if not e.missing}
    lines = []
    if "psi" not in seen:
        lines.append("MISSING: no column was taken for psi, the heading; it is needed.")
    if not {"x", "y"} <= seen and not {"lat", "lon"} <= seen:
        lines.append("MISSING: no position was found; map x and y, or lat and lon.")
    if not {"n", "n_c"} & seen:
        lines.append("MISSING: no shaft speed (n or n_c) was found; without it, it is taken as zero.")
    if not {"delta", "delta_c"} & seen:
        lines.append("MISSING: no rudder angle (delta or delta_c) was found; without it, it is taken as zero.")
    if measured := [name for name in ("delta", "n") if name in seen]:
        commands = " and ".join(f"{name}_c" for name in measured)
        lines.append(f"{' and '.join(measured)}: taken as measured; where the column is a command, write {commands}.")
    return lines


def clocks_apart(sources: Sequence[SourceDraft]) -> list[str]:
    """Notes on sources whose stamps name no zone, where others are merged with them: their beginnings show the
    offset."""
    clocks = [
        (s, Clock(**s.time_spec), float(np.nanmin(s.time.t)))
        for s in sources
        if s.time is not None and s.time_spec is not None
    ]
    if len(clocks) < 2:
        return []
    lines = []
    for source, clock, begin in clocks:
        form = clock.format
        if (
            not is_absolute(clock)
            or clock.zone
            or form.startswith("unix")
            or re.search(r"%[zZ]|Z$", form)
            or (form == "iso" and _has_offset(source))
        ):
            continue
        others = [b for s, c, b in clocks if s is not source and is_absolute(c)]
        apart = f"; it begins {(begin - others[0]) / 3600:+.2f} h from the other" if others else ""
        lines.append(
            f"NOT SURE: the stamps of {source.sample.path.name} name no zone; UTC is taken{apart}. If it is local "
            "time, write [time] zone."
        )
    return lines


def _has_offset(source: SourceDraft) -> bool:
    column = next(c for c in source.sample.columns if c.name == source.time.names[-1]) if source.time else None
    texts = column.texts(5) if column else []
    return bool(texts) and all(re.search(r"([zZ]|[+-]\d\d:?\d\d)$", text) for text in texts)
