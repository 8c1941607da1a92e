"""A stranger's model that keeps every rule, and one for each way to break one; the test copies this file to where the
user's would be."""

import json
import pickle
from dataclasses import dataclass
from pathlib import Path

import numpy as np


class Good:
    """Speeds decay towards what the revolutions ask for; drawn a little at random, by its seed."""

    def __init__(self, lag: float = 30.0):
        self.lag = lag

    def fit(self, train, valid=None, *, seed=0):
        self.dt = train.dt
        S = np.concatenate([r.states for r in train.runs])
        self.ratio = float(S[:, 3].mean() / S[:, 6].mean() + 1e-5 * self._draw(seed))
        return self

    def _draw(self, seed):
        return np.random.default_rng(seed).standard_normal()

    def predict(self, s0, U, history=None):
        single = np.ndim(s0) == 1
        if single:
            s0, U = s0[None], U[None]
        S = self._roll(np.asarray(s0), np.asarray(U))
        return S[0] if single else S

    def _roll(self, s0, U):
        S = np.repeat(s0[:, None], U.shape[1], axis=1).astype(float)
        now = s0.astype(float)
        for k in range(U.shape[1]):
            x, y, psi, u = now[:, 0], now[:, 1], now[:, 2], now[:, 3]
            u = u + self.dt * (self.ratio * self._orders(U, k) - u) / self.lag
            S[:, k, 0], S[:, k, 1] = x + self.dt * u * np.cos(psi), y + self.dt * u * np.sin(psi)
            S[:, k, 2], S[:, k, 3] = psi + self.dt * now[:, 5], u
            now = S[:, k]
        return S

    def _orders(self, U, k):
        return U[:, k, 0]

    def save(self, path):
        Path(path).mkdir(parents=True)
        Path(path, "mine.json").write_text(json.dumps({"lag": self.lag, "dt": self.dt, "ratio": self.ratio}))

    @classmethod
    def load(cls, path):
        kept = json.loads(Path(path, "mine.json").read_text())
        model = cls(lag=kept["lag"])
        model.dt, model.ratio = kept["dt"], kept["ratio"]
        return model


class FitRaises(Good):
    def fit(self, train, valid=None, *, seed=0):
        raise RuntimeError("no convergence")


class TakesAnything(Good):
    def __init__(self, lag=30.0, **rest):
        super().__init__(lag)


class IgnoresItsParameter(Good):
    def __init__(self, lag=30.0):
        self.lag = 30.0


@dataclass
class ForgetsItsParameterInFit(Good):
    lag: float = 30.0

    def fit(self, train, valid=None, *, seed=0):
        self.lag = 12.0
        return super().fit(train, valid, seed=seed)


class ReturnsNothing(Good):
    def fit(self, train, valid=None, *, seed=0):
        super().fit(train, valid, seed=seed)


class NeedsValid(Good):
    def fit(self, train, valid=None, *, seed=0):
        len(valid.runs)
        return super().fit(train, valid, seed=seed)


class CentresTheData(Good):
    def fit(self, train, valid=None, *, seed=0):
        super().fit(train, valid, seed=seed)
        train.runs[0].states[:, 3] -= 1.0
        return self


class NeedsHistory(Good):
    def predict(self, s0, U, history=None):
        history[0].mean()
        return super().predict(s0, U)


class KnowsNoHistory(Good):
    def predict(self, s0, U, history=None):
        if history is not None:
            raise TypeError("I take no history")
        return super().predict(s0, U)


class GivesS0Too(Good):
    def _roll(self, s0, U):
        return np.concatenate([s0[:, None], super()._roll(s0, U)], axis=1)


class GivesNaN(Good):
    def _roll(self, s0, U):
        return super()._roll(s0, U) * np.nan


class OnlyTheTrainedHorizon(Good):
    def _roll(self, s0, U):
        if U.shape[1] != 30:
            raise ValueError("K must be 30")
        return super()._roll(s0, U)


