"""Identifiability of causes from the runs of a data set: sensitivities of the physics model's rollouts to causes, and
their collinearity.

The model is the benchmark's own (`predictors/physics.py`), fitted roughly to windows of the data; the sensitivities are
those of its fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..effects.base import Effect, having
from ..errors import ShipbenchError
from ..records import Dataset
from ..signals import F_B
from .coverage import unit_time

_WINDOW, _MOST_WINDOWS, _FIT_STEPS = 6.0, 24, 3
COLLINEAR = 0.9
"""Share at which a cause counts as confounded: 0.9 is a variance inflation factor of 10, the usual limit of
collinearity (Marquardt 1970; Belsley, Kuh and Welsch 1980)."""
_LEAST = 1e-3
"""Least size of the changes to predict of a channel, in ship lengths, radians and sqrt(gL): in a straight run that of
yaw is not zero."""
LEAST_EFFECT = 1e-3
"""Least effect size, as a share of the error of constant velocities, of a cause that can be identified at all."""

_PARAMETERS = {2: ("resistance", "coast down with the shaft stopped, and speed up from rest"),
               0: ("propeller walk", "straight runs with the shaft speed up and down"),
               4: ("rudder offset",
                   "vary the shaft speed at one ship speed: the offset acts with the race, propeller "
                   "walk with the thrust"),
               5: ("rudder lift", "zig-zags at two speeds"),
               10: ("rudder drag", "turns at two rudder angles from "
                                   "one speed")}  # fmt: skip


@dataclass(frozen=True)
class Identifiability:
    """Identifiability of one cause.

    effect_size: of a typical amplitude, relative to the error of constant velocities. explained: share of its square
    that the other causes can explain together. closest, cosine: the cause that explains most alone, and its cosine.
    """

    subject: str
    effect_size: float
    explained: float
    closest: str
    cosine: float
    manoeuvre: str


def identifiability(dataset: Dataset) -> tuple[list[Identifiability], str]:
    """Identifiability of every cause, and a sentence on the method (or why it failed)."""
    steps = min(
        round(_WINDOW * unit_time(dataset.ship.L) / dataset.dt), int(np.median([len(r) for r in dataset.runs])) - 1
    )
    if steps < 4:
        return [], f"the runs are too short for rollouts: {steps} steps of {dataset.dt:g} s in the median run."
    windows = dataset.windows(steps)
    windows = windows.subset(np.unique(np.linspace(0, len(windows) - 1, _MOST_WINDOWS).astype(int)).tolist())
    try:
        columns, names, manoeuvres = _columns(windows, _asked(dataset))
    except ShipbenchError as error:
        return [], f"the physics model cannot be fitted to these runs: {error}"
    how = f"Rollouts of the fitted physics over {len(windows)} windows of {steps * dataset.dt:.3g} s."
    if not len(columns):
        return [], "the rollouts of the fitted physics diverge; check units and signs with `shipbench data check`."
    return _compare(columns, names, manoeuvres), how


def _asked(dataset: Dataset) -> list[Effect]:
    """Effects of a data card that the runs can show: none that is measured, none of thrusters that are never used."""
    thrusters = dataset.ship.thrusters is not None or any(run.states[:, F_B:].any() for run in dataset.runs)
    return [
        effect
        for effect in having("on_card")
        if not set(effect.known_with) & set(dataset.inputs) and (thrusters or effect.family != "thruster")
    ]


def _columns(windows: Dataset, effects: list[Effect]) -> tuple[np.ndarray, list[str], dict[str, str]]:
    """Changes (samples, causes) of the weighted rollouts by typical sizes; columns of one name belong together."""
    from ..predictors.physics import Physics
    from ..predictors.physics_model.fit import Data, parameter_scale, rollout_function  # casadi

    with np.errstate(all="ignore"):  # where nothing moves, the fit's intervals are empty; they are not asked for
        model = Physics(iterations=_FIT_STEPS).fit(windows)
    batch = windows.batch()
    data = Data(
        model.c, batch, model.actuator_path(batch.s0, batch.U), model._wind(batch.U), windows.dt, model.substeps
    )
    sized = [effect.sized(windows.ship.L) for effect in effects]
    held = [tuple(p.typical if p.shape else 0.0 if p.other else None for p in parameters) for parameters in sized]
    forces = tuple(zip(effects, held, strict=True))
    runs = len(data.path)
    function = rollout_function(
        model.c, windows.dt / model.substeps, data.wind is not None, True, forces, model.particulars
    )
    free = [
        (e, p) for e, parameters in zip(effects, sized, strict=True) for p in parameters if not (p.shape or p.other)
    ]
    p = np.concatenate([model.p, np.zeros(len(free))])
    _, S = data.linearised(function, batch.s0, data.inputs(data.path, with_time=True), p)
    root = np.sqrt(runs * data.truth.shape[1] * 6.0)
    size = np.maximum(1.0 / (data.weight() * root), _LEAST * _froude_units(model.c.L))
    J = S / (size * root)[:, None]
    scale = np.concatenate([parameter_scale(model.c), [abs(parameter.typical) for _, parameter in free]])
    kept = [*_PARAMETERS, *range(len(model.p), len(p))]
    Z = (J * scale)[..., kept].reshape(-1, len(kept))
    names = [*(name for name, _ in _PARAMETERS.values()), *(e.name.replace("_", " ") for e, _ in free)]
    manoeuvres = {name: text for name, text in _PARAMETERS.values()} | {
        e.name.replace("_", " "): e.separate for e in effects
    }
    return Z[np.isfinite(Z).all(axis=1)], names, manoeuvres


def _froude_units(L: float) -> np.ndarray:
    """Units (6,) of x, y, psi, u, v, r for a ship of length L [m]: length, radian, sqrt(gL), sqrt(g/L)."""
    speed = float(np.sqrt(9.81 * L))
    return np.array([L, L, 1.0, speed, speed, speed / L])


def _compare(Z: np.ndarray, names: list[str], manoeuvres: dict[str, str]) -> list[Identifiability]:
    """Effect size and explained share of each cause; of a cause with several columns the direction of the largest
    share."""
    found = []
    size = np.linalg.norm(Z, axis=0)
    unit = Z / np.where(size > 0.0, size, 1.0)
    for subject in dict.fromkeys(names):
        own = np.array([name == subject for name in names])
        others = ~own & (size > LEAST_EFFECT)
        effect_size = float(size[own].max(initial=0.0))
        if effect_size <= LEAST_EFFECT or not others.any():
            found.append(Identifiability(subject, effect_size, 0.0, "", 0.0, manoeuvres[subject]))
            continue
        mine = np.linalg.qr(unit[:, own])[0]

        def shared(columns: np.ndarray, mine: np.ndarray = mine) -> float:
            """Cosine of the least angle between the directions of this cause and those of `columns`."""
            return float(min(np.linalg.svd(mine.T @ np.linalg.qr(unit[:, columns])[0], compute_uv=False)[0], 1.0))

        rivals = dict.fromkeys(name for name, there in zip(names, others, strict=True) if there)
        cosine, closest = max((shared(np.array([name == rival for name in names]) & others), rival) for rival in rivals)
        found.append(Identifiability(subject, effect_size, shared(others) ** 2, closest, cosine, manoeuvres[subject]))
    return found
