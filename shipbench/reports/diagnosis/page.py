"""Page of `diagnose`: verdict, causes with the line that corrects each, measured and predicted runs as linked plots,
the evidence."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...diagnosis.evaluation.residuals import error_tables
from ...diagnosis.result import Cause, Diagnosis, what_it_is
from ...render.html import Tile, render_page
from ...render.linked import switch
from ...render.table import table_cells
from ..recorded import RUNS
from . import evidence as svg
from . import tables as tables
from .linked import FITS, changed, position_errors, rollout_plots, rollouts
from .remains import remaining_sentences
from .text import (
    added,
    baseline,
    calibration_words,
    drawn,
    estimate,
    figure,
    force_words,
    gain_share,
    gain_words,
    grade,
    headline,
    in_words,
    next_command,
    own_gain,
    strength,
)

_STYLE = (
    svg.STYLE
    + """
.cause { border-top: 1px solid var(--line); padding-bottom: .6rem; } .cause:first-of-type { border-top: 0; }
.cause h3 { margin: .9rem 0 .4rem; }
.cause dl { margin: 0; } .cause dt { color: var(--dim); font-size: .86rem; margin-top: .45rem; }
.cause dd { margin: 0; max-width: 46rem; }
.aside { background: var(--soft); border-left: .25rem solid var(--accent);
  padding: .2rem .9rem .5rem; margin-top: .6rem; }
.aside pre { margin: .3rem 0 0; padding: .3rem 0; } .aside button.copy { background: var(--paper); }
@media (min-width: 50rem) { .beside { display: grid; gap: 0 1.5rem;
  grid-template-columns: minmax(0, 1fr) minmax(0, 24rem); align-items: start; } }
