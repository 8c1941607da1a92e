"""Draft as a text: TOML with a comment on every entry that states its reason, and any uncertain or missing part."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...names import shown
from ..entries import CHANNELS
from .assign import Entry
from .source import SourceDraft

_FORMATS = (
    "s, ms, us, ns, min, h, unix, unix_ms, unix_us, unix_ns, unix+ns, excel, matlab, iso, timedelta, hhmmss, "
    "or a pattern such as %d/%m/%Y %H:%M:%S.%f"
)
_HEAD = (
    "# Draft by `shipbench data import --propose`. Every entry is a GUESS from names and values: check each unit, "
    "sign and time.",
    "# Signs: psi clockwise from north, r bow to starboard, v to starboard; a positive rudder angle turns the ship "
    "to starboard.",
    '# Where the log counts the other way: sign = "port" (r, v, delta, thrusters), "counterclockwise" (psi), '
    '"west", "south", "astern".',
    f"# Channels: {', '.join(CHANNELS)}.",
)
_SHOWN = 40


def draft_text(
    top: dict[str, Any], split: dict[str, Any], kept: set[str], sources: Sequence[SourceDraft], notes: Sequence[str]
) -> str:
    """Text of the whole file. `kept` names the keys of the top level that a person gave; `notes` go to its end as
    comments."""
    single = len(sources) == 1 and not sources[0].named
    lines = [
        *_HEAD,
        *(f"{key} = {value(entry)}{_DT if key == 'dt' and 'dt' not in kept else ''}" for key, entry in top.items()),
    ]
    lines += _of_source(sources[0]) if single else []
    lines += [
        "",
        "[split]",
        *(
            f"{key} = {value(entry)}{_GAP if key == 'gap' and 'split.gap' not in kept else ''}"
            for key, entry in split.items()
        ),
    ]
    lines += [f"# {line}" for key, line in _IDLE.items() if key not in split]
    for source in sources:
        lines += ["", *_source(source, "" if single else f"sources.{source.name}.")]
    return "\n".join([*lines, "", *(f"# {one_line(note)}" for note in notes)]) + "\n"


_DT = "  # GUESS: sample time of the data set [s]"
_GAP = "  # GUESS: longer pauses between samples [s] split runs; never bridged"
_IDLE = {
    "window": "window = 300.0       # cut into windows of that length [s]",
    "still_speed": "still_speed = 0.1    # leave out where the ship lies still: slower than that [m/s] ...",
    "still_time": "still_time = 60.0    # ... for that long [s]",
}


def _of_source(source: SourceDraft) -> list[str]:
    """Keys of a source that stand beside its tables."""
    return [f"{key} = {value(entry)}{source.why.get(key, '')}" for key, entry in source.extra.items()]


def _source(source: SourceDraft, prefix: str) -> list[str]:
    lines = []
    if prefix:
        lines += [
            f"[{prefix.rstrip('.')}]",
            f"files = {value(source.pattern)}  # GUESS: a pattern for all files of this kind, such as gps*.csv",
        ]
        lines += [*_of_source(source), ""]
    if source.file:
        own = source.kept.get("file", {})
        lines += [
            f"[{prefix}file]",
            *(f"{key} = {value(entry)}{'' if key in own else _GUESS}" for key, entry in source.file.items()),
            "",
        ]
    lines += [f"[{prefix}time]", *_time(source), "", f"[{prefix}channels]"]
    entries = source.found.entries
    lines += [_channel(entries[channel]) for channel in CHANNELS if channel in entries]
    lines += _not_taken(source)
    if prefix and not entries:  # nothing in it was recognised: for the reader to complete
        lines = [f"# {line}".rstrip() for line in lines]
    return [one_line(f"# {source.sample.path.name}: {source.sample.form}"), *lines]


_GUESS = "  # GUESS"


def _time(source: SourceDraft) -> list[str]:
    spec = source.time_spec
    if spec is None:
        return [
            'column = "?"  # MISSING: the column of the time; or write rate = 10.0 [Hz] instead, for a log without one',
            'format = "s"',
        ]
    lines = [f"{key} = {value(entry)}" for key, entry in spec.items() if key != "format"]
    form = spec.get("format")
    if form is not None:
        given = "format" in source.kept.get("time", {})
        lines.append(
            f"format = {value(form)}"
            + ("" if given else f"  # GUESS: {one_line(source.time_why)}; accepted: {_FORMATS}")
        )
        if ("%" in form or form == "iso") and "zone" not in spec:
            lines.append('# zone = "UTC"  # where the stamps have none')
    return lines


def one_line(text: str) -> str:
    """Comment or note with words of a log: in one line, without invisible characters."""
    return shown(" ".join(text.splitlines()))


def _channel(entry: Entry) -> str:
    spec = {k: v for k, v in entry.spec.items() if v is not None}
    evidence = one_line("; ".join(dict.fromkeys(c.evidence() for c in entry.columns)))
    if entry.missing:
        body = ", ".join(
            [*(f"{k} = {value(v)}" for k, v in spec.items()), *(f"{k} = ?" for k, v in entry.spec.items() if v is None)]
        )
        return f"# {entry.channel} = {{ {body} }}  # MISSING: {one_line(entry.missing)}; {evidence}"
    body = ", ".join(f"{k} = {value(v)}" for k, v in spec.items())
    heads = [c.head.name for c in entry.columns if c.head.name and c.head.name != c.name]
    why = "; ".join([*(f"'{head}'" for head in heads), *entry.why])
    mark = "as given" if entry.why == ["as given"] else f"GUESS: {one_line(why)}"
    return f"{entry.channel} = {{ {body} }}  # {mark}; {evidence}"


def _not_taken(source: SourceDraft) -> list[str]:
    left = source.left
    if not left:
        return []
    if source.sample.layout.header == 0:
        return ["# Columns not taken; who knows them writes psi, x, y and the rest with these numbers:"] + [
            one_line(f'#   column "{c.name}"{f" ({c.head.name})" if c.head.name else ""}: {c.evidence()}')
            for c in left[:_SHOWN]
        ]
    return [
        f"# not taken: {', '.join(value(c.name) for c in left[:_SHOWN])}{' and more' if len(left) > _SHOWN else ''}"
    ]


def value(entry: Any) -> str:
    """Value as TOML on one line; JSON's strings are TOML's."""
    if isinstance(entry, dict):
        return "{ " + ", ".join(f"{k} = {value(v)}" for k, v in entry.items()) + " }"
    if isinstance(entry, list | tuple):
        return "[" + ", ".join(value(v) for v in entry) + "]"
    if isinstance(entry, float | np.floating):
        return (
            ("inf" if entry > 0 else "-inf")
            if math.isinf(entry)
            else "nan"
            if math.isnan(entry)
            else repr(float(f"{entry:.12g}"))
        )
    return json.dumps(entry, ensure_ascii=False).replace("\x7f", "\\u007f")
