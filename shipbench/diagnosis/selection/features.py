"""Forms of unexplained forces or sensor errors, by the variable on which they depend."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from ...estimation.forward import Plant, Segments
from ...estimation.linearisation import Linearisation
from ...physics.wind import apparent_wind
from ..thresholds import THRESHOLDS

Features = tuple[np.ndarray, ...]
OUTSIDE = ("heading", "position", "time", "waves", "run", "measured wind")
"""Variables outside the ship, on which the force of no hull, rudder or propeller depends."""
_CENTRED = ("heading", "position", "run")
"""Variables of which only differences count: a force that is always there does not depend on them."""


class State(NamedTuple):
    """Variables that a force or an error may depend on, in units of the root mean square of the record: motion u, v, r
    over ground, actuators n, delta, F_b, F_s; psi [rad]; x, y: place, from the middle of all; t: time since the run
    began [s]; run: from 0 for the first to 1 for the last; air: velocity of the ship relative to the measured air,
    forward and to starboard; calm: to air at rest."""

    x: np.ndarray
    y: np.ndarray
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
    air: np.ndarray
    calm: np.ndarray


Form = Callable[[State], Features]
"""Function of a form: one coefficient for each feature."""
Forms = Mapping[str, Mapping[str, Form]]


class Feature(NamedTuple):
    """Features (F, K, B) of one form in the middle of every step, and beside the trajectory (`Linearisation.aside`); or
    (F, K + 1, B) at the samples. They are of order one. odd: whether it changes its sign with the ship's mirror image;
    ways: number of forms of which it was chosen."""

    form: str
    on: np.ndarray
    aside: np.ndarray
    odd: bool
    ways: int

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.on)


def _harmonic(k: int) -> Form:
    return lambda s: (np.cos(k * s.psi), np.sin(k * s.psi))


def _blown(form: Callable[[np.ndarray, np.ndarray], Features]) -> Form:
    """Function of the relative velocity, less its value in air at rest, which is a resistance."""
    return lambda s: tuple(x - still for x, still in zip(form(*s.air), form(*s.calm), strict=True))


def _period(seconds: float) -> Form:
    return lambda s: (np.cos(2.0 * np.pi * s.t / seconds), np.sin(2.0 * np.pi * s.t / seconds))


_OF_FORCES: Forms = {
    "nothing": {"constant": lambda s: (np.ones_like(s.u),)},
    "heading": {f"cos({k} psi + phase)": _harmonic(k) for k in (1, 2, 3)},
    "position": {"a x + b y": lambda s: (s.x, s.y),
        "a x + b y + c x^2 + d x y + e y^2": lambda s: (s.x, s.y, s.x**2, s.x * s.y, s.y**2)},
    "speed": {"u": lambda s: (s.u,), "u|u|": lambda s: (s.u * abs(s.u),)},
    "sway velocity": {"v": lambda s: (s.v,), "v|v|": lambda s: (s.v * abs(s.v),), "|v|": lambda s: (abs(s.v),),
        "v^2": lambda s: (s.v**2,)},
    "yaw rate": {"r": lambda s: (s.r,), "r|r|": lambda s: (s.r * abs(s.r),), "|r|": lambda s: (abs(s.r),),
        "r^2": lambda s: (s.r**2,)},
    "rudder": {
        "delta": lambda s: (s.delta,), "delta|delta|": lambda s: (s.delta * abs(s.delta),),
        "|delta|": lambda s: (abs(s.delta),),
        "delta^2": lambda s: (s.delta**2,),
    },
    "revolutions": {"n": lambda s: (s.n,), "n|n|": lambda s: (s.n * abs(s.n),)},
    "revolutions and yaw rate": {
        "n r": lambda s: (s.n * s.r,), "n|n| r": lambda s: (s.n * abs(s.n) * s.r,),
        "n |r|": lambda s: (s.n * abs(s.r),),
        "n|n| |r|": lambda s: (s.n * abs(s.n * s.r),),
    },
    "revolutions and sway velocity": {
        "n v": lambda s: (s.n * s.v,), "n|n| v": lambda s: (s.n * abs(s.n) * s.v,),
        "n |v|": lambda s: (s.n * abs(s.v),),
        "n|n| |v|": lambda s: (s.n * abs(s.n * s.v),),
    },
    "revolutions and rudder": {
        "n delta": lambda s: (s.n * s.delta,), "n|n| delta": lambda s: (s.n * abs(s.n) * s.delta,),
        "n |delta|": lambda s: (s.n * abs(s.delta),),
        "n|n| |delta|": lambda s: (s.n * abs(s.n * s.delta),), "n|n| delta^2": lambda s: (s.n * abs(s.n) * s.delta**2,),
    },
    "speed and rudder": {
        "u delta": lambda s: (s.u * s.delta,), "u^2 delta": lambda s: (s.u**2 * s.delta,),
        "u^2 |delta|": lambda s: (s.u**2 * abs(s.delta),),
        "u^2 delta^2": lambda s: ((s.u * s.delta) ** 2,),
    },
    "run": {"number of the run": lambda s: (s.run,), "its square": lambda s: (s.run**2,)},
    "thrusters": {
        "F_b": lambda s: (s.F_b,), "F_s": lambda s: (s.F_s,), "F_b u": lambda s: (s.F_b * s.u,),
        "F_s u": lambda s: (s.F_s * s.u,),
        "|F_b|": lambda s: (abs(s.F_b),), "|F_s|": lambda s: (abs(s.F_s),),
    },
    "measured wind": {
        "V^2": _blown(lambda a, b: (a**2 + b**2,)), "V^2 cos(gamma)": _blown(lambda a, b: (a * np.hypot(a, b),)),
        "V^2 sin(gamma)": _blown(lambda a, b: (b * np.hypot(a, b),)), "V^2 sin(2 gamma)": _blown(lambda a, b: (a * b,)),
        "V^2 cos(gamma + phase)": _blown(lambda a, b: (a * np.hypot(a, b), b * np.hypot(a, b))),
        "V^2 cos(2 gamma + phase)": _blown(lambda a, b: (a**2 - b**2, a * b)),
    },
}  # fmt: skip
_OF_SENSORS: Forms = {
    "nothing": {"constant": lambda s: (np.ones_like(s.u),)},
    "heading": {f"cos({k} psi + phase)": _harmonic(k) for k in (1, 2)},
    "speed": {"u": lambda s: (s.u,), "u|u|": lambda s: (s.u * abs(s.u),)},
    "sway velocity": {"v": lambda s: (s.v,), "v|v|": lambda s: (s.v * abs(s.v),)},
    "yaw rate": {"r": lambda s: (s.r,), "r|r|": lambda s: (s.r * abs(s.r),), "|r|": lambda s: (abs(s.r),)},
    "rudder": {"delta": lambda s: (s.delta,), "|delta|": lambda s: (abs(s.delta),)},
    "revolutions": {"n": lambda s: (s.n,), "n|n|": lambda s: (s.n * abs(s.n),)},
    "run": {"number of the run": lambda s: (s.run,)},
}


def of_forces(lin: Linearisation) -> dict[str, list[Feature]]:
    """Features of all forms of a force about a trajectory, by variable; of thrusters only where they are used; "waves":
    of time, with the periods of waves. Call it after `lin.columns`."""
    plant, seg = lin.plant, lin.plant.seg
    assert lin.aside is not None
    act, t = plant.midway(lin.path)
    wind = None if seg.wind is None else np.swapaxes(seg.wind[:, :-1], 0, 1)
    on, aside = (_state(plant, middle[0], act, t, wind) for middle in (lin.middle, lin.aside))
    ends = _ends(plant)
    low = 1.0 / ends  # what is slower is not told from what grows with time
    high = 1.0 / max(THRESHOLDS.value("shortest_period") * plant.froude, 4.0 * seg.dt)
    # even in frequency: from one to the next the longest run sees half a cycle more, so that one is near enough to any
    even = 1 + int(np.ceil(2.0 * max(high - low, 0.0) * ends))
    tried = np.linspace(low, high, min(even, THRESHOLDS.count("periods")))
    rocking = tried > 1.0 / (THRESHOLDS.value("longest_swell") * plant.c.L**0.5)
    rhythms, periods = (
        {f"cos(2 pi t / {T:.3g} s + phase)": _period(float(T)) for T in 1.0 / part}
        for part in (tried[rocking], tried[~rocking])
    )
    waves, compared = _waves(lin)
    forms = {
        **_OF_FORCES,
        "time": _grown(ends) | periods,
        "waves": rhythms,
        "position": {**_OF_FORCES["position"], **waves},
    }
    if not np.any(seg.states[..., 8:]):
        del forms["thrusters"]
    if wind is None:
        del forms["measured wind"]
    return _features(forms, on, aside, seg.mask[:, 1:].T, dict.fromkeys(waves, compared))


def of_sensors(lin: Linearisation) -> dict[str, list[Feature]]:
    """Features of all forms of a sensor's error, by variable, at the samples."""
    plant, seg = lin.plant, lin.plant.seg
    t = (seg.start[:, None] + seg.dt * np.arange(plant.steps + 1)).T
    at = _state(plant, np.swapaxes(lin.motion, 0, 1), np.swapaxes(seg.states[..., 6:], 0, 1), t, None)
    return _features({**_OF_SENSORS, "time": _grown(_ends(plant))}, at, at, seg.mask.T, {})


