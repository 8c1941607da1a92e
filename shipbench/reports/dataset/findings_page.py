"""Page of `data check`: verdict, findings with the lines that correct them, and the runs concerned as linked plots."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

import numpy as np
from markupsafe import escape

from ...checking.finding import SEVERITIES, Finding, Picture
from ...checking.recording import Recording
from ...records import Run
from ...render.html import Tile, render_page
from ...render.linked import COLOURS
from ...render.svg import Axes
from ..recorded import RUNS, recorded_plots, thinned
from .facts import fact_lines

_POINTS = 1500
"""Points of one curve of a finding's evidence: more than a picture of 600 pixels shows."""
_NAMED = 12
"""Most runs of a finding that its row lists."""
_STYLE = """
@media (min-width: 40.01rem) { .findings td { min-width: 9rem; } .findings td.what { min-width: 20rem; } }
.findings td p { margin: 0 0 .4rem; }
.findings pre { margin: .3rem 0; max-width: 34rem; }
.level { font-weight: 600; } .level.faulty { color: var(--warn); } svg .dots { stroke-width: 4; stroke-linecap: round; }
"""


def check_page(recording: Recording, findings: Sequence[Finding], document: dict[str, Any], command: str) -> str:
    """HTML of a check; `document` is that of `check_report.check_document`."""
    runs: dict[str, list[Run]] = {}
    for run in recording.runs:
        runs.setdefault(recording.name_of(run), []).append(run)
    shown = _chosen(findings, list(runs))
    concerned = [name for f in findings for name in f.runs if name in runs]
    notes = {name: ", ".join(dict.fromkeys(f.kind for f in findings if name in f.runs)) for name in shown}
    start = next(iter(concerned), "")
    plots = recorded_plots(recording.dataset, {name: runs[name] for name in runs if name in shown}, notes, start)
    return render_page(
        "check.html.j2", title=f"Data check: {recording.dataset.name}", dataset=recording.dataset.name, command=command,
        tiles=_tiles(recording, findings, len(runs)), plots=True, style=_STYLE,
        findings=[_row(f, runs) for f in findings],
        lines=document["lines"], contradictions=document["contradictions"], tracks=plots,
        which=_which(shown, set(concerned), len(runs)),
        facts=fact_lines({key: value for key,
                value in document.items() if key not in ("findings", "lines", "contradictions")}),
    )  # fmt: skip


def _chosen(findings: Sequence[Finding], names: Sequence[str]) -> list[str]:
    """Names of the runs to draw: of each finding in turn its next one, then the others where a finding concerns all
    runs or there is none; RUNS at most."""
    known = set(names)
    turns = zip_longest(*([name for name in f.runs if name in known] for f in findings))
    chosen = [name for turn in turns for name in turn if name is not None]
    if not chosen or any(not f.runs for f in findings):
        chosen += names
    return list(dict.fromkeys(chosen))[:RUNS]


def _which(shown: Sequence[str], concerned: set[str], total: int) -> str:
    drawn = f"{len(shown)} of {total} run{'s' * (total != 1)} {'is' if len(shown) == 1 else 'are'} drawn"
    if not concerned:
        return f"{drawn}, the first of the data set. No finding concerns a single run."
    missing = len(concerned - set(shown))
    named = (
        f"{len(concerned)} run{'s have' if len(concerned) != 1 else ' has'} a finding of "
        f"{'their' if len(concerned) != 1 else 'its'} own"
    )
    return f"{drawn}. {named}" + (f"; {missing} of them are not drawn (at most {RUNS} on a page)." if missing else ".")


def _tiles(recording: Recording, findings: Sequence[Finding], runs: int) -> list[Tile]:
    counts = {level: sum(f.severity == level for f in findings) for level in SEVERITIES}
    verdict = ", ".join(f"{counts[level]} {level}{'s' * (counts[level] != 1)}" for level in ("error", "warning"))
    notes = f"{counts['note']} note{'s' * (counts['note'] != 1)}"
    what = "fits would be wrong" if counts["error"] else "fits would suffer" if counts["warning"] else "no fault found"
    samples = sum(len(run) for run in recording.runs)
    return [
        Tile("Verdict", verdict, f"{what}; {notes}"), Tile("Runs", str(runs), recording.dataset.ship.name),
        Tile("Samples", str(samples), f"{samples * recording.dt / 3600.0:.3g} h together"),
        Tile("Time step dt", f"{recording.dt:g} s", f"{1.0 / recording.dt:.3g} Hz"),
    ]  # fmt: skip


def _row(finding: Finding, runs: dict[str, list[Run]]) -> dict[str, Any]:
    names, more = finding.runs[:_NAMED], len(finding.runs) - _NAMED
    where = (
        ", ".join(names) + (f" and {more} more" if more > 0 else "")
        if names
        else "all runs"
        if len(runs) > 1
        else next(iter(runs))
    )
    return {
        "level": finding.severity, "by": SEVERITIES.index(finding.severity), "kind": finding.kind,
        "channels": ", ".join(finding.channels),
        "text": finding.text, "where": where, "line": finding.line, "todo": finding.todo,
        "evidence": _evidence(finding.picture) if finding.picture is not None else None,
    }  # fmt: skip


def _evidence(picture: Picture) -> dict[str, Any] | None:
    """Title, curves by name and the content of an SVG element; None where nothing can be drawn."""
    curves = []
    for curve in picture.curves:
        x, y = np.asarray(curve.x, float), np.asarray(curve.y, float)
        kept = thinned(np.column_stack([y]), _POINTS)
        curves.append((x[kept], y[kept]))
    finite = [np.isfinite(x) & np.isfinite(y) for x, y in curves]
    xs, ys = (np.concatenate([c[axis][ok] for c, ok in zip(curves, finite, strict=True)]) for axis in (0, 1))
    if not len(xs):
        return None
    axes = Axes(_span(xs), _span(ys), 620.0, 300.0)
    parts = [axes.grid(str(escape(picture.xlabel)), str(escape(picture.ylabel)))]
    for i, (x, y) in enumerate(curves):
        colour = f"c{i % COLOURS}"
        if picture.curves[i].style.strip("-:"):  # a marker of matplotlib's
            ok = finite[i]
            dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(axes.px(x[ok]), axes.py(y[ok]), strict=True))
            parts.append(f'<path class="dots {colour}" d="{dots}"/>')
        if set(picture.curves[i].style) & set("-:"):
            parts.append(f'<path class="line {colour}" d="{axes.line(x, y)}"/>')
    return {
        "title": picture.title,
        "svg": "".join(parts),
        "curves": [(i % COLOURS, c.label) for i, c in enumerate(picture.curves)],
    }


def _span(values: np.ndarray) -> tuple[float, float]:
    """Range from the least to the greatest value with a margin, never empty."""
    low, high = float(values.min()), float(values.max())
    margin = 0.04 * (high - low) if high - low > 1e-9 * max(abs(low), abs(high), 1.0) else 0.5 * max(abs(high), 1.0)
    return low - margin, high + margin
