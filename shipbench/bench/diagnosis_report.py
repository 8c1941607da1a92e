"""A diagnosis on disk: diagnosis.json, summary.txt and a self-contained page."""

from __future__ import annotations

import json
import math
import os
import shlex
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from ..diagnosis.outcome import Cause, Diagnosis, Gain, what_it_is
from ..render.html import content_policy
from .diagnosis_text import cause_texts, detectable, estimate, figure, gain_words, headline, in_words, next_command, summary_lines

_STYLE = """
:root { color-scheme: light dark; --ink: #1c2733; --paper: #fff; --soft: #f1f4f6; --line: #d5dde3; --accent: #00707f; --warn: #9a5200;
  --before: #c4500a; --after: #0069a8; }
@media (prefers-color-scheme: dark) { :root { --ink: #e2e8ed; --paper: #12181e; --soft: #1c252d; --line: #35434f; --accent: #4fc3d4;
  --warn: #f0b14a; --before: #f2894a; --after: #5cb8f2; } }
* { box-sizing: border-box; }
body { font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 68rem; margin: 0 auto; padding: 1rem 1rem 3rem; }
h1 { font-size: 1.55rem; line-height: 1.25; margin: .3rem 0 .8rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.4rem 0 .5rem; padding-top: .6rem; border-top: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.2rem 0 .3rem; } p { max-width: 46rem; margin: .5rem 0; overflow-wrap: anywhere; }
nav { font-size: .87rem; line-height: 1.9; margin: 1rem 0; } nav a { color: var(--accent); margin-right: .9rem; display: inline-block; }
.verdict { background: var(--soft); border-left: .35rem solid var(--accent); padding: .8rem 1rem; font-size: 1.08rem; max-width: none; }
.verdict.unknown, .warning { border-left: .35rem solid var(--warn); } .warning { background: var(--soft); padding: .5rem 1rem; max-width: none; }
.small, figcaption { font-size: .85rem; opacity: .85; } .grid { display: grid; gap: .9rem; grid-template-columns: repeat(auto-fill,
  minmax(min(100%, 17.5rem), 1fr)); }
figure { margin: 0; min-width: 0; } figcaption { overflow-wrap: anywhere; line-height: 1.35; padding: 0 .3rem; }
figure svg * { stroke-linejoin: round; stroke-linecap: butt; }
figure svg { width: 100%; height: auto; display: block; } figure svg text { font-family: inherit !important; }
.wide { overflow-x: auto; } .wide figure { min-width: 34rem; max-width: 54rem; }
.key { font-size: .87rem; margin: .4rem 0; } .key span { margin-right: 1.1rem; white-space: nowrap; }
.key i { display: inline-block; width: 1.5rem; height: .22rem; vertical-align: middle; margin-right: .4rem; }
.scroll { overflow-x: auto; margin: .5rem 0; } table { border-collapse: collapse; font-size: .87rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .28rem .9rem .28rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
th { font-weight: 600; white-space: nowrap; } td { min-width: 3.5rem; } td.long { min-width: 15rem; }
.n { text-align: right; white-space: nowrap; } tr.named td { font-weight: 600; }
.bar { display: inline-block; height: .65em; background: var(--before); margin-right: .4rem; }
pre { background: var(--soft); padding: .7rem 1rem; overflow-x: auto; font-size: .85rem; } summary { cursor: pointer; margin: .6rem 0; }
"""
_MEASURED_KEY = '<span><i style="background:currentColor"></i>measured</span>'
_BEFORE_KEY = '<span><i style="background:var(--before)"></i>physics (plain)</span>'
_AFTER_KEY = '<span><i style="background:var(--after)"></i>extended</span>'


def write_diagnosis(d: Diagnosis, folder: Path) -> list[Path]:
    """Write diagnosis.json, summary.txt and report.html into `folder` (made if missing), each atomically; returns the paths."""
    content = json.dumps(document(d), indent=1, allow_nan=False)
    return [
        _write(folder / "diagnosis.json", content + "\n"),
        _write(folder / "summary.txt", "\n".join(summary_lines(d)) + "\n"),
        write_report(d, folder / "report.html"),
    ]


def document(d: Diagnosis) -> dict[str, Any]:
    """What diagnosis.json holds: `Diagnosis.document`, and every cause in words."""
    content = d.document()
    for c, cause in zip(d.causes, content["causes"], strict=True):
        cause["in_words"] = in_words(c)
    return content