def _waves(lin: Linearisation) -> tuple[dict[str, Form], int]:
    """Waves over the positions visited, in any direction, that fit the latent force best, one for each axis, and the
    number tried: a current, a depth or a shore that differs from place to place. They are compared at the knots of the
    force, by the share of it that they explain."""
    plant, seg = lin.plant, lin.plant.seg
    at = np.minimum(np.round(np.arange(plant.knots) * plant.knot_time / seg.dt).astype(int), plant.steps)
    known, (centre, unit) = seg.mask[:, at], _places(seg)
    every = 1 + int(known.sum()) // 5000  # compared at no more than 5000 knots of the force
    places, force = ((lin.motion[:, at, :2][known] - centre) / unit)[::every], lin.point.w[known][::every]
    step = np.pi / max(float(np.max(np.ptp(places, axis=0))), 1e-9)
    shortest = THRESHOLDS.value("shortest_wave") * plant.c.L
    most = min(int(2.0 * np.pi * unit / shortest / step), THRESHOLDS.count("waves"))
    i, j = np.meshgrid(np.arange(-most, most + 1), np.arange(most + 1), indexing="ij")
    numbers = step * np.stack([i, j], axis=-1)[((j > 0) | (i > 0)) & (np.hypot(i, j) <= most)]
    if not len(numbers):
        return {}, 0
    a, b = (x - x.mean(axis=0) for x in (np.cos(places @ numbers.T), np.sin(places @ numbers.T)))
    aa, bb, ab = np.sum(a * a, axis=0), np.sum(b * b, axis=0), np.sum(a * b, axis=0)
    fa, fb = ((force - force.mean(axis=0)).T @ x for x in (a, b))
    taken = (bb * fa**2 - 2.0 * ab * fa * fb + aa * fb**2) / np.maximum(aa * bb - ab**2, 1e-9 * len(places) ** 2)
    found = {}
    for k, m in numbers[np.unique(np.argmax(taken, axis=1))]:
        towards = np.degrees(np.arctan2(m, k))
        found[f"wave of {2.0 * np.pi * unit / np.hypot(k, m):.0f} m over the places, towards {towards:.0f} deg"] = (
            _wave(float(k), float(m))
        )
    return found, len(numbers)


