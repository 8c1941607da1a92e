"""Lines of summary.txt and of the terminal."""

from __future__ import annotations

import math

from ...diagnosis.result import Cause, Diagnosis, Gain
from ...render.terminal import command_lines, paragraph
from .text import (
    DETECTION_LIMIT,
    WIDTH,
    _effect,
    calibration_words,
    cause_texts,
    detectable,
    estimate,
    headline,
    next_command,
    own_gain,
)

_SHOWN = 10


def cause_lines(c: Cause, width: int = WIDTH, alone: Gain | None = None) -> list[str]:
    """Lines on a cause: sizes, force, evidence and the causes it is confounded with; alone: its own gain."""
    part = _effect(c.effect)
    lines = paragraph(f"{c.rank}. {c.effect}" + (f": {part.summary}" if part else ""), width, "  ", " " * 5)
    for name, e in c.parameters.items():
        lines += paragraph(estimate(c.effect, name, e), width, " " * 7, " " * 9)
    for text in cause_texts(c, alone):
        lines += paragraph(text, width, " " * 5)
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
    """Lines of detection limits: all where nothing was identified; else those of the best other candidates."""
    kept = (
        sorted(d.candidates, key=lambda c: c.effect)
        if d.verdict == "none"
        else [c for c in d.candidates[:_SHOWN] if c.rejected_because != "named"]
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
    """Lines on the error of the baseline model in each channel, and on the noise model."""
    lines = [f"What {'your simulation' if d.simulation else 'the calibrated ship'} gets wrong:"]
    lines = lines if d.what_is_wrong else []
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
    """Diagnosis as plain lines of at most `width` columns.

    Args:
        full: with the errors of the baseline model, the candidates and the detection limits; else the verdict, its
            causes and the next command.
    """
    lines = [*paragraph(f"Diagnosis of {d.dataset} ({d.seconds:.0f} s)", width), "", *paragraph(headline(d), width), ""]
    if calibration := calibration_words(d):
        lines += [*paragraph(calibration, width), ""]
    for warning in d.warnings:
        lines += paragraph(f"WARNING: {warning}", width, "", " " * 9)
    if d.warnings:
        lines.append("")
    if d.causes:
        lines.append("Causes:")
        for c in d.causes:
            lines += cause_lines(c, width, own_gain(c, d))
        lines.append("")
    if full:
        lines += _wrong_lines(d, width) + _candidate_lines(d, width) + _detectable_lines(d, width)
    if command := next_command(d):
        known = " (fitted to these runs)" if d.simulation else ""
        lines += [*paragraph(f"Model to compare: {d.extended_model}{known}", width), *command_lines(command, width)]
    if not full:
        lines += ["", "All tables (errors by channel, candidates, detection limits): --full"]
    return lines
