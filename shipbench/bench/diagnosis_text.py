"""A diagnosis in words, for the terminal and the page."""

from __future__ import annotations

import math
import shlex

from ..diagnosis.outcome import Candidate, Cause, Diagnosis, Estimate, Gain, what_it_is
from ..effects.base import EFFECTS, Effect
from .tables import display_unit
from .terminal import command_lines, paragraph

_SHOWN = 10
WIDTH = 80
"""Columns of summary.txt."""
DETECTION_LIMIT = 'Detection limit: the smallest effect these runs could have shown ("-": cannot be detected)'
_NO_MODEL = ("unit_or_sign_error", "change_point")


def figure(value: float) -> str:
    """Three significant digits, powers of ten only for what is very small or large."""
    if abs(value) < 1e-12:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        return f"{value:.3g}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def quantity(value: float | None, unit: str) -> str:
    """A value with its unit as people read it: angles in degrees, forces in kN."""
    if value is None or not math.isfinite(value):
        return "-"
    shown, factor = display_unit(unit)
    return figure(factor * value) + ("" if shown == "1" else f" {shown}")


def interval(e: Estimate) -> str:
    """Such as `0.31 m/s (95 %: 0.28 to 0.34)`; without interval where there is none."""
    factor = display_unit(e.unit)[1]
    known = all(v is not None and math.isfinite(v) for v in e.ci95)
    if not known and e.unit == "1" and e.value is not None and e.value == round(e.value):
        return f"{e.value:.0f}"  # a choice: the number of a run, a side
    return quantity(e.value, e.unit) + (f" (95 %: {figure(factor * e.ci95[0])} to {figure(factor * e.ci95[1])})" if known else "")


def estimate(effect: str, name: str, e: Estimate) -> str:
    """A parameter of an effect in words: a direction as three digits, a relative change in percent, else its value with unit."""
    part = _effect(effect)
    if e.value is None or not math.isfinite(e.value) or part is None:
        return f"{name} {interval(e)}"
    known = all(v is not None and math.isfinite(v) for v in e.ci95)
    if part.vector is not None and name == part.vector[1]:
        return f"{name} {_bearing(e.value)}" + (f" (95 %: {_bearing(e.ci95[0])} to {_bearing(e.ci95[1])})" if known else "")
    parameter = next((p for p in part.parameters if p.name == name), None)
    label = f"{parameter.title} {name}" if parameter is not None and parameter.title else name
    if parameter is not None and parameter.relative:
        doubt = f" (95 %: {100 * e.ci95[0]:+.0f} to {100 * e.ci95[1]:+.0f} %)" if known else ""
        return f"{label} {100 * abs(e.value):.0f} % {'smaller' if e.value < 0 else 'larger'}{doubt}"
    return f"{label} {interval(e)}"


def _effect(name: str) -> Effect | None:
    """The effect of this name; None for one that is not installed here."""
    return EFFECTS.get(name) if name in EFFECTS else None


def _bearing(angle: float) -> str:
    """An angle [rad] as a bearing of three digits."""
    return f"{round(math.degrees(angle)) % 360:03d}°"


def _change(relative: float) -> str:
    return f"{100.0 * abs(relative):.0f} % {'less' if relative >= 0 else 'more'}"


def gain_words(g: Gain | None) -> str:
    """What the extension is worth on runs that were not fitted."""
    if g is None:
        return "The gain on held-out runs was not measured."
    low, high = g.ci95
    doubt = "" if low > 0 else "; this may be no gain at all" if high > 0 else "; the extended model is worse"
    return (
        f"Held-out {g.metric} {figure(g.before)} -> {figure(g.after)} m: {_change(g.relative)} (95 %: {_change(low)} to {_change(high)}), "
        f"{g.runs_better} runs better{doubt}."
    )


def headline(d: Diagnosis) -> str:
    """The verdict in one or two sentences."""
    if d.verdict == "found":
        return f"Found: {', '.join(_named(c) for c in d.causes)}. {gain_words(d.gain)}"
    if d.verdict == "unknown" and d.unknown:
        return (
            f"The model lacks something that is not in the library: {what_it_is(d.unknown)}. "
            f"The log Bayes factor is {0.5 * d.unknown['score']:.0f}. No effect of the library explains as much."
        )
    if d.warnings:
        return "No cause is identified. The warnings below say why. The detection limits say what these runs could have shown."
    return (
        "Nothing found: neither an effect of the library nor an unexplained dependence is detected. "
        "The detection limits say what these runs could have shown."
    )


def _named(c: Cause) -> str:
    """A cause with its first two sizes."""
    sizes = [estimate(c.effect, k, e) for k, e in c.parameters.items()]
    return c.effect + (f" ({'; '.join(sizes[:2])}{'; ...' if len(sizes) > 2 else ''})" if sizes else "")


def next_command(d: Diagnosis) -> str:
    """The command that compares the plain model with the extended one."""
    inside = [c.effect for c in d.causes if c.effect not in _NO_MODEL]
    model = "+".join(["physics", *inside])
    return f"shipbench run --model physics --model {shlex.quote(model)} --dataset {shlex.quote(d.spec or d.dataset)}" if inside else ""


