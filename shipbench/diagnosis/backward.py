"""Causes taken out of a model again: what a later one has made needless, what is not sure, or too small to matter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .fit import fit
from .plain import REFIT_ITERATIONS
from .settle import Fit


def without(before: Fit, index: int) -> Fit:
    """`before` without one of its terms, refitted."""
    terms = tuple(t for i, t in enumerate(before.model.terms) if i != index)
    values = tuple(v for i, v in enumerate(before.point.values) if i != index)
    log_tau2 = {i - (i > index): v for i, v in before.log_tau2.items() if i != index}
    model, point = replace(before.model, terms=terms), replace(before.point, terms=terms, values=values)
    return fit(before.plant, before.scales, model, point, before.hyper, log_tau2, iterations=REFIT_ITERATIONS, guess=before.motion)


def needed_only(found: Fit, threshold: float, besides: Callable[[Fit, int], float], spare_last: bool = True) -> Fit:
    """Drop terms that are no longer worth the threshold and what is asked of them `besides`, judged on the linearisation, then by a refit."""
    index = 0
    while index < len(found.model.terms) - spare_last:
        least = threshold + besides(found, index)
        if found.worth(index) < least:
            less = without(found, index)
            if 2.0 * (found.evidence - less.evidence) < least:
                found = less
                continue
        index += 1
    return found


def wanted_only(found: Fit, wanted: Callable[[Fit, int], bool]) -> tuple[Fit, tuple[str, ...]]:
    """Without the terms that are not `wanted`, the last first, and their effects."""
    dropped: tuple[str, ...] = ()
    while others := [i for i in range(len(found.model.terms)) if not wanted(found, i)]:
        dropped += (found.model.terms[others[-1]].label,)
        found = without(found, others[-1])
    return found, dropped
