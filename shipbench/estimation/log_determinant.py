"""Dependence of the latent force's log determinant on the parameters.

The evidence of parameters is the posterior with the latent force integrated out. Besides the squares it holds the log
determinant of the force's precision: a ship with more damping responds less to the force. Squares alone bias the fit
towards less damping and a small force, by several standard errors where noise is small and runs are long.

Sources: Laplace's approximation with states eliminated, Thygesen & Kristensen, arXiv:2503.21358 (2025); the equivalent
term of the Onsager-Machlup functional, which minimum energy estimates lack, Dutra, arXiv:1704.01847 (2017).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .columns import ASIDE, Bend, Columns
from .gram import Hyper
from .linearisation import Linearisation
from .rollout import Active

_MOVE = 1e-4
"""Share of the sensitivities by which the motion is moved for the derivatives of the sensors."""


@np.errstate(over="ignore", invalid="ignore")
def slopes(lin: Linearisation, columns: Columns, inverse: np.ndarray, hyper: Hyper) -> np.ndarray:
    """Derivatives (B, G) of the log determinants of the segments by base, own terms and candidates, at fixed
    trajectories.

    With Phi the sensitivities to w, R the noise and A = Phi' R^-1 Phi + P: d log det A = 2 tr(A^-1 Phi' R^-1 d Phi).
    `inverse` (B, Z, Z) is that of [eta, w], which holds A^-1 once eta is known. Phi is a chain of single steps, so that
    the derivative by the Jacobian of each comes from an adjoint one. A trial that diverges has none.
    """
    phi = columns.latent if np.isfinite(np.vdot(columns.latent, columns.latent)) else _finite(columns.latent.copy())
    B, _, Z = phi.shape
    phi = phi.reshape(B, -1, 6, Z)
    from_eta = inverse[:, :6]
    of_force = inverse - np.swapaxes(from_eta, 1, 2) @ np.linalg.solve(from_eta[:, :, :6], from_eta)
    weight = (_by_noise(lin, hyper, phi).reshape(B, -1, Z) @ of_force).reshape(phi.shape)
    by_rate = _by_rate(lin, phi, weight)
    turned = len(ASIDE) * np.take_along_axis(by_rate, lin.turn[..., None, None], axis=-1)[..., 0] / lin.away[..., None]
    found = [
        _of_sensors(lin, bend, phi, weight) if bend.rates is None else np.einsum("kbi,ckbi->bc", turned, bend.rates)
        for bend in columns.bends
    ]
    return _finite(2.0 * np.concatenate(found, axis=1))


def coefficients_at(lin: Linearisation, columns: Columns) -> np.ndarray:
    """Coefficients (B, G) of base, own terms and candidates at the point of a linearisation."""
    point, run = lin.point, lin.plant.seg.run
    own = [v[run] if t.per_run else np.tile(v, (len(run), 1)) for t, v in zip(point.terms, point.values, strict=True)]
    candidates = np.zeros((len(run), sum(c.shape[-1] for c in columns.candidates)))
    return np.concatenate([np.tile(point.base, (len(run), 1)), *own, candidates], axis=1)


def _finite(values: np.ndarray) -> np.ndarray:
    return np.nan_to_num(values, copy=False, nan=0.0, posinf=0.0, neginf=0.0)


def _by_noise(lin: Linearisation, hyper: Hyper, phi: np.ndarray) -> np.ndarray:
    """Product R^-1 Phi, (B, K + 1, 6, Z)."""
    colour, precision = lin.scales.colour, np.exp(-hyper.log_noise) / lin.scales.noise**2
    return colour.weighted(phi, lin.plant.seg.mask[..., None] * (lin.plant.seg.seen * precision))


def _by_rate(lin: Linearisation, phi: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Half the derivatives (K, B, 3, 6) of the log determinant by the Jacobian of the acceleration, at every step."""
    half, step = 0.5 * (np.eye(6) + lin.jacobian), 0.5 * lin.plant.seg.dt
    middle = 0.5 * (lin.plant.hat[:-1] + lin.plant.hat[1:])
    K, B = half.shape[:2]
    found, late = np.empty((K, B, 3, 6)), weight[:, K]
    for k in reversed(range(K)):
        by_jacobian = late @ np.swapaxes(phi[:, k], 1, 2)
        by_jacobian[..., 3:] += step * lin.scales.w * (late[..., 6:].reshape(B, 6, 3, -1) @ middle[k])
        found[k] = np.swapaxes(lin.reach[k], 1, 2) @ by_jacobian @ np.swapaxes(half[k], 1, 2)
        late = weight[:, k] + np.swapaxes(lin.jacobian[k], 1, 2) @ late
    return found


def _of_sensors(lin: Linearisation, bend: Bend, phi: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Half the derivatives (B, size) of the log determinant by the sensors' effect on the sensitivities."""
    moves = _MOVE * np.moveaxis(phi, -1, 0)

    def seen(active: Sequence[Active]) -> np.ndarray:
        return lin.plant.measured(lin.motion + moves, active) - lin.plant.measured(lin.motion, active)

    found, changed = (
        np.zeros((len(phi), len(bend.sensors))),
        [(i, active) for i, active in enumerate(bend.sensors) if active is not None],
    )
    now = seen(lin.now) if changed else np.zeros(0)
    for i, active in changed:
        found[:, i] = np.sum(weight * np.moveaxis(seen(active) - now, 0, -1), axis=(1, 2, 3)) / (_MOVE * bend.unit)
    return found
