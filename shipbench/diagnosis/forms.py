"""Forms of an unexplained force: what a force or moment may follow, by the variable that it then depends on. They are free of any named cause."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .model import Linearisation
from .plant import Plant

Features = tuple[np.ndarray, ...]
_PERIODS = 20.0 * 10.0 ** (np.arange(11) / 10.0)
"""Seconds (Froude-scaled, 130 m): over two minutes one of them is near enough to any from 20 to 200 s."""
_CENTRED = ("heading", "run")
"""Of these only differences count: a force that is always there is none that follows them."""


class State(NamedTuple):
    """What a force may follow, in units of the root mean square of the record: motion u, v, r over ground, actuators n, delta, F_b, F_s; psi [rad];
    t: time since the run began [s]; run: from 0 for the first to 1 for the last."""

    psi: np.ndarray
    u: np.ndarray
    v: np.ndarray
    r: np.ndarray
    n: np.ndarray
    delta: np.ndarray
    F_b: np.ndarray
    F_s: np.ndarray
    t: np.ndarray
    run: np.ndarray


Form = Callable[[State], Features]
"""One coefficient for each feature."""


class Feature(NamedTuple):
    """The features (F, K, B) of one form in the middle of every step, and beside the trajectory (`Linearisation.aside`); of order one."""

    form: str
    on: np.ndarray
    aside: np.ndarray

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.on)


def _harmonic(k: int) -> Form:
    return lambda s: (np.cos(k * s.psi), np.sin(k * s.psi))


def _period(seconds: float) -> Form:
    return lambda s: (np.cos(2.0 * np.pi * s.t / seconds), np.sin(2.0 * np.pi * s.t / seconds))


_FORMS: dict[str, dict[str, Form]] = {
    "heading": {f"cos({k} psi + phase)": _harmonic(k) for k in (1, 2, 3)},
    "speed": {"u": lambda s: (s.u,), "u|u|": lambda s: (s.u * abs(s.u),)},
    "sway velocity": {"v": lambda s: (s.v,), "v|v|": lambda s: (s.v * abs(s.v),), "|v|": lambda s: (abs(s.v),), "v^2": lambda s: (s.v**2,)},
    "yaw rate": {"r": lambda s: (s.r,), "r|r|": lambda s: (s.r * abs(s.r),), "|r|": lambda s: (abs(s.r),), "r^2": lambda s: (s.r**2,)},
    "rudder": {
        "delta": lambda s: (s.delta,), "delta|delta|": lambda s: (s.delta * abs(s.delta),), "|delta|": lambda s: (abs(s.delta),),
        "delta^2": lambda s: (s.delta**2,),
    },
    "revolutions": {"n": lambda s: (s.n,), "n|n|": lambda s: (s.n * abs(s.n),)},
    "revolutions and yaw rate": {
        "n r": lambda s: (s.n * s.r,), "n|n| r": lambda s: (s.n * abs(s.n) * s.r,), "n |r|": lambda s: (s.n * abs(s.r),),
        "n|n| |r|": lambda s: (s.n * abs(s.n * s.r),),
    },
    "revolutions and sway velocity": {
        "n v": lambda s: (s.n * s.v,), "n|n| v": lambda s: (s.n * abs(s.n) * s.v,), "n |v|": lambda s: (s.n * abs(s.v),),
        "n|n| |v|": lambda s: (s.n * abs(s.n * s.v),),
    },
    "revolutions and rudder": {
        "n delta": lambda s: (s.n * s.delta,), "n|n| delta": lambda s: (s.n * abs(s.n) * s.delta,), "n |delta|": lambda s: (s.n * abs(s.delta),),
        "n|n| |delta|": lambda s: (s.n * abs(s.n * s.delta),), "n|n| delta^2": lambda s: (s.n * abs(s.n) * s.delta**2,),
    },
    "speed and rudder": {
        "u delta": lambda s: (s.u * s.delta,), "u^2 delta": lambda s: (s.u**2 * s.delta,), "u^2 |delta|": lambda s: (s.u**2 * abs(s.delta),),
        "u^2 delta^2": lambda s: ((s.u * s.delta) ** 2,),
    },
    "run": {"number of the run": lambda s: (s.run,), "its square": lambda s: (s.run**2,)},
    "thrusters": {
        "F_b": lambda s: (s.F_b,), "F_s": lambda s: (s.F_s,), "F_b u": lambda s: (s.F_b * s.u,), "F_s u": lambda s: (s.F_s * s.u,),
    },
}  # fmt: skip


def _of_time(froude: float, ends: float) -> dict[str, Form]:
    grown: dict[str, Form] = {"t": lambda s: (s.t / ends,), "t^2": lambda s: ((s.t / ends) ** 2,)}
    return grown | {f"cos(2 pi t / {seconds:.3g} s + phase)": _period(float(seconds)) for seconds in _PERIODS * froude}


def features(lin: Linearisation) -> dict[str, list[Feature]]:
    """The features of all forms about a trajectory, by variable; of thrusters only where they are used. After `lin.columns`."""
    plant, seg, real = lin.plant, lin.plant.seg, lin.plant.seg.mask[:, 1:].T
    assert lin.aside is not None
    on, aside = (_state(plant, middle[0], lin.path) for middle in (lin.middle, lin.aside))
    ends = float(np.max(seg.start + seg.dt * (seg.mask.sum(axis=1) - 1)))
    found: dict[str, list[Feature]] = {}
    for variable, forms in (_FORMS | {"time": _of_time(plant.froude, ends)}).items():
        if variable == "thrusters" and not np.any(seg.states[..., 8:]):
            continue
        found[variable] = []
        for name, form in forms.items():
            x, y = np.stack(form(on)), np.stack(form(aside))
            centre = x[:, real].mean(axis=1) if variable in _CENTRED else np.zeros(len(x))
            unit = _rms(x[:, real] - centre[:, None])
            found[variable].append(Feature(name, *((z - centre[:, None, None]) / unit[:, None, None] for z in (x, y))))
    return found


def _state(plant: Plant, motion: np.ndarray, path: np.ndarray) -> State:
    seg, (act, t) = plant.seg, plant.midway(path)
    units = _rms(seg.states[seg.mask][:, 3:].T)[:, None, None]
    u, v, r = np.moveaxis(motion[..., 3:], -1, 0) / units[:3]
    n, delta, F_b, F_s = np.moveaxis(act, -1, 0) / units[3:]
    return State(motion[..., 2], u, v, r, n, delta, F_b, F_s, t, np.broadcast_to(seg.run / max(seg.runs - 1, 1), t.shape))


def _rms(x: np.ndarray) -> np.ndarray:
    """Of every row."""
    return np.maximum(np.sqrt(np.mean(np.square(x), axis=1)), 1e-9)