def _wave(k: float, m: float) -> Form:
    return lambda s: (np.cos(k * s.x + m * s.y), np.sin(k * s.x + m * s.y))


def _grown(ends: float) -> dict[str, Form]:
    return {"t": lambda s: (s.t / ends,), "t^2": lambda s: ((s.t / ends) ** 2,)}


def _ends(plant: Plant) -> float:
    """Duration of the longest run [s]."""
    seg = plant.seg
    return float(np.max(seg.start + seg.dt * (seg.mask.sum(axis=1) - 1)))


def _features(
    of: Forms, on: State, aside: State, real: np.ndarray, ways: Mapping[str, int]
) -> dict[str, list[Feature]]:
    """Features by variable. ways: number of further forms from which they were chosen."""
    found: dict[str, list[Feature]] = {}
    to_starboard = np.array([1.0, -1.0])[:, None, None]
    mirrored = on._replace(v=-on.v, r=-on.r, delta=-on.delta, air=on.air * to_starboard, calm=on.calm * to_starboard)
    for variable, forms in of.items():
        found[variable] = []
        for name, form in forms.items():
            x, y = np.stack(form(on)), np.stack(form(aside))
            centre = x[:, real].mean(axis=1) if variable in _CENTRED else np.zeros(len(x))
            unit = _rms(x[:, real] - centre[:, None])
            odd = np.array_equal(np.stack(form(mirrored)), -x)
            x, y = ((z - centre[:, None, None]) / unit[:, None, None] for z in (x, y))
            found[variable].append(Feature(name, x, y, odd, ways.get(name, len(forms.keys() - ways.keys()))))
    return found


def _state(plant: Plant, motion: np.ndarray, act: np.ndarray, t: np.ndarray, wind: np.ndarray | None) -> State:
    """State from motion (..., 6), actuators (..., 4), times and wind (..., 2: speed, from), each with axes (K, B)
    before."""
    seg = plant.seg
    record = seg.states[seg.mask]
    units = _rms(record[:, 3:].T)[:, None, None]
    centre, unit = _places(seg)
    x, y = np.moveaxis((motion[..., :2] - centre) / unit, -1, 0)
    psi, u, v, r = np.moveaxis(motion[..., 2:], -1, 0)
    calm = np.stack([u, v])
    air = calm if wind is None else np.stack(apparent_wind(psi, u, v, wind[..., 0], wind[..., 1]))
    u, v, r = np.stack([u, v, r]) / units[:3]
    n, delta, F_b, F_s = np.moveaxis(act, -1, 0) / units[3:]
    return State(
        x, y, psi, u, v, r, n, delta, F_b, F_s, t, np.broadcast_to(seg.run / max(seg.runs - 1, 1), t.shape), air, calm
    )


def _places(seg: Segments) -> tuple[np.ndarray, float]:
    """Middle (2,) and root mean square [m] of the places visited."""
    places = seg.states[seg.mask][:, :2]
    centre = places.mean(axis=0)
    return centre, float(_rms((places - centre).reshape(1, -1))[0])


def _rms(x: np.ndarray) -> np.ndarray:
    """Root mean square of every row."""
    return np.maximum(np.sqrt(np.mean(np.square(x), axis=1)), 1e-9)
