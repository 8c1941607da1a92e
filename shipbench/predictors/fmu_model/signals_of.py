"""Signals between us and an FMU: start values and inputs in its units, and its outputs as states."""

from __future__ import annotations

import numpy as np

from ...signals import COMMANDS, PSI, STATES, X, Y
from .mapping import Mapping

_POSE = ("x", "y", "psi")


def start_values(mapping: Mapping, s0: np.ndarray) -> np.ndarray:
    """Start values (batch, start) in the FMU's units of the states s0 (batch, 10)."""
    columns = [(s0[:, STATES.index(link.channel)] - link.offset) / link.factor for link in mapping.start]
    return np.stack(columns, axis=1) if columns else np.zeros((len(s0), 0))


def input_values(mapping: Mapping, U: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Inputs (batch, K, inputs) in the FMU's units of U (batch, K, channels)."""
    columns = [(U[..., names.index(link.channel)] - link.offset) / link.factor for link in mapping.inputs]
    return np.ascontiguousarray(np.stack(columns, axis=-1))


def states_of(mapping: Mapping, found: np.ndarray, s0: np.ndarray, U: np.ndarray, dt: float) -> np.ndarray:
    """States S (batch, K, 10) of the outputs `found` (batch, K + 1, outputs), whose first row is the FMU's start.

    Actuators without an output follow their commands. A position without an output is integrated from the speeds, a
    heading from the yaw rate. A pose whose start cannot be set is moved to the one of s0.
    """
    S = np.repeat(s0[:, None, :], U.shape[1] + 1, axis=1)
    S[:, 1:, 6:10] = U[..., : len(COMMANDS)]
    for channel, value in mapping.fixed.items():
        S[:, 1:, STATES.index(channel)] = value
    for j, link in enumerate(mapping.outputs):
        S[..., STATES.index(link.channel)] = link.factor * found[..., j] + link.offset
    given, settable = ({link.channel for link in links} for links in (mapping.outputs, mapping.start))
    if "psi" not in given:
        S[..., PSI] = s0[:, None, PSI] + _integral(S[..., 5], dt)
    S[..., PSI] = np.unwrap(S[..., PSI], axis=1)
    turned = s0[:, None, PSI] - S[:, :1, PSI]
    # A wrapped heading differs from s0 by whole turns only.
    own_heading = "psi" in given and "psi" not in settable
    S[..., PSI] += turned if own_heading else 2 * np.pi * np.round(turned / (2 * np.pi))
    if "x" not in given:
        _integrate_track(S, s0, dt)
    elif own_heading or not {"x", "y"} <= settable:
        _move_track(S, s0, turned if own_heading else np.zeros_like(turned))
    return S[:, 1:]


def _integral(rate: np.ndarray, dt: float) -> np.ndarray:
    """Integral (batch, K + 1) of a rate by the trapezoidal rule, from zero."""
    with np.errstate(invalid="ignore", over="ignore"):
        steps = 0.5 * dt * (rate[:, 1:] + rate[:, :-1])
    return np.concatenate([np.zeros_like(steps[:, :1]), np.cumsum(steps, axis=1)], axis=1)


def _integrate_track(S: np.ndarray, s0: np.ndarray, dt: float) -> None:
    u, v, c, s = S[..., 3], S[..., 4], np.cos(S[..., PSI]), np.sin(S[..., PSI])
    S[..., X] = s0[:, None, X] + _integral(u * c - v * s, dt)
    S[..., Y] = s0[:, None, Y] + _integral(u * s + v * c, dt)


def _move_track(S: np.ndarray, s0: np.ndarray, turned: np.ndarray) -> None:
    """Move and turn the track so that it begins at s0."""
    dx, dy = S[..., X] - S[:, :1, X], S[..., Y] - S[:, :1, Y]
    c, s = np.cos(turned), np.sin(turned)
    S[..., X] = s0[:, None, X] + c * dx - s * dy
    S[..., Y] = s0[:, None, Y] + s * dx + c * dy