class GivesLists(Good):
    def predict(self, s0, U, history=None):
        return super().predict(s0, U).tolist()


class RefusesFloat32(Good):
    def predict(self, s0, U, history=None):
        if s0.dtype != np.float64:
            raise TypeError("float64 only")
        return super().predict(s0, U)


class OneStepLate(Good):
    def _roll(self, s0, U):
        return np.concatenate([s0[:, None], super()._roll(s0, U)[:, :-1]], axis=1)


class Counts(Good):
    asked = 0

    def _roll(self, s0, U):
        self.asked += 1
        return super()._roll(s0, U) + 1e-6 * self.asked


class DrawsWhenAsked(Good):
    def _roll(self, s0, U):
        return super()._roll(s0, U) + 0.01 * np.random.default_rng().standard_normal()


class WritesIntoS0(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        s0[:, :2] = 0.0
        return S


class WritesIntoHistory(Good):
    def predict(self, s0, U, history=None):
        if history is not None:
            history[1][..., 0] = 0.0
        return super().predict(s0, U)


class NeedsABatch(Good):
    def predict(self, s0, U, history=None):
        if s0.ndim != 2:
            raise ValueError("give a batch")
        return super().predict(s0, U)


class MixesTheBatch(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        S[..., 3] += 0.01 * (S[..., 3].mean(axis=0) - S[..., 3])
        return S


class KnowsItsPlaceInTheBatch(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        S[..., 3] += 0.01 * np.arange(len(s0))[:, None]
        return S


class SeesTheNextOrder(Good):
    def _orders(self, U, k):
        return U[:, min(k + 1, U.shape[1] - 1), 0]


class ScalesByTheWholeHorizon(Good):
    def _orders(self, U, k):
        return U[:, :, 0].mean(axis=1)


class WrapsItsHeading(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        S[..., 2] = (S[..., 2] + np.pi) % (2 * np.pi) - np.pi
        return S


class KnowsItsHarbour(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        S[..., 3] += 1e-4 * s0[:, None, 0]
        return S


class PrefersNorth(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        S[..., 3] += 0.1 * np.cos(s0[:, None, 2])
        return S


class IgnoresItsSeed(Good):
    def _draw(self, seed):
        return np.random.default_rng().standard_normal() * 100


class DrawsFromTheGlobalGenerator(Good):
    def _draw(self, seed):
        return np.random.standard_normal() * 100  # noqa: NPY002 - the fault


class RaisesWhenItDiverges(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        if np.abs(S[..., 3]).max() > 1e3:
            raise FloatingPointError("the speed is too high")
        return S


class StopsAllWhenOneDiverges(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        return S * np.nan if np.abs(S[..., 3]).max() > 1e3 else S


class HidesNaN(Good):
    def _roll(self, s0, U):
        return super()._roll(np.nan_to_num(s0), U)


class SpreadsNaN(Good):
    def _roll(self, s0, U):
        S = super()._roll(s0, U)
        return S if np.isfinite(U).all() else S * np.nan


class TripsOverNaN(Good):
    def _roll(self, s0, U):
        if np.isnan(s0).any():
            return [][0]
        return super()._roll(s0, U)


class Pickles(Good):
    def save(self, path):
        Path(path).mkdir(parents=True)
        Path(path, "state.bin").write_bytes(pickle.dumps([self.lag, self.dt, self.ratio]))


class PicklesInsideNpz(Good):
    def save(self, path):
        Path(path).mkdir(parents=True)
        np.savez(Path(path, "state.npz"), state=np.array([{"lag": self.lag}], dtype=object))


class RoundsWhenSaved(Good):
    def save(self, path):
        self_ratio, self.ratio = self.ratio, round(self.ratio, 4)
        super().save(path)
        self.ratio = self_ratio


class CannotLoad(Good):
    load = None


class CannotSave(Good):
    save = None