def write_report(d: Diagnosis, path: Path) -> Path:
    """Write the page alone; returns `path`."""
    return _write(path, page(d))


def _write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    # names of runs may hold lone surrogates from badly decoded files
    temporary.write_text(text, encoding="utf-8", errors="replace")
    os.replace(temporary, path)
    return path


def page(d: Diagnosis) -> str:
    """The page: everything inline, nothing fetched."""
    from . import diagnosis_pictures as pictures

    sections: list[tuple[str, str]] = [("Causes and evidence", _causes(d))]
    sections += pictures.sections(d)
    sections += [
        ("Gain per run, held out", _gains(d)), ("All candidates", _ranking(d)), ("Detection limits", _smallest(d)),
        ("What these data cannot tell apart", _confused(d)), ("What remains", _remains(d)), ("Next", _next(d)), ("How this was computed", _method(d)),
    ]  # fmt: skip
    sections = [(title, body) for title, body in sections if body]
    links = " ".join(f'<a href="#s{i}">{escape(title)}</a>' for i, (title, _) in enumerate(sections))
    body = [
        f"<h1>Diagnosis of {escape(d.dataset)}</h1>", f'<p class="verdict {escape(d.verdict)}">{escape(headline(d))}</p>',
        *(f'<p class="warning"><b>Warning:</b> {escape(w)}</p>' for w in d.warnings), f"<nav>{links}</nav>",
        *(f'<section id="s{i}"><h2>{escape(title)}</h2>{text}</section>' for i, (title, text) in enumerate(sections)),
    ]  # fmt: skip
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{content_policy(_STYLE, images=True, style_attributes=True)}">'
        f"<title>Diagnosis of {escape(d.dataset)}</title><style>{_STYLE}</style>"
    )
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{"".join(body)}</body></html>\n'


def key(changed: bool, measured: bool = False) -> str:
    """The legend of the pictures below it."""
    return f'<p class="key">{_MEASURED_KEY if measured else ""}{_BEFORE_KEY}{_AFTER_KEY if changed else ""}</p>'


def paragraph(text: str, small: bool = False) -> str:
    """Escaped text."""
    return f'<p class="small">{escape(text)}</p>' if small else f"<p>{escape(text)}</p>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = (), long: Sequence[int] = (), named: str = "") -> str:
    """A table that scrolls by itself. numbers, long: columns set to the right, and wide; named: first cell of rows to stress with this last cell."""

    def kind(i: int) -> str:
        return ' class="n"' if i in numbers else ' class="long"' if i in long else ""

    cells = "".join(f"<th{kind(i)}>{escape(h)}</th>" for i, h in enumerate(head))
    body = ""
    for row in rows:
        stress = ' class="named"' if named and row[-1] == named else ""
        body += f"<tr{stress}>" + "".join(f"<td{kind(i)}>{escape(str(v))}</td>" for i, v in enumerate(row)) + "</tr>"
    top = f"<thead><tr>{cells}</tr></thead>" if any(head) else ""
    says = f"Table of {escape(', '.join(filter(None, head)))}" if any(head) else "Table"
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{says}"><table>{top}<tbody>{body}</tbody></table></div>'


def _causes(d: Diagnosis) -> str:
    if d.verdict == "unknown" and d.unknown:
        share = d.unknown.get("share")
        taken = ""
        if isinstance(share, float) and math.isfinite(share):
            taken = f" It takes {100 * share:.0f} % of the variance of the missing force, whose pictures are below."
        return paragraph(f"No effect of the library explains the runs as well as {what_it_is(d.unknown)}.{taken}")
    if not d.causes:
        return paragraph("No cause is identified.")
    alone = d.gain if len(d.causes) == 1 else None
    return "".join(_cause(c, alone) for c in d.causes) + paragraph(gain_words(d.gain, len(d.causes)))


def _cause(c: Cause, alone: Gain | None) -> str:
    """A cause with its sizes and what is known of it; alone: the gain where it is the only cause."""
    words = in_words(c)
    name = "" if c.effect in words else f" <small>({escape(c.effect)})</small>"
    text = f"<h3>{c.rank}. {escape(words[0].upper() + words[1:])}{name}</h3>"
    text += "<ul>" + "".join(f"<li>{escape(estimate(c.effect, n, e))}</li>" for n, e in c.parameters.items()) + "</ul>" if c.parameters else ""
    return text + "".join(map(paragraph, cause_texts(c, alone)))


