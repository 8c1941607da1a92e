"""Backward elimination of causes: those that a later one makes needless, uncertain ones, and those too small to
matter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from ...estimation.baseline import REFIT_ITERATIONS
from ...estimation.gauss_newton import fit
from ...estimation.laplace import Fit
from .requirements import EVIDENCE, Requirement, Standard, first_unmet


def without(before: Fit, index: int) -> Fit:
    """Fit `before` without one of its terms, refitted."""
    terms = tuple(t for i, t in enumerate(before.model.terms) if i != index)
    values = tuple(v for i, v in enumerate(before.point.values) if i != index)
    log_tau2 = {i - (i > index): v for i, v in before.log_tau2.items() if i != index}
    model, point = replace(before.model, terms=terms), replace(before.point, terms=terms, values=values)
    return fit(
        before.plant,
        before.scales,
        model,
        point,
        before.hyper,
        log_tau2,
        iterations=REFIT_ITERATIONS,
        guess=before.motion,
    )


def needed_only(found: Fit, standard: Standard, spare_last: bool = True) -> Fit:
    """Drop terms that no longer reach their required evidence, judged on the linearisation, then by a refit."""
    index = 0
    while index < len(found.model.terms) - spare_last:
        if not EVIDENCE.check(found, index, standard).met:
            less = without(found, index)
            if 2.0 * (found.evidence - less.evidence) < EVIDENCE.asked(found, index, standard):
                found = less
                continue
        index += 1
    return found


def wanted_only(found: Fit, requirements: Iterable[Requirement], standard: Standard) -> tuple[Fit, dict[str, str]]:
    """Fit without the terms that do not meet all requirements, the last first; and their effects, with the unmet
    requirements."""
    dropped: dict[str, str] = {}
    while standard.careful:
        verdicts = [(i, first_unmet(requirements, found, i, standard)) for i in range(len(found.model.terms))]
        unmet = [(i, v) for i, v in verdicts if not v.met]
        if not unmet:
            break
        index, verdict = unmet[-1]
        dropped[found.model.terms[index].label] = verdict.reason
        found = without(found, index)
    return found, dropped
