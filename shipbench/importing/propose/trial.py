"""Trial of the draft by the import itself; refused entries are corrected where the reason says how, else reported."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...ship import Ship
from ..importer import rehearse
from ..mapping import load_mapping
from ..summary import Summary
from ..thresholds import THRESHOLDS
from .source import SourceDraft

_NEEDED = ("psi", "x", "y", "lat", "lon")
_ANY_SHIP = Ship(name="any", L=50.0, B=8.0, T=3.0, mass=9e5)
"""Ship of average size: her length sets the smoothing of speeds from a track, on which no result here depends."""


def try_draft(
    write: Callable[[], Path], logs: Sequence[Path], sources: Sequence[SourceDraft], split: dict[str, Any]
) -> list[str]:
    """Notes from a trial import of the draft; `write` writes it anew after a correction and returns its path."""
    corrected: list[str] = []
    rows, read = THRESHOLDS.count("proposal_trial_rows"), THRESHOLDS.count("proposal_trial_read")
    for _ in range(THRESHOLDS.count("proposal_corrections")):
        try:
            summary = rehearse(logs, load_mapping(write()), _ANY_SHIP, rows, read)
        except InputError as error:
            told = _correct(str(error), sources, split)
            if told is None or told in corrected:
                return [*corrected, f"FAILS: the import refuses this draft: {error}"]
            corrected.append(told)
            continue
        return [*corrected, *_of_success(summary)]
    return [*corrected, "FAILS: the import still refuses this draft. Correct it by hand."]


def _of_success(summary: Summary) -> list[str]:
    seconds = sum(run["seconds"] for run in summary.runs)
    runs = f"{len(summary.runs)} run{'s' * (len(summary.runs) != 1)}"
    lines = [
        (
            f"Tried with the import on the beginning of each recording: {runs}, {seconds:g} s of "
            f"{summary.seconds:g} s. "
            f"Read: {summary.met.rows} rows."
        )
    ]
    return [
        *lines,
        *(f"The import leaves out: {line}" for line in summary.left_out()),
        *(n for n in summary.notes() if n.startswith("DOUBTFUL")),
    ]


def _correct(message: str, sources: Sequence[SourceDraft], split: dict[str, Any]) -> str | None:
    """Text on the change of the draft after the import's `message`, or None where a person must decide."""
    if found := re.search(r"'([^']*)' is '([^']*)', not a number", message):
        return _of_cell(found[1], found[2], sources)
    for source in sources:
        spec = source.time_spec
        if spec is None or (
            len(sources) > 1 and str(source.sample.path) not in message and source.sample.path.name not in message
        ):
            continue
        if "time goes back" in message and "backwards" not in spec:
            spec["backwards"] = "split"
            return (
                "NOT SURE: time goes back in the log; what follows is taken as a recording of its own ([time] "
                "backwards)."
            )
        if "repeat the time of the row before" in message and "repeated" not in spec:
            spec["repeated"] = "spread"
            return (
                "NOT SURE: rows repeat the time of the row before; they are spread evenly until the next stamp "
                '([time] repeated = "spread").'
            )
    if message.startswith("no run is left") and (steps := re.search(r"Usual time between samples: (.*?)\. ", message)):
        slowest = max((float(s) for s in re.findall(r"([\d.]+(?:e[-+]?\d+)?) s", steps[1])), default=0.0)
        pause = THRESHOLDS.count("gap_steps") * slowest
        if pause > split.get("gap", THRESHOLDS.value("default_gap")):
            split["gap"] = pause
            return f"split.gap is {pause:g} s, three times the usual time between samples of the slowest channel."
    return None


def _of_cell(column: str, cell: str, sources: Sequence[SourceDraft]) -> str | None:
    for source in sources:
        for entry in source.found.entries.values():
            if column not in [c.name for c in entry.columns] or entry.missing:
                continue
            if not re.search(r"\d", cell):
                source.extra["missing"] = [*source.extra.get("missing", []), cell]
                source.why["missing"] = "  # GUESS: words in columns of numbers"
                return f"'{cell}' in '{column}' is taken as a missing reading."
            if entry.channel not in _NEEDED:
                entry.missing = f"'{cell}' in the column is no number"
                return f"{entry.channel} is left out: '{cell}' in '{column}' is no number."
    return None