def _gains(d: Diagnosis) -> str:
    if not d.gain_per_run:
        return ""
    from .diagnosis_pictures import picture
    from .diagnosis_plots import gain_per_run

    rows = [
        [name, figure(b), figure(a), f"{100 * (1 - a / b):+.0f} %" if b > 0 else "-"] for name, b, a in sorted(d.gain_per_run, key=lambda r: -r[1])
    ]
    listed = table(["run", "before [m]", "after [m]", "less error"], rows, numbers=(1, 2, 3))
    return (
        key(True) + f'<div class="wide" tabindex="0" role="region" aria-label="Gain per run">{picture(gain_per_run(d.gain_per_run))}</div>'
        + paragraph("Mean distance of every run, from models that were neither chosen nor fitted with it.", small=True)
        + f"<details><summary>Every run in figures</summary>{listed}</details>"
    )  # fmt: skip


def _number(value: float, text: str) -> str:
    return format(value, text) if math.isfinite(value) else "-"


def _ranking(d: Diagnosis) -> str:
    rows = [[c.effect, c.family, _number(c.score, ".1f"), _number(c.p_value, ".2g"), c.rejected_because] for c in d.candidates]
    note = "Score: twice the gain in log evidence when this one effect is added to the plain model. p: for the best of all candidates by chance."
    return table(["effect", "family", "score", "p", "why it was or was not named"], rows, (2, 3), (4,), "named") + paragraph(note, small=True)


def _smallest(d: Diagnosis) -> str:
    rows = [[c.effect, c.family, detectable(c)] for c in sorted(d.candidates, key=lambda c: (c.family, c.effect)) if c.detectable]
    note = (
        "At this size the expected score reaches the threshold, beside the plain model of these runs. A larger one would probably have been named; "
        "of a smaller one nothing can be said. -: cannot be detected. Effects that are not listed are looked for in another way."
    )
    body = table(["effect", "family", "detection limit"], rows) + paragraph(note, small=True)
    return body if d.verdict == "none" else f"<details><summary>Table of {len(rows)} effects</summary>{body}</details>" if rows else ""


def _confused(d: Diagnosis) -> str:
    rows = [[c.effect, ", ".join(c.confused_with), c.separating_manoeuvre or "-"] for c in d.causes if c.confused_with]
    return table(["named", "could also be", "manoeuvre that would tell"], rows, long=(2,)) if rows else ""


def _remains(d: Diagnosis) -> str:
    return table(["", ""], _flat(d.unexplained_after), long=(0,)) if d.unexplained_after else ""


def _flat(tree: dict, prefix: str = "") -> list[list[str]]:
    rows = []
    for name, value in tree.items():
        label = f"{prefix}{name}".replace("_", " ")
        if isinstance(value, dict):
            rows += _flat(value, f"{label}: ")
        else:
            rows.append([label, "-" if value is None else _number(value, ".3g") if isinstance(value, float) else str(value)])
    return rows


def _next(d: Diagnosis) -> str:
    command = next_command(d)
    if not command:
        return ""
    words = f"<p>Extended model: <code>{escape(d.extended_model)}</code>. To compare it with the plain one:</p>"
    return f'{words}<pre tabindex="0">{escape(command)}</pre>'


_METHOD = """
The plain physics model (eq. 2 to 8 of the source paper) is fitted together with a latent force, Ornstein-Uhlenbeck in time and
without memory of the state, that stands for all that is not modelled; ordinary differences between ships are free within their
published spread. Every effect of the library is linearised about that fit and compared by its evidence (score: twice the gain in
log evidence; p: of the greatest score under the fitted null, by bootstrap). The best are refitted without linearising, added while
they are worth the threshold, and dropped again where later ones replace them. Causes between command and record of an actuator are
looked for in the actuator alone. Gains are measured on runs that neither selection nor fit has seen, with the latent force off.
"""


def _method(d: Diagnosis) -> str:
    command = f"shipbench diagnose {shlex.quote(d.spec or d.dataset)}"
    return (
        f"<p>{_METHOD.strip()}</p><pre tabindex='0'>{escape(command)}</pre>"
        f"<p class='small'>Data fingerprint <code>{escape(d.fingerprint)}</code>; {d.seconds:.0f} s.</p>"
    )
