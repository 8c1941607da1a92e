"""Notes on predicted trajectories of other programs, in words for the terminal, the tables and the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..predictors.predictions import ReplayReport, size_text


def replay_notes(summaries: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], list[str]]:
    """Notes by data set and model on trajectories that were read from files: their starts against the measured ones,
    the windows that they cover, and how they were read and matched; and on the frame and units of a simulation."""
    found: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for summary in summaries:
        found.setdefault((str(summary["dataset"]), str(summary["model"])), []).append(summary)
    return {key: notes for key, cells in found.items() if (notes := _notes(cells))}


def _notes(cells: Iterable[Mapping[str, Any]]) -> list[str]:
    cells = list(cells)
    reports = [report for cell in cells if (report := _report(cell)) is not None]
    if not reports:
        frames = [cell["simulation_notes"] for cell in cells if isinstance(cell.get("simulation_notes"), list)]
        return [str(note) for note in next((notes for notes in frames if notes), [])]
    starts, read = [_starts(reports)], dict.fromkeys(note for report in reports for note in report.notes)
    statuses = [status for cell in cells for status in cell["run_status"]]
    skipped = statuses.count("skipped")
    covered = [f"{len(statuses) - skipped} of {len(statuses)} windows are covered by a trajectory"] if skipped else []
    return [*starts, *covered, *read]


def _starts(reports: Iterable[ReplayReport]) -> str:
    reports = list(reports)
    distance = np.array([x for report in reports for x in report.distance])
    heading = np.array([x for report in reports for x in report.heading])
    unknown = sum(report.unknown for report in reports)
    if not len(distance):
        return f"the state at the start is not among the predicted ones, in {unknown} windows"
    finite = f"{_size(distance, 'm')}; {_size(heading, 'deg')}"
    more = f"; not known in {unknown} windows" if unknown else ""
    return (
        f"predicted state at the start of the window against the measured one, {len(distance)} windows: {finite}{more}"
    )


def _size(values: np.ndarray, unit: str) -> str:
    return f"median {size_text(np.median(values), unit)}, maximum {size_text(np.max(values), unit)}"


def _report(summary: Mapping[str, Any]) -> ReplayReport | None:
    """Report in a summary; None where there is none, or where it is malformed."""
    try:
        return ReplayReport.from_dict(summary["replay_report"])
    except (KeyError, TypeError, ValueError, AttributeError):
        return None
