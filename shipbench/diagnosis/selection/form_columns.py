"""Columns of forces and of sensor errors that follow a form (`features`), and a fit with more of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...estimation.columns import Bend, Columns
from ...estimation.gram import Gram, beside_products, ornstein_uhlenbeck
from ...estimation.laplace import Fit
from ...estimation.linearisation import Linearisation
from ...estimation.log_determinant import coefficients_at, slopes
from ...estimation.whitening import whitened
from ..thresholds import THRESHOLDS
from .features import Feature

AXES = ("surge", "sway", "yaw")


@dataclass(frozen=True)
class Tried:
    """Form on one axis, with its columns; ways: number of forms of which it was chosen."""

    axis: str
    variable: str
    form: str
    ways: int
    columns: np.ndarray
    bend: Bend

    @property
    def size(self) -> int:
        return int(self.columns.shape[-1])

    @property
    def cost(self) -> float:
        """Log evidence lost by the choice of the form."""
        return float(np.log(self.ways))


@dataclass(frozen=True)
class Wider:
    """Fit, its linearisation, and its columns, to which more are added."""

    fit: Fit
    lin: Linearisation
    columns: Columns

    @classmethod
    def of(cls, fit: Fit) -> Wider:
        lin = Linearisation(fit.plant, fit.scales, fit.point, fit.motion)
        return cls(fit, lin, lin.columns())

    def columns_with(self, tried: Sequence[Tried]) -> Columns:
        """Columns with those of `tried` last."""
        return replace(
            self.columns,
            candidates=(*self.columns.candidates, *(t.columns for t in tried)),
            bends=(*self.columns.bends, *(t.bend for t in tried)),
        )

    def gram(self, tried: Sequence[Tried]) -> Gram:
        """Gram of the fit with more columns, under its noise (products of single channels would take six times the
        memory)."""
        fit, seg, columns = self.fit, self.fit.plant.seg, self.columns_with(tried)
        Z = whitened(fit.plant, fit.scales, fit.point, columns)
        G, part = np.zeros((2, Z.shape[1], Z.shape[3], Z.shape[3]))
        for z, log_noise in zip(Z, fit.hyper.log_noise, strict=True):
            z *= np.exp(-0.5 * log_noise)
            G += np.matmul(np.swapaxes(z, 1, 2), z, out=part)
        nothing = np.zeros((len(G), G.shape[-1] - 6 - 3 * fit.plant.knots))
        correlation = ornstein_uhlenbeck(fit.plant.knots, fit.plant.knot_time, fit.hyper.tau)
        gram = Gram(G, fit.plant.knots, *correlation, nothing[:, -1], nothing, seg.run, seg.runs)
        inverse = gram.only(np.arange(0)).reduce(fit.hyper.log_force).inverse
        return replace(
            gram,
            slope=beside_products(slopes(self.lin, columns, inverse, fit.hyper), coefficients_at(self.lin, columns)),
        )


def pushed(lin: Linearisation, axis: int, of: Mapping[str, Sequence[Feature]]) -> list[Tried]:
    """Columns of forces on one axis."""
    forms = [(v, f) for v, group in of.items() for f in group]
    if not forms:
        return []
    sd = THRESHOLDS.value("force_prior")
    on, aside = (sd * np.concatenate(x) for x in ([f.on for _, f in forms], [f.aside for _, f in forms]))
    columns, bend = lin.pushed(axis, on, aside)
    found, at = [], 0
    for v, f in forms:
        part = np.s_[at : at + f.size]
        found.append(
            Tried(
                AXES[axis],
                v,
                f.form,
                f.ways,
                columns[..., part],
                Bend(None if bend.rates is None else bend.rates[part]),
            )
        )
        at += f.size
    return found


def added(lin: Linearisation, name: str, channel: int, of: Mapping[str, Sequence[Feature]]) -> list[Tried]:
    """Columns of errors in one channel of the record."""
    found, sd = [], THRESHOLDS.value("error_prior") * lin.scales.noise[channel]
    for v, group in of.items():
        for f in group:
            error = np.zeros((*lin.motion.shape, f.size))
            error[..., channel, :] = sd * np.moveaxis(f.on, 0, -1).swapaxes(0, 1)
            found.append(
                Tried(name, v, f.form, f.ways, error.reshape(len(error), -1, f.size), Bend(None, (None,) * f.size))
            )
    return found
