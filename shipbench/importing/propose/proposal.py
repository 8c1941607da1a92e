"""Proposal of a mapping (`write_proposal`): logs in, a draft of mapping.toml out, tested by the import's own reader."""

from __future__ import annotations

import fnmatch
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...errors import InputError, option
from ...regular_files import check_output
from ...storage import put
from ..mapping import SOURCE_KEYS
from ..thresholds import THRESHOLDS
from ..writer import run_name
from .columns import read_samples
from .groups import group
from .partial import read_partial
from .source import SourceDraft, channel_gaps, clocks_apart, draft_source, missing_channels
from .text import draft_text, one_line
from .trial import try_draft


def write_proposal(
    logs: Sequence[Path], path: Path, force: bool = False, *, file: dict[str, Any] | None = None,
    partial: Path | None = None
) -> list[str]:  # fmt: skip
    """Write a draft mapping for `logs` to `path`; return lines on guessed, uncertain and missing entries, and, last,
    the command or the call of the import.

    Args:
        logs: files of one kind, or of several instruments; each kind becomes a source.
        path: of the draft.
        force: replace a file that is there.
        file: keys of [file] that are known, such as encoding, sheet and header.
        partial: a partial mapping, whose entries are kept.

    Raises:
        InputError: a log cannot be read, or `path` is there already and `force` is not set, or is one of the logs.
    """
    draft = option("--propose", "out=FILE")
    if path.exists() and not force:
        raise InputError(
            f"{path} is there already. Give another name with {draft}, or {option('--force', 'force=True')} to "
            "replace it."
        )
    if partial is not None and path.exists() and partial.resolve() == path.resolve():
        raise InputError(
            f"the draft and {option('--map', 'partial')} are both {path}; accepted: two files. Give another name "
            f"with {draft}."
        )
    check_output(path, logs, option("--propose", "out"))
    known = read_partial(partial) if partial is not None else {}
    sources, notes = _sources(logs, known, file or {})
    top, split = _top(sources, known, logs[0])
    for source in sources:
        channel_gaps(source, split["gap"])
        notes += [*source.notes, *source.found.notes, *_left_notes(source)]
    notes += missing_channels(sources) + clocks_apart(sources)
    kept = {*known, *(f"split.{key}" for key in known.get("split", {}))}
    fresh = path.with_name(f".{path.name}.tmp")

    def write() -> Path:
        try:
            fresh.write_text(draft_text(top, split, kept, sources, notes), encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror}. Give another name with {draft}.") from None
        return fresh

    try:
        if not any(note.startswith("MISSING: no column") or note.startswith("MISSING: no position") for note in notes):
            notes += try_draft(
                write, list(dict.fromkeys(log for source in sources for log in source.logs)), sources, split
            )
        put(write(), path)
    finally:
        fresh.unlink(missing_ok=True)
    given = list(dict.fromkeys(str(log) for source in sources for log in source.logs))
    command = option(
        f"shipbench data import {shlex.join(given)} --map {shlex.quote(str(path))} --ship ship.toml --out my_trial",
        f'shipbench.import_log({(given[0] if len(given) == 1 else given)!r}, {str(path)!r}, "ship.toml", '
        'out="my_trial")',
    )
    return [*map(one_line, notes), f"Draft: {path}. Check every line marked GUESS, then:", command]


def _left_notes(source: SourceDraft) -> list[str]:
    names = [c.name for c in source.left]
    if not names:
        return []
    count, listed = "1 column was" if len(names) == 1 else f"{len(names)} columns were", ", ".join(names[:8])
    return [f"{source.sample.path.name}: {count} not taken: {listed}{' ...' if len(names) > 8 else ''}."]


def _sources(logs: Sequence[Path], known: dict[str, Any], file: dict[str, Any]) -> tuple[list[SourceDraft], list[str]]:
    """Drafts, one for each kind of log, and notes on logs that fit none."""
    named = known.get("sources", {})
    drafts, notes, rest = [], [], list(logs)
    for name, kept in named.items():
        own = [log for log in rest if fnmatch.fnmatch(log.name, kept.get("files", "*"))]
        if own:
            rest = [log for log in rest if log not in own]
            draft = draft_source(name, own, read_samples(own[0], kept.get("file", {}) | file)[0], kept)
            draft.named = True
            drafts.append(draft)
    kept = {} if named else {key: known[key] for key in SOURCE_KEYS if key in known}
    more, told = group(rest, kept, kept.get("file", {}) | file, len(drafts)) if rest else ([], [])
    drafts += more
    notes += told
    seen: set[str] = set()
    for draft in drafts:
        twice = [c for c in draft.found.entries if c in seen]
        for channel in twice:
            entry = draft.found.entries.pop(channel)
            notes.append(
                f"{draft.sample.path.name}: {channel} ('{', '.join(c.name for c in entry.columns)}') is in another "
                "log, too; that one is taken."
            )
        seen |= set(draft.found.entries)
    return drafts, notes


def _top(sources: Sequence[SourceDraft], known: dict[str, Any], log: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Keys at the top of the mapping and those of [split]."""
    steps = [s.step for s in sources if s.found.entries] or [s.step for s in sources]
    finest = min(steps)
    usual = THRESHOLDS.value("proposed_step"), THRESHOLDS.value("proposed_slow_step")
    top: dict[str, Any] = {
        "name": run_name(log.name.split(".")[0]),
        "dt": next((dt for dt in usual if finest <= dt), float(f"{finest:.2g}")),
    }
    top |= {key: entry for key, entry in known.items() if key not in (*SOURCE_KEYS, "sources", "split")}
    slow = [step for step in steps if step <= THRESHOLDS.value("slow_channel")] or [finest]
    gap = max(THRESHOLDS.value("default_gap"), THRESHOLDS.count("gap_steps") * max(slow))
    split = {"gap": float(f"{gap:.3g}")} | known.get("split", {})
    return top, split
