"""A diagnosis on disk: diagnosis.json, summary.txt and a self-contained page."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from html import escape
from pathlib import Path

from ..diagnosis.outcome import Diagnosis
from .diagnosis_text import cause_lines, detectable, estimate, gain_words, headline, next_command, summary_lines

_STYLE = """
:root { color-scheme: light dark; --ink: #1c2733; --paper: #ffffff; --soft: #eef2f5; --line: #d5dde3; --accent: #00798c; --warn: #a15c00; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e9ee; --paper: #12181e; --soft: #1d262e; --line: #34424e; --accent: #4fc3d4; --warn:
#f0b14a; } }
body { font: 16px/1.55 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 62rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; margin-bottom: .2rem; overflow-wrap: anywhere; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.verdict { background: var(--soft); border-left: .35rem solid var(--accent); padding: .8rem 1rem; font-size: 1.08rem; }
.warning { color: var(--warn); font-weight: 600; } .small { font-size: .87rem; opacity: .85; }
.scroll { overflow-x: auto; } table { border-collapse: collapse; font-size: .87rem; width: 100%; }
th, td { text-align: left; padding: .25rem .6rem; border-bottom: 1px solid var(--line); vertical-align: top; } td.n { text-align: right;
white-space: nowrap; }
figure { margin: .6rem 0; background: #ffffff; border-radius: .3rem; padding: .3rem; } figure svg { width: 100%; height: auto; display: block; }
pre { background: var(--soft); padding: .6rem; overflow-x: auto; font-size: .85rem; }
"""


def write_diagnosis(d: Diagnosis, folder: Path) -> list[Path]:
    """Write diagnosis.json, summary.txt and report.html, each atomically; the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {
        "diagnosis.json": json.dumps(d.document(), indent=1, allow_nan=False),
        "summary.txt": "\n".join(summary_lines(d)) + "\n",
        "report.html": page(d),
    }
    written = []
    for name, text in texts.items():
        temporary = folder / f".{name}.tmp"
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, folder / name)
        written.append(folder / name)
    return written


def page(d: Diagnosis) -> str:
    """The page: everything inline, nothing fetched."""
    parts = [f"<h1>Diagnosis of {escape(d.dataset)}</h1>", f'<p class="verdict">{escape(headline(d))}</p>']
    parts += [f'<p class="warning">{escape(w)}</p>' for w in d.warnings]
    changed = d.verdict == "found"
    if d.causes:
        parts.append("<h2>Causes and evidence</h2>")
        for c in d.causes:
            rows = [[k, estimate("", e).strip()] for k, e in c.parameters.items()]
            parts.append(f"<h3>{c.rank}. {escape(c.effect)}</h3>" + _table(["size", "value [95 % interval]"], rows))
            parts += [f"<p>{escape(line.strip())}</p>" for line in cause_lines(c)[1 + len(c.parameters) :]]
        parts.append(f"<p>{escape(gain_words(d.gain))}</p>")
    parts.append(_pictures(d, changed))
    rows = [[w.channel, f"{100 * w.share_of_error:.0f} %", w.depends_on or "no single variable", w.when] for w in d.what_is_wrong]
    parts.append("<h2>What is wrong, in words</h2>" + _table(["channel", "share of error", "missing force follows", "when"], rows))
    if d.gain_per_run:
        from . import diagnosis_plots as plots

        parts.append("<h2>Gain per run, held out</h2>" + _figure(plots.gain_per_run(d)))
    parts.append(_ranking(d))
    parts.append("<h2>What remains</h2>" + _table(["", ""], _flat(d.unexplained_after)))
    confused = [c for c in d.causes if c.confused_with]
    if confused:
        rows = [[c.effect, ", ".join(c.confused_with), c.separating_manoeuvre] for c in confused]
        parts.append("<h2>What these data cannot tell apart</h2>" + _table(["named", "could also be", "manoeuvre that would tell"], rows))
    if command := next_command(d):
        parts.append(f"<h2>Next</h2><p>Extended model: <code>{escape(d.extended_model)}</code></p><pre>{escape(command)}</pre>")
    parts.append(_method(d))
    title = f"<title>Diagnosis of {escape(d.dataset)}</title>"
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">{title}<style>{_STYLE}</style>'
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{"".join(parts)}</body></html>\n'


def _pictures(d: Diagnosis, changed: bool) -> str:
    if d.trace is None:
        return ""
    from ..diagnosis.wrong import error_tables
    from . import diagnosis_plots as plots

    tables = error_tables(d.trace)
    white = [[k, f"{v:.1f}", "white" if v <= 1.0 else "not white"] for k, v in tables.white.items()]
    against = sorted(((k[0], k[1], f"{v:.1f}") for k, v in tables.inputs.items()), key=lambda r: -float(r[2]))[:8]
    return "".join([
        "<h2>Tracks before and after</h2>", _figure(plots.tracks(d.trace, changed)),
        '<p class="small">The runs where the plain model is worst. Models are fitted to all runs here; the gain above is held out.</p>',
        "<h2>Growth of the error</h2>", _figure(plots.growth(d.trace, changed)),
        "<h2>Where the plain model is wrong</h2>", _figure(plots.slices(tables)),
        '<p class="small">Root mean square of the error, each channel over its own spread in the measurement, summed.</p>',
        "<h2>The force that the plain model lacks</h2>", _figure(plots.forces(d.trace, tables)),
        "<h2>Are the residuals of the smoothed plain model white?</h2>",
        _table(["channel", "Ljung-Box over its 95 % limit", ""], white),
        "<p>Greatest cross-correlations with past inputs, over their 95 % bound:</p>", _table(["residual", "input", "over bound"], against),
    ])  # fmt: skip


def _ranking(d: Diagnosis) -> str:
    rows = []
    for c in d.candidates:
        score = f"{c.score:.1f}" if math.isfinite(c.score) else "-"
        p = f"{c.p_value:.2g}" if math.isfinite(c.p_value) else "-"
        rows.append([c.effect, c.family, score, p, c.rejected_because, detectable(c)])
    return "<h2>All candidates</h2>" + _table(["effect", "family", "score", "p", "why it was not named", "smallest size that would have been"], rows)


def _flat(tree: dict, prefix: str = "") -> list[list[str]]:
    rows = []
    for key, value in tree.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, dict):
            rows += _flat(value, f"{name}: ")
        else:
            rows.append([name, f"{value:.3g}" if isinstance(value, float) else str(value)])
    return rows


_METHOD = """
The plain physics model (eq. 2 to 8 of the source paper) is fitted together with a latent force, Ornstein-Uhlenbeck in time and
without memory of the state, that stands for all that is not modelled; ordinary differences between ships are free within their
published spread. Every effect of the library is linearised about that fit and compared by its evidence (score: twice the gain in
log evidence; p: of the greatest score under the fitted null, by bootstrap). The best are refitted without linearising, added while
they are worth the threshold, and dropped again where later ones replace them. Causes between command and record of an actuator are
looked for in the actuator alone. Gains are measured on runs that neither selection nor fit has seen, with the latent force off.
"""


def _method(d: Diagnosis) -> str:
    return (
        f"<h2>How this was computed</h2><p class='small'>{_METHOD}</p>"
        f"<p class='small'>Data fingerprint {escape(d.fingerprint)}; {d.seconds:.0f} s.</p>"
    )


def _figure(svg: str) -> str:
    return f"<figure>{svg}</figure>"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(str(v))}</td>" for v in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table></div>'
