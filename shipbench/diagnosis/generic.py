"""The second library: what an unexplained force depends on, where no named cause fits. It needs no simulation."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from .columns import ASIDE, AWAY
from .gram import Gram, Prior, solve
from .plant import Plant
from .screen import evidence
from .settle import Fit

AXES = ("surge", "sway", "yaw")
_PRIOR_SD = 0.5
"""Of a feature's coefficient, in units of the scales of the latent force (5 mm/s^2, 5 mm/s^2, 1e-4 rad/s^2 at 130 m)."""
_WORTH_MORE = 2.0


@dataclass(frozen=True)
class Dependence:
    """The latent force of one axis follows one variable. score: 2 log Bayes factor; share: of the variance of that axis's latent force that it
    takes; size: root mean square of what it takes, in units of the scales of the latent force."""

    variable: str
    axis: str
    score: float
    share: float
    size: float


def features(plant: Plant, aside: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Features (B, knots, F) of every variable at the knots of the latent force, of order one and without mean; with `aside` (M, 6) of M motions
    more, each moved by one row, (B + M B, knots, F)."""
    seg, froude = plant.seg, (plant.c.L / 130.0) ** 0.5
    at = np.clip(np.round(np.arange(plant.knots) * plant.knot_time / seg.dt).astype(int), 0, plant.steps)
    moves = np.zeros((1, 10)) if aside is None else np.pad(aside, ((1, 0), (0, 4)))
    states = np.concatenate([seg.states[:, at] + move for move in moves])
    psi, u, v, r, n, delta, F_b, F_s = np.moveaxis(states[..., 2:], -1, 0)
    t = np.tile(seg.start[:, None] + at[None, :] * seg.dt, (len(moves), 1))

    def unit(x: np.ndarray) -> np.ndarray:
        return x / max(float(np.sqrt(np.mean(x**2))), 1e-12)

    u1, v1, r1, n1, d1 = unit(u), unit(v), unit(r), unit(n), unit(delta)
    minute = 2.0 * np.pi * t / (60.0 * froude)
    order = np.broadcast_to(np.tile(seg.run / max(seg.runs - 1, 1), len(moves))[:, None], t.shape)
    found = {
        "heading": [f(k * psi) for k in (1, 2, 3) for f in (np.cos, np.sin)],
        "speed": [u1, u1 * np.abs(u1)],
        "sway velocity": [v1, v1 * np.abs(v1), np.abs(v1)],
        "yaw rate": [r1, r1 * np.abs(r1), np.abs(r1)],
        "rudder": [d1, np.abs(d1), d1 * np.abs(d1), d1**3],
        "revolutions": [n1, n1 * np.abs(n1)],
        "revolutions and yaw rate": [n1 * r1],
        "revolutions and sway velocity": [n1 * v1],
        "revolutions and rudder": [n1 * d1, n1 * np.abs(d1), n1 * np.abs(n1) * d1 * d1],
        "speed and rudder": [u1 * d1, u1 * u1 * np.abs(d1)],
        "time": [t / t.max(), (t / t.max()) ** 2, *(f(k * minute) for k in (0.5, 1.0, 2.0) for f in (np.cos, np.sin))],
        "run": [order, order**2],
    }
    if np.any(F_b) or np.any(F_s):
        F1, F2 = unit(F_b), unit(F_s)
        found["thrusters"] = [F1, F2, F1 * u1, F2 * u1]
    return {k: _centred(np.stack(np.broadcast_arrays(*v), axis=-1)) for k, v in found.items()}


def _centred(x: np.ndarray) -> np.ndarray:
    x = x - x.mean(axis=(0, 1))
    return x / np.maximum(np.sqrt(np.mean(x**2, axis=(0, 1))), 1e-9)


def dependences(fit: Fit, beside: Collection[str] = ()) -> list[Dependence]:
    """Every variable on every axis, best first; judged beside the model of `fit`, and beside forces that follow the variables `beside`."""
    base = np.concatenate([fit.prior.shared, fit.prior.random]).astype(int)
    prior = replace(fit.prior, shared=np.arange(len(fit.prior.shared)), random=np.arange(len(fit.prior.shared), len(base)))
    lean, B = fit.gram.only(base), len(fit.gram.run)
    aside = AWAY * np.diag(fit.scales.eta)[list(ASIDE)]
    columns: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for variable, moved in features(fit.plant, aside).items():
        phi, *others = moved.reshape(len(ASIDE) + 1, B, *moved.shape[1:])
        columns[variable] = phi, np.stack([other - phi for other in others]) / aside[range(len(ASIDE)), ASIDE][:, None, None, None]

    def following(gram: Gram, prior: Prior, variable: str, axis: int) -> tuple[Gram, Prior]:
        phi, bent = columns[variable]
        more = gram.G.shape[-1] - 1 - gram.latent + np.arange(phi.shape[-1])
        precision = np.append(prior.precision, np.full(phi.shape[-1], _PRIOR_SD**-2))
        slopes = np.einsum("bmi,ibmf->bf", fit.by_force[:, :, axis, list(ASIDE)], bent)
        return _with_features(gram, phi, axis, slopes), replace(prior, shared=np.append(prior.shared, more), precision=precision)

    usual = fit.hyper.log_force
    for variable in beside:
        for j in range(len(AXES)):
            lean, prior = following(lean, prior, variable, j)
    null = solve(lean.reduce(usual), prior).log_evidence
    if beside:
        null, usual, _ = evidence(lean, prior, usual)
    found = []
    for variable in (v for v in columns if v not in beside):
        for j, axis in enumerate(AXES):
            gram, more = following(lean, prior, variable, j)
            score, log_force = solve(gram.reduce(usual), more).log_evidence, usual
            if score - null > _WORTH_MORE:
                score, log_force, _ = evidence(gram, more, log_force)
            share = 1.0 - float(np.exp(log_force[j] - usual[j]))
            size = float(np.sqrt(max(share, 0.0) * np.exp(usual[j])))
            found.append(Dependence(variable, axis, 2.0 * (score - null), share, size))
    return sorted(found, key=lambda d: -d.score)


def _with_features(gram: Gram, phi: np.ndarray, axis: int, slopes: np.ndarray) -> Gram:
    """The Gram with the columns S_w phi before the residual, linear combinations of columns that it has, and how the log determinants depend on
    their coefficients."""
    at = slice(6 + axis * gram.knots, 6 + (axis + 1) * gram.knots)
    rows = np.swapaxes(phi, 1, 2) @ gram.G[:, at]  # (B, F, Z + G + 1)
    corner = rows[:, :, at] @ phi
    last = gram.G.shape[-1] - 1
    F = phi.shape[-1]
    G = np.zeros((len(phi), last + F + 1, last + F + 1))
    G[:, :last, :last] = gram.G[:, :last, :last]
    G[:, last : last + F, :last], G[:, :last, last : last + F] = rows[:, :, :last], np.swapaxes(rows[:, :, :last], 1, 2)
    G[:, last : last + F, last : last + F] = corner
    G[:, -1, :last], G[:, :last, -1] = gram.G[:, -1, :last], gram.G[:, :last, -1]
    G[:, -1, last : last + F] = G[:, last : last + F, -1] = rows[:, :, last]
    G[:, -1, -1] = gram.G[:, -1, -1]
    return replace(gram, G=G, slope=np.insert(gram.slope, [gram.slope.shape[1] - 1], -0.5 * slopes, axis=1))
