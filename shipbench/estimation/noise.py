"""Autocorrelated sensor noise.

A compass or a receiver that filters has errors that last for seconds: samples taken as independent would count for too
much. A ship in waves also moves at their frequency: samples taken as independent would count for too little in her slow
motion.

Noise of a channel: white noise, and a second part of `share` times its variance. The second part has one of three
forms. It decays like exp(-|t - s| / time). Or it oscillates with a `period`, as the output of a damped oscillator
without energy at frequency zero (T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, Wiley, 2011,
8.2.6: linear wave response). Or it is smooth, as in a filtered record: Matern's correlation of order 5/2 (C. E.
Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press, 2006, eq. 4.17).

Both sides of the linear model are multiplied by the inverse of its Cholesky factor. The residual noise is white, also
in a segment that ends early, as the factor is triangular.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

CHANNEL_UNITS = {
    "position": ("m", 1.0),
    "heading": ("deg", 57.29578),
    "surge": ("m/s", 1.0),
    "sway": ("m/s", 1.0),
    "yaw rate": ("deg/s", 57.29578),
}
RESIDUALS = ("x", "y", "heading", "surge", "sway", "yaw rate")


@dataclass(frozen=True)
class Colour:
    """Noise model of the six channels.

    share (6,): variance of the correlated part over that of the white part. time, period (6,): in samples; no period is
    infinity. smooth (6,): whether the record was filtered. factor (6, K + 1, K + 1): whitening matrix. logdet (6, K +
    2): log determinant of the covariance of the first k samples.
    """

    share: np.ndarray
    time: np.ndarray
    period: np.ndarray
    smooth: np.ndarray
    factor: np.ndarray
    logdet: np.ndarray

    @classmethod
    def white(cls, samples: int) -> Colour:
        """White noise: independent samples, in segments of `samples`."""
        nothing, never = np.zeros(6), np.full(6, np.inf)
        return cls(
            nothing, np.ones(6), never, nothing > 0.0, np.tile(np.eye(samples), (6, 1, 1)), np.zeros((6, samples + 1))
        )

    def with_channel(
        self, channel: int, share: float, time: float, period: float = np.inf, smooth: bool = False
    ) -> Colour:
        """Return it with another noise in one channel."""
        samples = self.factor.shape[1]
        lag = np.abs(np.subtract.outer(np.arange(samples), np.arange(samples)))
        root = np.linalg.cholesky(np.eye(samples) + share * _correlation(lag, time, period, smooth))
        new = replace(self, **{f.name: getattr(self, f.name).copy() for f in fields(self)})
        new.share[channel], new.time[channel], new.period[channel], new.smooth[channel] = share, time, period, smooth
        new.factor[channel] = np.linalg.inv(root)
        new.logdet[channel, 1:] = 2.0 * np.cumsum(np.log(np.diag(root)))
        return new

    def whitened(self, values: np.ndarray) -> np.ndarray:
        """Values (B, K + 1, 6, ...) multiplied by the whitening matrix; themselves where the noise is white."""
        if not self.share.any():
            return values
        out = values.copy()
        self.whiten(np.moveaxis(out, 2, 0), range(6))
        return out

    def whiten(self, values: np.ndarray, channels: Sequence[int]) -> None:
        """Whiten some channels in place; values (channels, B, K + 1, ...) have the channel first."""
        for at, channel in enumerate(channels):
            if self.share[channel] > 0.0:
                values[at] = _along_samples(self.factor[channel], values[at])

    def weighted(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Values (B, K + 1, 6, C) multiplied by the whitening matrix, by weights (B, K + 1, 6), and by the transposed
        whitening matrix: by the inverse of the noise's covariance."""
        out = values * weights[..., None]
        for channel in np.flatnonzero(self.share > 0.0):
            factor, weight = self.factor[channel], weights[:, :, channel, None]
            if np.all(weight == weight[:, :1]):
                np.matmul(factor.T @ factor, values[:, :, channel], out=out[:, :, channel])
                out[:, :, channel] *= weight
            else:
                np.matmul(factor.T, (factor @ values[:, :, channel]) * weight, out=out[:, :, channel])
        return out

    def differs(self, other: Colour) -> list[int]:
        """Channels with another noise model."""
        ours, theirs = (np.stack([c.share, c.time, c.period, c.smooth]) for c in (self, other))
        return [int(c) for c in np.flatnonzero(np.any(ours != theirs, axis=0))]

    def log_determinant(self, lengths: np.ndarray) -> np.ndarray:
        """Log determinant (B,) of the covariance of all channels, for segments of `lengths` samples."""
        return np.asarray(self.logdet[:, lengths].sum(axis=0))


def _along_samples(matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Products (B, K + 1, ...) of a matrix (K + 1, K + 1) and values of every segment."""
    return values @ matrix.T if values.ndim == 2 else matrix @ values


def _correlation(lag: np.ndarray, time: float, period: float, smooth: bool) -> np.ndarray:
    """Correlation of the correlated part of the noise, at lags in samples."""
    decay = np.exp(-lag / time)
    if smooth:
        return (1.0 + lag / time + (lag / time) ** 2 / 3.0) * decay
    if np.isinf(period):
        return decay
    omega = 2.0 * np.pi / period
    return decay * (np.cos(omega * lag) - np.sin(omega * lag) / (omega * time))
