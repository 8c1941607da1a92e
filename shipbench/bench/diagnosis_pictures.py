"""The sections of a diagnosis page that are drawn from its trace: tracks, growth of the error, what is wrong, the missing force."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from ..diagnosis.outcome import Diagnosis, Trace
from ..diagnosis.wrong import CHANNEL_UNITS, CHANNELS, ErrorTables, error_tables, squared_error
from . import diagnosis_plots as plots
from .diagnosis_report import key, paragraph, table
from .diagnosis_text import figure

_RUNS_LISTED = 5


def sections(d: Diagnosis) -> list[tuple[str, str]]:
    """(title, HTML) of every section; only the words where there is no trace."""
    trace = d.trace
    if trace is None:
        return [("What is wrong", _words(d))] if d.what_is_wrong else []
    tables, changed = error_tables(trace), plots.changed(d)
    fitted = "Runs that were not fitted." if trace.held_out else "Here the models are fitted to all runs; the gain per run is held out."
    lacks = plots.forces(trace, tables, changed)
    if d.unknown and d.unknown["variable"] == "position":
        lacks += plots.over_places(trace, d.unknown["axis"].split(" and "))
    which = "The runs where the plain model is worst" + (", and the one that gains least." if changed else ".")
    return [
        ("Tracks before and after" if changed else "Tracks", key(changed, measured=True) + _grid(plots.tracks(trace, changed))
         + paragraph(f"{which} {fitted}", small=True)),
        ("Growth of the error", key(changed) + _grid(plots.growth(trace, changed))
         + paragraph("Median of all runs; the band holds the middle half of them.", small=True)),
        ("What is wrong", _words(d) + _channels(trace, tables, changed) + "<h3>Where the error is</h3>" + key(changed)
         + _grid(plots.error_slices(trace, tables, changed)) + _worst_runs(tables) + paragraph(
             "Root mean square of the error of all channels, each over its scale in the table above.", small=True)),
        ("The force that the plain model lacks", _grid(lacks) + paragraph(
            "The acceleration that the plain model needs to follow the measurement. Shares are net of what chance takes; whether they could be "
            "chance is tested by giving the runs each other's force, turned round in time, over all variables at once.", small=True)),
        ("Are the residuals white?", _whiteness(trace, tables)),
    ]  # fmt: skip


def picture(panel: plots.Panel) -> str:
    """A figure with its caption; a reader of the screen is told what it shows."""
    svg = panel.svg.replace("<svg", f'<svg role="img" aria-label="{escape(panel.caption or panel.shows)}"', 1)
    return f"<figure>{svg}" + (f"<figcaption>{escape(panel.caption)}</figcaption>" if panel.caption else "") + "</figure>"


def _grid(panels: Iterable[plots.Panel]) -> str:
    return f'<div class="grid">{"".join(map(picture, panels))}</div>'


def _words(d: Diagnosis) -> str:
    rows = [[w.channel, f"{100 * w.share_of_error:.0f} %", w.depends_on or "no single one of those below", w.when] for w in d.what_is_wrong]
    return table(["channel", "share of error", "missing force follows", "when"], rows, numbers=(1,), long=(3,)) if rows else ""


def _channels(trace: Trace, tables: ErrorTables, changed: bool) -> str:
    """Size of every channel's error before and after."""
    after = np.sqrt(np.nanmean(squared_error(trace, trace.after)[0][:, 1:], axis=(0, 1))) if changed and len(trace.t) > 1 else None
    rows = []
    for i, channel in enumerate(CHANNELS):
        unit, factor = CHANNEL_UNITS[channel]
        row = [f"{channel} [{unit}]", figure(tables.size[channel]), figure(factor * float(after[i])) if after is not None else ""]
        rows.append([*row[: 3 if changed else 2], figure(tables.scale[channel]), f"{100 * tables.share[channel]:.0f} %"])
    head = ["channel", "error before", *(["after"] if changed else []), "scale", "share of error"]
    note = (
        "Root mean square of the open-loop error. Scale: root mean square of the channel about its mean in each run, so that the shares do not "
        "add metres to degrees. Share: of the sum of the squared errors over their scales."
    )
    return "<h3>Channel by channel</h3>" + table(head, rows, numbers=range(1, len(head))) + paragraph(note, small=True)


def _worst_runs(tables: ErrorTables) -> str:
    if len(tables.worst_runs) < 2:
        return ""
    typical = float(np.median([e for _, e in tables.worst_runs]))
    worst = ", ".join(f"{name} ({error / max(typical, 1e-12):.1f})" for name, error in tables.worst_runs[:_RUNS_LISTED])
    return paragraph(f"Runs with the greatest error (times that of the median run): {worst}.")


def _whiteness(trace: Trace, tables: ErrorTables) -> str:
    white = [[name, f"{value:.2f}", "white" if value <= 1.0 else "not\N{NO-BREAK SPACE}white"] for name, value in tables.white.items()]
    against = sorted(tables.inputs.items(), key=lambda item: -item[1])
    beyond = [[name, label, f"{value:.2f}"] for (name, label), value in against if value > 1.0]
    text = table(["residual", "Ljung-Box over its 95 % limit", ""], white, numbers=(1,)) + _grid(plots.autocorrelations(trace))
    text += "<h3>Residuals against the inputs before them</h3>"
    if beyond:
        text += table(["residual", "input", "greatest correlation over its 95 % bound"], beyond, numbers=(2,))
    elif against:
        text += paragraph("No correlation with any input goes beyond its 95 % bound. The closest:")
    return text + _grid(plots.cross_correlations(trace, tables)) + paragraph(
        "Residuals of the plain model smoothed with its latent force, over the noise. The shaded band is the 95 % bound of one lag; the figures "
        "above count the greatest of all lags. A smoother leaves some correlation of its own at short lags.", small=True)  # fmt: skip
