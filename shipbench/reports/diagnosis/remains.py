"""Sentences on the unexplained part of a diagnosis, and on its noise model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ...diagnosis.evaluation.dependence import AXES
from ...diagnosis.evaluation.residuals import FORCE_UNITS
from ...diagnosis.result import Diagnosis, what_it_is
from .text import figure, grade


def remaining_sentences(d: Diagnosis) -> list[str]:
    """Sentences from `Diagnosis.unexplained_after`; parts that it lacks are left out."""
    rest, lines = d.unexplained_after, []
    explained = {
        axis: f"{100 * min(max(v, 0.0), 1.0):.0f} %" for axis, v in _known(rest.get("force_variance_explained")).items()
    }
    if d.causes and explained:
        causes = "the cause explains" if len(d.causes) == 1 else "the causes explain"
        lines.append(
            f"Of the variance of the missing force, {causes} "
            f"{_listed([f'{v} in {axis}' for axis, v in explained.items()])}."
        )
    units = dict(zip(AXES, FORCE_UNITS, strict=True))
    sizes = [
        f"{figure(units[axis][1] * v)} {units[axis][0].replace('^2', '²')} in {axis}"
        for axis, v in _known(rest.get("force_sd")).items()
    ]
    if sizes:
        lines.append(
            f"The force that remains has a standard deviation of {_listed(sizes)}. It is given as an acceleration."
        )
    best = rest.get("best_dependence")
    if best and best["score"] > 0.0:
        evidence = f"{grade(best['score'])} (log Bayes factor {0.5 * best['score']:.0f})"
        lines.append(f"The strongest dependence in the rest is {what_it_is(best)}. It has {evidence}.")
    elif best:
        lines.append("The rest shows no dependence on motion, actuators or time.")
    lines += [
        f"{channel[0].upper()}{channel[1:]}: {words}. This is treated as noise."
        for channel, words in rest.get("taken_as_noise", {}).items()
    ]
    return lines


def _known(values: Mapping[str, float | None] | None) -> dict[str, float]:
    """Finite values by axis; the keys may hold a unit behind it."""
    found = {key.split()[0]: v for key, v in (values or {}).items() if v is not None and math.isfinite(v)}
    return {axis: found[axis] for axis in AXES if axis in found}


def _listed(parts: Sequence[str]) -> str:
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last
