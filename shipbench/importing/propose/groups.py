"""Grouping of logs by kind: recordings of the same instruments follow one mapping, other instruments are sources of
their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..tables import open_table
from .columns import read_samples
from .layout import find_form
from .source import SourceDraft, draft_source

_WHOLE = ({"psi", "x", "y"}, {"psi", "lat", "lon"})
"""Channels with which a log is a recording of the ship by itself."""


def group(
    logs: Sequence[Path], kept: dict[str, Any], file: dict[str, Any], numbered: int = 0
) -> tuple[list[SourceDraft], list[str]]:
    """Drafts, one for each kind of log, and notes on logs that no one mapping serves together with the first.

    Logs with the columns that the first kind needs are recordings of that kind. A log with a heading and a position of
    its own under other names is a recording, too, and needs a mapping of its own. Others are further instruments.
    """
    kinds: dict[tuple[Any, ...], list[Path]] = {}
    for log in logs:
        form = find_form(log, file)
        columns = frozenset(open_table(log, form.layout).columns)
        kinds.setdefault((columns, *sorted((k, str(v)) for k, v in form.given.items())), []).append(log)
    drafts: list[SourceDraft] = []
    notes: list[str] = []
    for (columns, *layout), own in kinds.items():
        if drafts and _joins(drafts[0], columns, layout, own, notes):
            continue
        for sample in read_samples(own[0], file):
            draft = draft_source(f"source{numbered + len(drafts) + 1}", own, sample, kept if not drafts else {})
            if drafts and _is_whole(draft) and _is_whole(drafts[0]):
                told, first = ", ".join(log.name for log in own[:4]), drafts[0].sample.path.name
                notes.append(
                    f"{told}: a recording with other columns than {first}; one mapping cannot serve both. Propose "
                    "and import it by itself."
                )
                continue
            drafts.append(draft)
    return drafts, notes


def _is_whole(draft: SourceDraft) -> bool:
    return any(need <= set(draft.found.entries) for need in _WHOLE)


def _joins(first: SourceDraft, columns: frozenset[str], layout: list[Any], logs: list[Path], notes: list[str]) -> bool:
    """Whether further logs are recordings of the first kind; optional channels that they lack are left out of its
    draft."""
    if not _is_whole(first) or layout != sorted((k, str(v)) for k, v in _layout_of(first).items()):
        return False
    lacking = {c for c, e in first.found.entries.items() if not {x.name for x in e.columns} <= columns}
    time = set(first.time.names if first.time else ())
    remaining = set(first.found.entries) - lacking
    if not time <= columns or not any(need <= remaining for need in _WHOLE):
        return False
    for channel in lacking:
        entry = first.found.entries.pop(channel)
        notes.append(
            f"{channel} ('{entry.columns[0].name}') is not in {logs[0].name}; it is left out of the draft for all logs."
        )
    first.logs += logs
    return True


def _layout_of(draft: SourceDraft) -> dict[str, Any]:
    return {
        k: v
        for k, v in draft.sample.file.items()
        if k not in ("decimal", "thousands") or k in draft.kept.get("file", {})
    }