def detectable(c: Candidate) -> str:
    """Detection limit per amplitude, the unit once where it is the same; "-" where no possible size would."""
    known = [(name, v, _unit(c, name)) for name, v in c.detectable.items() if v is not None and math.isfinite(v)]
    parts = []
    for i, (name, v, unit) in enumerate(known):
        follows = i + 1 < len(known) and known[i + 1][2] == unit
        parts.append(f"{name} {figure(display_unit(unit)[1] * v) if follows else quantity(v, unit)}")
    return ", ".join(parts) or "-"


def _unit(c: Candidate, name: str) -> str:
    """Components of a vector are in the unit of its size."""
    if name in c.units:
        return c.units[name]
    return next((u for u in c.units.values() if u != "rad"), "1")


def strength(c: Cause) -> str:
    """Evidence in words, with log Bayes factor and p; the words are those of Kass and Raftery (1995), Bayes factors, section 3.2."""
    if not math.isfinite(c.score):
        return "an error of the record itself"
    factor = 0.5 * c.score
    word = "very strong" if factor > 5.0 else "strong" if factor > 3.0 else "positive" if factor > 1.0 else "weak"
    return f"{word} evidence, log Bayes factor {factor:.0f}, p {c.p_value:.2g}"


def cause_lines(c: Cause, width: int = WIDTH) -> list[str]:
    """A cause with sizes, evidence and confusions."""
    part = _effect(c.effect)
    lines = paragraph(f"{c.rank}. {c.effect}" + (f": {part.summary}" if part else ""), width, "  ", " " * 5)
    lines += paragraph(f"({strength(c)})", width, " " * 5)
    for name, e in c.parameters.items():
        lines += paragraph(estimate(c.effect, name, e), width, " " * 7, " " * 9)
    texts = [c.evidence.rstrip(".") + "."] if c.evidence else []
    if c.confused_with:
        texts.append(f"These data cannot separate it from {', '.join(c.confused_with)}.")
        texts += [f"To separate them: {c.separating_manoeuvre}"] if c.separating_manoeuvre else []
    for text in texts:
        lines += paragraph(text, width, " " * 7)
    return lines


def _candidate_lines(d: Diagnosis, width: int) -> list[str]:
    shown = d.candidates[:_SHOWN]
    if not shown:
        return []
    wide = max(len(c.effect) for c in shown)
    lines = [f"Candidates (best {len(shown)} of {len(d.candidates)}):", f"  {'effect':<{wide}s}     score  result"]
    for c in shown:
        score = f"{c.score:8.1f}" if math.isfinite(c.score) else "       -"
        lines += paragraph(f"{c.effect:<{wide}s}  {score}  {c.rejected_because}", width, "  ", " " * (wide + 14))
    return [*lines, ""]


def _detectable_lines(d: Diagnosis, width: int) -> list[str]:
    """Everything where nothing was found; else the best candidates that were not named."""
    kept = (
        sorted(d.candidates, key=lambda c: c.effect) if d.verdict == "none" else [c for c in d.candidates[:_SHOWN] if c.rejected_because != "named"]
    )
    kept = [c for c in kept if c.detectable]
    if not kept:
        return []
    wide = max(len(c.effect) for c in kept)
    lines = paragraph(DETECTION_LIMIT + ":", width)
    for c in kept:
        lines += paragraph(f"{c.effect:<{wide}s}  {detectable(c)}", width, "  ", " " * (wide + 4))
    return [*lines, ""]


def _wrong_lines(d: Diagnosis, width: int) -> list[str]:
    """What the plain model gets wrong in each channel, and what is taken as noise."""
    lines = ["What the plain physics model gets wrong:"] if d.what_is_wrong else []
    for w in d.what_is_wrong:
        none = "its missing force shows no dependence on motion, actuators or time alone"
        when = w.when if w.depends_on else f"{w.when}; {none}".removeprefix("; ")
        lines += paragraph(f"{w.channel}, {100 * w.share_of_error:.0f} % of the error: {when}", width, "  ", "      ")
    lines += [""] if lines else []
    if noise := d.unexplained_after.get("taken_as_noise"):
        lines.append("Treated as noise:")
        for channel, words in noise.items():
            lines += paragraph(f"{channel}: {words}", width, "  ", "      ")
        lines.append("")
    return lines


def summary_lines(d: Diagnosis, width: int = WIDTH, full: bool = True) -> list[str]:
    """A diagnosis as plain lines of at most `width` columns.

    Args:
        full: with what the plain model gets wrong, the candidates and the detection limits; else the verdict, its causes and the next command.
    """
    lines = [*paragraph(f"Diagnosis of {d.dataset} ({d.seconds:.0f} s)", width), "", *paragraph(headline(d), width), ""]
    for warning in d.warnings:
        lines += paragraph(f"WARNING: {warning}", width, "", " " * 9)
    if d.warnings:
        lines.append("")
    if d.causes:
        lines.append("Causes:")
        for c in d.causes:
            lines += cause_lines(c, width)
        lines.append("")
    if full:
        lines += _wrong_lines(d, width) + _candidate_lines(d, width) + _detectable_lines(d, width)
    if command := next_command(d):
        lines += [*paragraph(f"Extended model: {d.extended_model}", width), *command_lines(command, width)]
    if not full:
        lines += ["", "All tables (errors by channel, candidates, detection limits): --full"]
    return lines
