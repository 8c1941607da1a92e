"""Texts and small HTML that display runs and data sets in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from .names import brief, shown
from .signals import X, Y

_WIDTH, _HEIGHT, _MARGIN = 300.0, 220.0, 8.0
_TRACKS, _POINTS = 60, 80
"""Most tracks of a thumbnail, and most points of each."""


def run_text(run: Any) -> str:
    """Line on a run."""
    kind = f", {run.kind}" if run.kind else ""
    return (
        f"<Run '{run.id}': {len(run)} samples, t = {run.t[0]:g} to {run.t[-1]:g} s{kind}; inputs "
        f"{', '.join(run.inputs_names)}>"
    )


class Runs(tuple[Any, ...]):
    """Runs of a data set: a tuple that shows their names, not their samples."""

    def __repr__(self) -> str:
        return brief(f"<{len(self)} runs: {', '.join(str(getattr(run, 'id', run)) for run in self)}>")


def dataset_text(data: Any) -> str:
    """Text on a data set, one line for each fact."""
    return "\n".join([_title(data), *(f"  {key}: {text}" for key, text in _facts(data).items())])


def dataset_html(data: Any) -> str:
    """HTML table of the same facts beside the tracks."""
    return facts_html(_title(data), _facts(data), tracks_svg((run.id, run.states[:, [X, Y]]) for run in data.runs))


def _title(data: Any) -> str:
    return f"Data set '{data.name}': {len(data)} run{'s' * (len(data) > 1)}"


def _facts(data: Any) -> dict[str, str]:
    """Main facts for a reader, in words."""
    seconds = [(len(run) - 1) * data.dt for run in data.runs]
    least, most = f"{min(seconds):g}", f"{max(seconds):g}"
    each = f"{least} s each" if least == most else f"{least} to {most} s each"
    facts = {
        "Length": f"{each}, {sum(seconds):g} s in all, a sample every {data.dt:g} s",
        "Ship": f"{data.ship.name[:80]}, L = {data.ship.L:g} m",
        "Runs": _listed([run.id for run in data.runs]),
        "Manoeuvres": _listed(sorted({run.kind for run in data.runs} - {""})),
        "Inputs": ", ".join(data.inputs), "Actuators": data.actuators, "Source": data.source[:200],
        "Licence": data.licence[:100],
        "Notes": f"{len(data.notes)}, in .notes" if data.notes else "",
    }  # fmt: skip
    return {key: text for key, text in facts.items() if text}


def _listed(names: Sequence[str], most: int = 4) -> str:
    """The first names, shortened, and how many more there are."""
    first = ", ".join(name if len(name) <= 24 else f"{name[:21]}..." for name in names[:most])
    return f"{first} and {len(names) - most} more" if len(names) > most else first


def facts_html(title: str, facts: Mapping[str, str], beside: str = "") -> str:
    """HTML table of facts under a title, with a picture at its side."""
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(shown(key))}</th><td '
        f'style="text-align:left">{escape(shown(value))}</td></tr>'
        for key, value in facts.items()
    )
    table = (
        f"<table><caption style='text-align:left'><b>{escape(shown(title))}</b></caption><tbody>{rows}</tbody></table>"
    )
    return f'<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">{table}{beside}</div>'


def tracks_svg(tracks: Iterable[tuple[str, np.ndarray]]) -> str:
    """Picture of tracks, each a name and positions (samples, 2) [m] north and east, at one scale with north up; the
    name shows under the mouse.

    Of many tracks some are drawn, evenly spread.
    """
    drawn = _spread(list(tracks), _TRACKS)
    points = [
        (name, positions[np.linspace(0, len(positions) - 1, min(len(positions), _POINTS)).round().astype(int)])
        for name, positions in drawn
    ]
    every = np.concatenate([positions for _, positions in points])
    low, high = every.min(axis=0), every.max(axis=0)
    north, east = high - low
    scale = min((_HEIGHT - 2 * _MARGIN - 16) / max(north, 1e-9), (_WIDTH - 2 * _MARGIN) / max(east, 1e-9))
    scale = min(scale, 1e6)
    lines = [_path(name, positions, low[1], high[0], scale) for name, positions in points]
    bar = _round_length(max(north, east, 1e-3) / 3.0)
    foot = _HEIGHT - _MARGIN
    scale_bar = (
        f'<path d="M{_MARGIN:g} {foot:g}h{bar * scale:.1f}" stroke-width="2"/>'
        f'<text x="{_MARGIN:g}" y="{foot - 4:g}" font-size="11" fill="currentColor" stroke="none">{bar:g} m</text>'
    )
    return (
        f'<svg width="{_WIDTH:g}" height="{_HEIGHT:g}" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" fill="none" '
        'stroke="currentColor" '
        f'role="img" aria-label="Tracks, north up">{"".join(lines)}{scale_bar}</svg>'
    )


def _spread(items: Sequence[tuple[str, np.ndarray]], most: int) -> list[tuple[str, np.ndarray]]:
    return [items[i] for i in np.linspace(0, len(items) - 1, min(len(items), most)).round().astype(int)]


def _path(name: str, positions: np.ndarray, west: float, top: float, scale: float) -> str:
    x, y = _MARGIN + scale * (positions[:, 1] - west), _MARGIN + scale * (top - positions[:, 0])
    d = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
    return f'<path d="M{d}" stroke-opacity="0.7"><title>{escape(shown(name))}</title></path>'


def _round_length(metres: float) -> float:
    """Greatest of 1, 2, 5, 10, ... that is not longer."""
    power = 10.0 ** np.floor(np.log10(metres))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= metres * (1 + 1e-9)))
