"""A diagnosis in words, for the terminal and the page."""

from __future__ import annotations

import math
import shlex
import textwrap

from ..diagnosis.outcome import Candidate, Cause, Diagnosis, Estimate, Gain

_SHOWN = 10
WIDTH = 118


def quantity(value: float, unit: str) -> str:
    """A value with its unit; angles in degrees."""
    if value is None or not math.isfinite(value):
        return "-"
    if unit in ("rad", "rad/s"):
        return f"{math.degrees(value):.3g} {unit.replace('rad', 'deg')}"
    return f"{value:.3g}" + ("" if unit == "1" else f" {unit}")


def estimate(name: str, e: Estimate) -> str:
    """Such as `speed 0.31 m/s [0.28, 0.34]`."""
    factor = math.degrees(1.0) if e.unit.startswith("rad") else 1.0
    low, high = (f"{factor * v:.3g}" for v in e.ci95)
    interval = "" if e.ci95[0] == e.ci95[1] else f" [{low}, {high}]"
    return f"{name} {quantity(e.value, e.unit)}{interval}"


def gain_words(g: Gain | None) -> str:
    """What the extension is worth."""
    if g is None:
        return "The gain on held-out runs was not measured."
    low, high = (100.0 * v for v in g.ci95)
    change = "less" if g.relative >= 0 else "MORE"
    return (
        f"Held-out {g.metric} {g.before:.3g} -> {g.after:.3g} m ({100 * abs(g.relative):.0f} % {change} [{low:.0f}, {high:.0f}]), "
        f"{g.runs_better} runs better."
    )


def headline(d: Diagnosis) -> str:
    """The verdict in one or two sentences."""
    if d.verdict == "found":
        named = ", ".join(f"{c.effect} ({'; '.join(estimate(k, e) for k, e in list(c.parameters.items())[:2])})" for c in d.causes)
        return f"Found: {named}. {gain_words(d.gain)}"
    if d.verdict == "unknown" and d.unknown:
        return (
            f"Something is missing that is not in the library: a force in {d.unknown['axis']} that depends on {d.unknown['variable']} "
            f"(score {d.unknown['score']:.0f}; no named effect explains as much)."
        )
    if d.verdict == "unknown":
        return "Nothing is named: the plain model does not seem to belong to these data. See the warnings."
    return "Nothing found: no effect of the library, and no unexplained dependence, is worth naming. See below what would have been seen."


def next_command(d: Diagnosis) -> str:
    """The command that compares the plain model with the extended one."""
    inside = [c.effect for c in d.causes if c.effect not in ("unit_or_sign_error", "change_point")]
    model = "+".join(["physics", *inside])
    return f"shipbench run --model physics --model {shlex.quote(model)} --dataset {shlex.quote(d.dataset)}" if inside else ""


def detectable(c: Candidate) -> str:
    """Smallest size that would have been named, per amplitude."""
    parts = [f"{name} {quantity(v, _unit(c, name))}" for name, v in c.detectable.items() if v is not None and math.isfinite(v)]
    return ", ".join(parts) or "-"


def _unit(c: Candidate, name: str) -> str:
    if name in c.units:
        return c.units[name]
    return next((u for u in c.units.values() if u != "rad"), "1")


def cause_lines(c: Cause) -> list[str]:
    """A cause with sizes, evidence and confusions."""
    strength = f"score {c.score:.0f}, p {c.p_value:.2g}" if math.isfinite(c.score) else "by kinematics"
    lines = [f"  {c.rank}. {c.effect} ({strength})"]
    lines += [f"       {estimate(k, e)}" for k, e in c.parameters.items()]
    lines += textwrap.wrap(c.evidence + ".", WIDTH, initial_indent="       ", subsequent_indent="       ") if c.evidence else []
    if c.confused_with:
        lines.append(f"       cannot be told from {', '.join(c.confused_with)} with these data")
        lines += textwrap.wrap(f"to separate them: {c.separating_manoeuvre}", WIDTH, initial_indent="       ", subsequent_indent="       ")
    return lines


def summary_lines(d: Diagnosis) -> list[str]:
    """The whole diagnosis as plain lines of at most 120 columns."""
    lines = [f"Diagnosis of {d.dataset} ({d.seconds:.0f} s)", "", *textwrap.wrap(headline(d), WIDTH), ""]
    for warning in d.warnings:
        lines += textwrap.wrap(f"WARNING: {warning}", WIDTH)
    if d.what_is_wrong:
        lines.append("What the plain physics model gets wrong:")
        for w in d.what_is_wrong:
            depends = f"its force follows {w.depends_on}" if w.depends_on else "its force follows no single variable"
            lines += textwrap.wrap(f"{w.channel}: {100 * w.share_of_error:.0f} % of the error; {depends}; {w.when}", WIDTH, initial_indent="  ",
                                   subsequent_indent="      ")  # fmt: skip
        lines.append("")
    if d.causes:
        lines.append("Causes:")
        for c in d.causes:
            lines += cause_lines(c)
        lines.append("")
    lines.append(f"Candidates (best {_SHOWN} of {len(d.candidates)}; the smallest size that would have been named):")
    for x in d.candidates[:_SHOWN]:
        score = f"{x.score:9.1f}" if math.isfinite(x.score) else "        -"
        lines.append(f"  {x.effect:<24s}{score}  {x.rejected_because}"[:WIDTH])
    if d.verdict == "none":
        lines += ["", "Smallest size of each effect that would have been seen:"]
        lines += [f"  {x.effect:<24s}{detectable(x)}" for x in sorted(d.candidates, key=lambda x: x.effect) if detectable(x) != "-"]
    if command := next_command(d):
        lines += ["", f"Extended model: {d.extended_model}", f"  {command}"]
    return lines
