"""Comparison of yaw rate with heading rate: bias (of all runs, or of single ones), scale, lag.

Over windows of `track_window` the change of the heading is compared with the integral of the yaw rate.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..signals import PSI, R
from .finding import Curve, Finding, Picture, Severity, toml_line
from .recording import Recording
from .selection import Chosen, select
from .statistics import some, spread
from .thresholds import THRESHOLDS
from .track import least_lag, possible_scale, shifted


def _windows(recording: Recording, lag: float) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Windows (run (W,), columns (W, 3): heading's change, integral of r, change of r; span [s]), r shifted back by
    `lag` s. Windows overlap by half: they are judged by runs, which are independent."""
    width = max(3, round(THRESHOLDS.value("window") * recording.froude / recording.dt))
    pieces = [
        (i, S[a : a + width + 1])
        for i, S in shifted(recording, {R: lag} if lag else {})
        for a in range(0, len(S) - width, width // 2)
    ]
    if len(pieces) < THRESHOLDS.count("windows"):
        return None
    S = np.stack([p for _, p in pieces])
    integral = np.trapezoid(S[..., R], dx=recording.dt, axis=1)
    rows = np.column_stack([S[:, -1, PSI] - S[:, 0, PSI], integral, S[:, -1, R] - S[:, 0, R]])
    return np.array([i for i, _ in pieces]), rows, width * recording.dt


def _explain(run: np.ndarray, rows: np.ndarray, span: float, lag: bool = True) -> Chosen:
    groups = {"scale": rows[:, 1:2], "bias": np.full((len(run), 1), span), **({"lag": rows[:, 2:3]} if lag else {})}
    whole = float(np.sqrt(np.mean(rows[:, 0] ** 2))) + 1e-9
    return select(rows[:, 0] - rows[:, 1], groups, np.zeros((len(run), 1)), run, 1, whole)


class _Settled(NamedTuple):
    """Windows of `_windows` with the lag corrected, the explanations chosen in the record as it is and then, the lag
    and its standard error."""

    made: tuple[np.ndarray, np.ndarray, float]
    first: Chosen
    chosen: Chosen
    lag: float
    lag_sd: float


def _settled(recording: Recording) -> _Settled | None:
    """Windows with the lag corrected; None where the ship hardly turns."""
    lag, made = 0.0, _windows(recording, 0.0)
    if made is None or np.sqrt(np.mean(made[1][:, 0] ** 2)) < 0.01:
        return None
    first = chosen = _explain(*made)
    lag_sd = float(first.sd["lag"][0]) if "lag" in first.names else 0.0
    for _ in range(5):
        move = float(chosen.value["lag"][0]) if "lag" in chosen.names else 0.0
        if abs(move) < 0.02 * recording.dt:
            break
        again = _windows(recording, lag + move)
        if again is None:
            break
        lag, made = lag + move, again
        chosen = _explain(*made)
    return _Settled(made, first, chosen, lag, lag_sd)


def late_yaw_rate(recording: Recording) -> tuple[float, float] | None:
    """Time [s] by which the yaw rate lags the heading, with its standard error; None if it does not."""
    found = _settled(recording)
    return None if found is None or found.lag < least_lag(recording) else (found.lag, found.lag_sd)


def check(recording: Recording) -> list[Finding]:
    """Find errors of the yaw rate; none where the ship hardly turns, or where the yaw rate was derived from the
    heading."""
    found = None if "r" in recording.dataset.derived else _settled(recording)
    if found is None:
        return []
    if found.chosen.left["all chosen"] ** 2 > THRESHOLDS.value("most"):
        return [_unrelated(found)]
    made, first, chosen, lag, lag_sd = found
    return (
        _lag(recording, made, first, chosen, lag, lag_sd)
        + _scale(made, first, chosen)
        + _biases(recording, made, first, chosen)
    )


def _picture(made: tuple[np.ndarray, np.ndarray, float], what: str) -> Picture:
    """Picture of the rate of the heading against the mean yaw rate, or of their difference against the change of r."""
    _, rows, span = made
    deg = 180.0 / np.pi
    if what == "lag":
        curves = (Curve("windows", rows[:, 2] * deg, (rows[:, 0] - rows[:, 1]) * deg, "."),)
        return Picture(
            "Heading less integrated yaw rate", "change of r in the window [deg/s]", "difference [deg]", curves
        )
    x, top = rows[:, 1] / span * deg, float(np.max(np.abs(rows[:, 1]))) / span * deg
    equal = Curve("equal", np.array([-top, top]), np.array([-top, top]))
    return Picture(
        "Rate of the heading against yaw rate", "mean of r [deg/s]", "change of psi / time [deg/s]",
        (Curve("windows", x, rows[:, 0] / span * deg, "."), equal),
    )  # fmt: skip


def _unrelated(found: _Settled) -> Finding:
    left = found.chosen.left["all chosen"]
    text = (
        f"r is not the rate of psi: the heading departs from the integral of r by {found.first.left['plain']:.0%} "
        "of its change. "
        f"With any bias, scale and lag it still does by {left:.0%}."
    )
    todo = (
        "Look for the yaw rate, or the heading, in another column. Without a yaw rate, import makes it from the "
        "heading."
    )
    return Finding(
        "yaw",
        "error",
        "unrelated",
        text,
        "",
        todo,
        ("psi", "r"),
        evidence={"left": left},
        picture=_picture(found.made, "scale"),
    )


def _shares(first: Chosen, chosen: Chosen) -> str:
    plain, left = first.left["plain"], chosen.left["all chosen"]
    return f"the heading departs from the integral of r by {plain:.1%} of its change as recorded, by {left:.1%} with it"


def _lag(
    recording: Recording,
    made: tuple[np.ndarray, np.ndarray, float],
    first: Chosen,
    chosen: Chosen,
    lag: float,
    sd: float,
) -> list[Finding]:
    plain = _windows(recording, 0.0) or made
    if not least_lag(recording) <= abs(lag) <= 0.5 * made[2]:
        return []
    if chosen.out > THRESHOLDS.value("most") * _explain(*plain, lag=False).out:
        return []
    late, other = ("r", "the heading") if lag > 0.0 else ("psi", "the yaw rate")  # sensors are late, not early
    text = f"{late} lags {other} by {abs(lag):.2g} s (standard error {sd:.1g} s): {_shares(first, chosen)}."
    return [Finding(
        "yaw", "warning", "lag", text, toml_line({"delay": {late: round(abs(lag), 3)}}), channels=(late,),
        evidence={"lag_s": abs(lag), "sd_s": sd},
        picture=_picture(plain, "lag"),
    )]  # fmt: skip


def _scale(made: tuple[np.ndarray, np.ndarray, float], first: Chosen, chosen: Chosen) -> list[Finding]:
    if chosen.held.get("scale", 1.0) > THRESHOLDS.value("most"):
        return []
    factor, sd = 1.0 / (1.0 + float(chosen.value["scale"][0])), float(chosen.sd["scale"][0])
    if abs(factor - 1.0) < THRESHOLDS.value("least_share") or not possible_scale(factor):
        return []
    text = f"r reads {factor:.3f} of the heading's rate (standard error {sd:.3f}): {_shares(first, chosen)}."
    line = toml_line({"scale": {"r": round(factor, 4)}})
    severity: Severity = "error" if abs(factor - 1.0) > 0.1 else "warning"
    return [
        Finding(
            "yaw",
            severity,
            "scale",
            text,
            line,
            channels=("r",),
            evidence={"factor": factor, "sd": sd},
            picture=_picture(made, "scale"),
        )
    ]


def _biases(
    recording: Recording, made: tuple[np.ndarray, np.ndarray, float], first: Chosen, chosen: Chosen
) -> list[Finding]:
    """Findings on one bias for all runs where they agree, else on those of outlying runs."""
    run, rows, span = made[0][::2], made[1][::2], made[2]  # drifts add up over windows that do not overlap
    known = sum(
        (rows[:, 1 + i] * float(chosen.value[n][0]) for i, n in enumerate(("scale", "lag")) if n in chosen.names),
        np.zeros(len(run)),
    )
    left = rows[:, 0] - rows[:, 1] - known
    drifts = {int(i): -left[run == i] / span for i in np.unique(run) if np.sum(run == i) >= 3}
    shared = float(np.median([d.mean() for d in drifts.values()])) if drifts else np.inf
    half_step = 0.5 * float(recording.steps[R])  # a record in steps is off by half of one for as long as it stands
    least = max(THRESHOLDS.value("least_bias") * recording.turning, half_step)
    if "bias" in chosen.names and abs(shared) > 0.5 * abs(float(chosen.value["bias"][0])):
        bias, sd = -float(chosen.value["bias"][0]), float(chosen.sd["bias"][0])
        if abs(bias) < least:
            return []
        text = (
            f"r reads {np.rad2deg(bias):+.4f} deg/s too much (standard error {np.rad2deg(sd):.4f}) in all runs: "
            f"{_shares(first, chosen)}."
        )
        line = toml_line({"bias": {"r": bias}})
        return [
            Finding(
                "yaw",
                "warning",
                "yaw rate bias",
                text,
                line,
                channels=("r",),
                evidence={"bias": bias, "sd": sd},
                picture=_picture(made, "bias"),
            )
        ]
    usual = spread(np.concatenate([d - d.mean() for d in drifts.values()])) if drifts else 0.0
    found: dict[str, float] = {}
    for i, mine in drifts.items():
        parts = min(len(mine), THRESHOLDS.count("windows"))
        blocks = np.array([part.mean() for part in np.array_split(mine, parts)])
        mean = float(np.mean(mine))
        sd = max(usual / np.sqrt(len(mine)), float(np.std(blocks, ddof=1)) / np.sqrt(len(blocks)) / 2.0)
        if abs(mean) > THRESHOLDS.value("beyond_noise") * sd and abs(mean) > least:
            found[recording.name_of(recording.runs[i])] = mean
    if not found:
        return []
    worst = max(found, key=lambda k: abs(found[k]))
    text = (
        f"r has a bias in {len(found)} of {len(np.unique(run))} runs "
        f"({some([f'{k} {np.rad2deg(v):+.3f}' for k, v in found.items()])} deg/s), "
        f"greatest in {worst}: {np.rad2deg(found[worst]):+.3f} deg/s, "
        f"{100 * abs(found[worst]) / recording.turning:.0f} % of the typical yaw rate."
    )
    line = toml_line({"runs": {name: {"bias": {"r": bias}} for name, bias in found.items()}})
    mine = np.flatnonzero(run == next(i for i in np.unique(run) if recording.name_of(recording.runs[i]) == worst))
    drift = Curve("psi less integral of r", np.arange(1, len(mine) + 1) * span, np.rad2deg(np.cumsum(left[mine])))
    return [Finding(
        "yaw", "warning", "yaw rate bias", text, line, channels=("r",), runs=tuple(found),
        evidence={f"bias_{k}": v for k, v in found.items()},
        picture=Picture(f"Heading less integrated yaw rate, run {worst}", "time [s]", "difference [deg]", (drift,)),
    )]  # fmt: skip


CHECK = check