.drawn h4 { font-size: .95rem; margin: .8rem 0 .2rem; }
"""
)


def diagnosis_page(d: Diagnosis) -> str:
    """HTML of a diagnosis; it needs no network and no other file."""
    return render_page(
        "diagnosis.html.j2", title=f"Diagnosis: {d.dataset}", dataset=d.dataset,
        command=f"shipbench diagnose {shlex.quote(d.spec or d.dataset)}"
        + (f" --model {shlex.quote(d.simulation)}" if d.simulation else ""),
        judged=drawn(d)[0] if d.simulation else "calibrated ship",
        lead=f"{headline(d)} {calibration_words(d)}".strip(), tiles=_tiles(d),
        plots=d.trace is not None, style=_STYLE,
        warnings=d.warnings, causes=[_cause(c, d) for c in d.causes], instead=_no_cause(d), gain=_gain_of_all(d),
        extended_model=d.extended_model,
        compare=next_command(d), remains=remaining_sentences(d),
        wrong=[_wrong(w.channel, w.share_of_error, w.when) for w in d.what_is_wrong],
        candidates=table_cells(tables.candidates(d)), limits=table_cells(tables.detection_limits(d)),
        found=d.verdict == "found",
        gains=table_cells(tables.gains(d)) if d.gain_per_run else None,
        gain_drawing=svg.gain_per_run(d.gain_per_run) if d.gain_per_run else None,
        size=f"{svg.WIDTH:g} {svg.HEIGHT:g}", fingerprint=d.fingerprint, seconds=d.seconds, **_evidence(d),
    )  # fmt: skip


def _tiles(d: Diagnosis) -> list[Tile]:
    """Tiles of the verdict, position error before and after, evidence, number of runs."""
    tiles = [_verdict(d), _error(d), _sureness(d)]
    if d.trace is not None:
        spans = f"{len(d.trace.run)} predictions of up to {d.trace.t[-1]:.0f} s"
        tiles.append(Tile("Runs", str(len(d.trace.names)), spans))
    return tiles


def _verdict(d: Diagnosis) -> Tile:
    if d.verdict == "found":
        return Tile(
            "Verdict", f"{len(d.causes)} cause{'s' * (len(d.causes) != 1)} found", ", ".join(c.effect for c in d.causes)
        )
    if d.verdict == "unknown":
        return Tile("Verdict", "Unknown cause", what_it_is(d.unknown) if d.unknown else "the reasons are below")
    return Tile(
        "Verdict",
        "No cause found",
        "the warnings below give the reason" if d.warnings else "only ordinary differences between ships",
    )


def _error(d: Diagnosis) -> Tile:
    """Tile of the held-out errors of ship file, calibrated ship and extended model, or of their absence."""
    own = d.calibration if d.calibration is not None and d.calibration.held_out else None
    values, names = (
        ([own.before, own.after], ["your simulation" if d.simulation else "ship file", "calibrated"])
        if own
        else ([], [])
    )
    if d.gain is not None and added(d):
        values, names = [*(values or [d.gain.before]), d.gain.after], [*(names or ["calibrated"]), "with the causes"]
    if values:
        share = f": {gain_share(d.gain)}" if d.gain is not None else ""
        floor = f"; noise floor {figure(own.noise_floor.position, 2)} m" if own and own.noise_floor else ""
        shown = " to ".join(f"{figure(v)} m" for v in values)
        return Tile("Held-out position error", shown, f"{', '.join(names)}{share}{floor}")
    if d.trace is None:
        return Tile("Held-out position error", "not measured")
    errors = [position_errors(d.trace, p) for p in rollouts(d.trace, changed(d))]
    means = [_mean_error(e[~np.isnan(e)]) for e in errors if not np.isnan(e).all()]
    return Tile(
        "Held-out position error",
        "not measured",
        "on the runs of the fit: " + " to ".join(means) + (f", {' to '.join(drawn(d))}" * (len(means) > 1)),
    )


def _mean_error(errors: np.ndarray) -> str:
    lost = int(np.isinf(errors).sum())
    return f"lost in {lost} of {len(errors)} predictions" if lost else f"{figure(float(errors.mean()))} m"


def _file_or_own(d: Diagnosis) -> str:
    return "your simulation" if d.simulation else "ship file"


def _sureness(d: Diagnosis) -> Tile:
    """Tile of the evidence of the cause with the least of it, of an unknown dependence, or of the best candidate."""
    if d.causes:
        known = [c for c in d.causes if math.isfinite(c.score)]
        if not known:
            return Tile("Evidence", "Certain", "an error of the record itself")
        least = min(known, key=lambda c: c.score)
        note = f"log Bayes factor {0.5 * least.score:.0f}" + (f", {least.support}" if least.support else "")
        return Tile(
            "Evidence", _capital(grade(least.score)), note + (f" (least: {least.effect})" if len(d.causes) > 1 else "")
        )
    if d.unknown:
        return Tile("Evidence", _capital(grade(d.unknown["score"])), f"log Bayes factor {0.5 * d.unknown['score']:.0f}")
    scores = [c for c in d.candidates if math.isfinite(c.score)]
    if not scores:
        return Tile("Evidence", "Not sufficient", "no candidate could be compared")
    best = max(scores, key=lambda c: c.score)
    return Tile(
        "Evidence",
        "Not sufficient",
        f"best candidate: {best.effect}, log Bayes factor {0.5 * best.score:.0f}; {best.rejected_because}",
    )


def _cause(c: Cause, d: Diagnosis) -> dict[str, Any]:
    """Values of a cause for the template: texts, its gain where it is the only one, the causes it is confounded with
    and the trial that separates them."""
    force = force_words(c.force)
    return {
        "title": f"{c.rank}. {_capital(in_words(c))}",
        "sizes": [estimate(c.effect, name, e) for name, e in c.parameters.items()],
        "force": _capital(force) + "." if force else "", "strength": _capital(strength(c)) + ".",
        "evidence": c.evidence,
        "gain": gain_words(own, c, whole=baseline(d)) if (own := own_gain(c, d)) is not None else "",
        "line": _lines(c.correction),
        "rivals": c.confused_with,
        "trial": _capital(c.separating_manoeuvre.rstrip(".")) + "." if c.separating_manoeuvre else "",
    }  # fmt: skip


def _lines(correction: str) -> str:
    """Lines of dataset.toml for a correction such as `[delay] x = 1 and y = 1`."""
    return correction.replace("] ", "]\n").replace(" and ", "\n")


def _gain_of_all(d: Diagnosis) -> str:
    """Text of the gain of several causes together, or that none was measured; that of a single cause stands beside
    it."""
    several = added(d)
    return gain_words(d.gain, *several, whole=baseline(d)) if d.causes and (d.gain is None or len(several) > 1) else ""


def _no_cause(d: Diagnosis) -> str:
    """Text in place of the causes where none is identified."""
    if d.causes:
        return ""
    if d.verdict == "unknown" and d.unknown:
        share = d.unknown.get("share")
        taken = ""
        if isinstance(share, float) and math.isfinite(share):
            taken = f" It explains {100 * share:.0f} % of the variance of the missing force."
        return f"No effect of the library explains the runs as well as {what_it_is(d.unknown)}.{taken}"
    return "No cause is identified. The detection limits state which effects these runs could have shown."


def _wrong(channel: str, share: float, when: str) -> dict[str, str]:
    sentences = " ".join(f"{_capital(part)}." for part in when.replace("^2", "²").split("; ") if part)
    return {"channel": _capital(channel), "share": f"{100 * share:.0f} % of the error", "when": sentences}


def _evidence(d: Diagnosis) -> dict[str, Any]:
    """Drawings from the trace; none where there is no trace."""
    trace, extended = d.trace, changed(d)
    if trace is None:
        return {"traced": False}
    found = error_tables(trace)
    missing = svg.missing_forces(trace, found, extended, tables.LEVEL)
    if d.unknown and d.unknown["variable"] == "position":
        missing += svg.over_places(trace, d.unknown["axis"].split(" and "))
    plots = rollout_plots(trace, extended, drawn(d))
    return {
        "traced": True, "models": [switch(i, name) for i, name in enumerate(drawn(d)[: 2 if extended else 1])],
        "tracks": plots, "fits": FITS, "which": _which(len(plots["runs"]), len(trace.run), trace.held_out, drawn(d)[0]),
        "growth": svg.error_growth(trace, extended), "slices": svg.error_slices(trace, extended), "missing": missing,
        "by_chance": tables.independent(found), "channels": table_cells(tables.channels(trace, found, extended)),
        "dependences": table_cells(tables.dependences(found)),
        "worst": _worst(found.worst_runs), "white": table_cells(tables.whiteness(found)),
        "inputs": table_cells(tables.against_inputs(found)),
        "correlations": [*svg.autocorrelations(trace), *svg.cross_correlations(trace, found)],
    }  # fmt: skip


def _which(drawn: int, total: int, held_out: bool, first: str) -> str:
    some = (
        f"{drawn} of {total} predictions are drawn (at most {RUNS} on a page), evenly spread"
        if drawn < total
        else f"{total} predictions are drawn"
    )
    fitted = (
        "No model was fitted to the runs that it predicts." if held_out else "Here the models are fitted to all runs."
    )
    return f"{some}, from the greatest error of the {first.removeprefix('your ')} to the least. {fitted}"


def _worst(runs: Sequence[tuple[str, float]], listed: int = 5) -> str:
    """Text on the runs with the greatest error of all channels, as multiples of the median run's."""
    if len(runs) < 2:
        return ""
    typical = max(float(np.median([e for _, e in runs])), 1e-12)
    worst = ", ".join(f"{name} ({error / typical:.1f})" for name, error in runs[:listed])
    return f"Runs with the greatest error of all channels, as multiples of the median run's: {worst}."


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
