"""Baseline model fitted to all runs: the null hypothesis of every candidate cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .budget import is_spent
from .forward import FEW_PIECES, Plant
from .gauss_newton import Origin, fit, looking_at
from .gram import Hyper
from .laplace import Fit, Model, evidence_with
from .linearisation import Scales
from .noise import Colour
from .noise_selection import colour_of, swinging_force
from .outliers import strange_pieces
from .robust_prior import widened
from .term import Term
from .thresholds import THRESHOLDS

_GEAR_FACTORS = ((2.0, 4.0, 8.0), (0.5, 0.25, 0.125))
"""Factors of a default time constant or rate that are tried first, slower and faster."""
REFIT_ITERATIONS = 16
"""Most iterations of a fit that starts from another one."""


def null_fit(plant: Plant, scales: Scales, candidates: Sequence[Term] = ()) -> Fit:
    """Baseline model, fitted from the regressions.

    Where only commands are recorded, it has the actuator dynamics that fit the motion. Where sensor errors last longer
    than a sample, it has autocorrelated noise. Outlying segments are left out. Once the time budget is spent, the
    current fit of some segments is returned.
    """
    few = plant.thinned(FEW_PIECES)
    found, share = _begun(few, scales), len(few.seg.run) / len(plant.seg.run)
    if plant.seg.commanded:
        found, scales, _ = _beside_waves(
            found, scales, share, waves_alone=True
        )  # a force that follows them says nothing of a gear
        for i, name, field in ((0, "n", "T"), (1, "delta", "rate"), (1, "delta", "T")):
            if np.ptp(plant.seg.commands[..., i]) > 0.0:
                found = _with_gear(found, name, field)
    found, scales, colour = _beside_waves(found, scales, share)
    if is_spent():
        return looking_at(found, candidates)
    if few is not plant:
        found = _begun(plant.driven(found.plant.ordinary), scales)
    scales = found.scales.coloured(colour)
    found = _without_strange(
        fit(found.plant, scales, Model(), found.point, found.hyper, candidates=candidates, guess=found.motion)
    )
    return widened(found)


def beside_noise_of(named: Fit, null: Fit) -> Fit | None:
    """Baseline model `null` fitted again with the noise model that fits the causes of `named`.

    None where its own noise model fits about as well, or is white. The error of a late sensor or of a reversed sign
    lasts, as noise may: under autocorrelated noise its evidence is lower, or another cause takes its place.
    """
    if is_spent() or not null.scales.colour.share.any():
        return None
    colour = colour_of(named)
    gain = 2.0 * (evidence_with(named, colour) - evidence_with(named, named.scales.colour))
    if gain < THRESHOLDS.value("evidence_of_another_model"):
        return None
    return widened(
        fit(
            null.plant,
            null.scales.coloured(colour),
            Model(),
            null.point,
            null.hyper,
            candidates=null.candidates,
            guess=null.motion,
        )
    )


def first_evidence(plant: Plant, null: Fit) -> float:
    """Log evidence of `first_fit`."""
    return first_fit(plant, null).evidence


def first_fit(plant: Plant, null: Fit, like: Fit | None = None) -> Fit:
    """Baseline model of another reading, or of some segments, of the data of `null`.

    It starts from the regressions, with the same units; with the forces and the noise model of the fit `like`.
    """
    return from_regressions(
        plant, Scales(plant).alike(null.scales), iterations=REFIT_ITERATIONS, hyper=like.hyper if like else None
    )


def _begun(plant: Plant, scales: Scales) -> Fit:
    """First fit. Its nuisance parameters serve all others.

    On a ship far from the regressions the latent force that tracks her is large, and may stand in for the parameters.
    An external push may pull a fit so far that no segment is an outlier at its optimum. A fit that has not converged is
    repeated: from a latent force of typical size, then without the outliers of its start. The repeated fit is kept if
    it converges.
    """
    found, most = _without_strange(from_regressions(plant, scales)), THRESHOLDS.value("unconverged_excess")
    if found.excess > most and not is_spent():
        calm = _without_strange(from_regressions(plant, scales, weak=True))
        if calm.excess > most and len(pieces := strange_pieces(from_regressions(plant, scales, iterations=1))):
            calm = _without_strange(from_regressions(plant.without(pieces), scales))
        if calm.excess < most:
            found = calm
    return replace(found, scales=scales.with_background(found.hyper))


def _beside_waves(found: Fit, scales: Scales, share: float, waves_alone: bool = False) -> tuple[Fit, Scales, Colour]:
    """First fit, its units, and the noise model that fits it (`colour_of`).

    Where the ship moves with the waves, the fit is repeated with wave noise. A latent force that follows the waves is
    large, hides slow motion, and leaves residuals that oscillate too fast.
    """
    colour = colour_of(found, share, waves_alone)
    waves = swinging_force(found, colour)
    if np.isfinite(waves.period).any() and not is_spent():
        scales = scales.coloured(waves)
        found = _begun(found.plant, scales)
        colour = colour_of(found, share, waves_alone)
    return found, scales, colour


def from_regressions(
    plant: Plant, scales: Scales, iterations: int = 8, weak: bool = False, hyper: Hyper | None = None
) -> Fit:
    """Fit from the regressions with few iterations. Without fixed nuisance variances, lower variances would be rewarded
    without end."""
    origin = Origin.of(plant, scales)
    hyper = hyper or (
        replace(origin.hyper, log_force=np.minimum(origin.hyper.log_force, 0.0)) if weak else origin.hyper
    )
    return fit(plant, scales, Model(), origin.point, hyper, iterations=iterations, guess=origin.motion, far=True)


def _without_strange(found: Fit) -> Fit:
    """Fit again without the largest outliers, which mask the next ones."""
    for _ in range(3):
        pieces = strange_pieces(found)
        if not len(pieces) or is_spent():
            break
        plant, candidates = found.plant.without(pieces), found.candidates
        found = fit(
            plant, found.scales, found.model, found.point, found.hyper, candidates=candidates, guess=found.motion
        )
    return found


def _with_gear(found: Fit, name: str, field: str) -> Fit:
    """Fit with actuator dynamics whose time constant or rate is the default times the factor that fits the motion.

    Servos of models are quicker than Froude's law makes the default. A small remaining error of a time constant would
    be confounded with a delay.
    """
    first = found
    if is_spent():
        return found
    for factors in _GEAR_FACTORS:
        for factor in factors:
            tried = _behind(found, name, field, getattr(first.plant.ordinary[name], field) * factor)
            if is_spent() or 2.0 * (tried.evidence - found.evidence) < THRESHOLDS.value("evidence"):
                break
            found = tried
        if found is not first or is_spent():
            break
    for factor in (1.2, 1.0 / 1.2):  # finer, from there
        before = found
        for _ in range(3):
            tried = _behind(found, name, field, getattr(found.plant.ordinary[name], field) * factor)
            if is_spent() or tried.evidence <= found.evidence:
                break
            found = tried
        if found is not before or is_spent():
            break
    return found


def _behind(found: Fit, name: str, field: str, value: float) -> Fit:
    """Fit behind another gear, given up where its predicted evidence is below that of `found` by what predictions fall
    short: after the first step, and when they are near (docs/calibration.md#refits)."""
    early, near = (0.5 * THRESHOLDS.value(name) for name in ("led_astray", "unconverged_excess"))
    plant = found.plant.driven({name: replace(found.plant.ordinary[name], **{field: value})})
    return fit(
        plant, found.scales, found.model, found.point, found.hyper, iterations=REFIT_ITERATIONS, guess=found.motion,
        hope=found.evidence - early, rival=found.evidence - near,
    )  # fmt: skip
