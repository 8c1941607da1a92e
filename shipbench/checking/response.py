"""Time lags between actuators and motion: a rudder or shaft record that is late against the motion, a motion late
against them, late commands.

Changes of yaw rate, surge, rudder and shaft over some seconds are regressed on the integrals of their causes, with the
record of the cause shifted in time. A cause acts at once, so the shift of least squares is the lag of the record.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..signals import DELTA, F_B, F_S, N, R, U, V
from .actuators import check as command_like
from .finding import Curve, Finding, Picture, toml_line
from .recording import Recording
from .standing import standing
from .statistics import inliers
from .thresholds import THRESHOLDS

_MOTION = ("x", "y", "psi", "u", "v", "r")
_Shift = Callable[[np.ndarray], np.ndarray]
_Columns = Callable[[np.ndarray, np.ndarray, _Shift], tuple[np.ndarray, list[np.ndarray]]]


@dataclass(frozen=True)
class _Pair:
    """Cause and effect. columns: (states (T, 10), inputs, shift) -> effect (T,) and causes [(T,), ...], where shift
    moves a channel in time.

    lag: least lag of the cause that is reported [s at 130 m]. gain: log likelihood that it must gain, unless the
    actuator lags its command, too. Noise in the motion and unrecorded forces make the rudder seem late, never early.
    of: the state of the effect. order: the cause is a command, which is held until the next sample, and windows that it
    does not explain count; else these are left out. A lead of a command is confounded with the dead time of the
    actuator.
    """

    cause: str
    effect: str
    of: str
    columns: _Columns
    lag: float
    gain: float
    order: bool


def _yaw(S: np.ndarray, orders: np.ndarray, shift: _Shift) -> tuple[np.ndarray, list[np.ndarray]]:
    u, v, r, n, delta = S[:, U], S[:, V], S[:, R], S[:, N], shift(S[:, DELTA])
    speed = np.abs(u)
    steered = [delta * u * speed, delta * n * np.abs(n), delta * n * speed]
    return r, [*steered, r * speed, r * np.abs(r), v * speed, S[:, F_B], S[:, F_S], np.ones(len(S))]


def _surge(S: np.ndarray, orders: np.ndarray, shift: _Shift) -> tuple[np.ndarray, list[np.ndarray]]:
    u, v, r, delta, n = S[:, U], S[:, V], S[:, R], S[:, DELTA], shift(S[:, N])
    return u, [
        n * np.abs(n),
        n * u,
        u * np.abs(u),
        v * r,
        r * r,
        delta**2 * u * np.abs(u),
        delta**2 * n * np.abs(n),
        np.ones(len(S)),
    ]


def _gear(actuator: int) -> _Columns:
    """Rate of an actuator from its distance to the command, with rate limits at several shares of its range."""

    shares = (0.005, 0.02, 0.05, 0.1, 0.2, 0.5)

    def columns(S: np.ndarray, orders: np.ndarray, shift: _Shift) -> tuple[np.ndarray, list[np.ndarray]]:
        left = shift(orders[:, actuator - N]) - S[:, actuator]
        reach = float(np.ptp(S[:, actuator])) + 1e-12
        return S[:, actuator], [left, *(np.clip(left, -share * reach, share * reach) for share in shares)]

    return columns


def _pairs() -> tuple[_Pair, ...]:
    """All pairs, with what is asked of each."""
    lag, order_lag, gain = THRESHOLDS.value("actuator_lag"), THRESHOLDS.value("order_lag"), _gain()
    return (
        _Pair("delta", "yaw rate", "r", _yaw, lag, THRESHOLDS.value("rudder_lag_gain"), False),
        _Pair("n", "surge", "u", _surge, lag, gain, False),
        _Pair("delta_c", "rudder", "delta", _gear(DELTA), order_lag, gain, True),
        _Pair("n_c", "shaft", "n", _gear(N), order_lag, gain, True),
    )


def _gain() -> float:
    """Log likelihood that every explanation has to gain."""
    return 0.5 * THRESHOLDS.value("explanation_gain")


_STEP = 0.5
"""Step between the lags that are tried [s at 130 m]."""


@dataclass(frozen=True)
class _Search:
    """Search over lags: lags (G,) [s], residual mean squares with each (G,), number of windows."""

    lags: np.ndarray
    squares: np.ndarray
    windows: int

    @property
    def best(self) -> int:
        return int(np.argmin(self.squares))

    @property
    def plain(self) -> int:
        return len(self.lags) // 2

    @property
    def gain(self) -> float:
        """Log likelihood gained by the lag."""
        return (
            0.5 * self.windows * float(np.log((self.squares[self.plain] + 1e-300) / (self.squares[self.best] + 1e-300)))
        )


def _search(recording: Recording, pair: _Pair) -> _Search | None:
    """Search over lags of one pair; None where there are too few windows."""
    times = THRESHOLDS.value("response_time"), THRESHOLDS.value("averaging_time")
    ahead, edge = (max(1, round(seconds * recording.froude / recording.dt)) for seconds in times)
    half = round(THRESHOLDS.value("longest_lag") / _STEP)
    lags = np.arange(-half, half + 1) * _STEP * recording.froude
    margin = int(np.ceil(lags[-1] / recording.dt))
    lengths = np.array([len(run) for run in recording.runs])
    ends = np.cumsum(lengths)
    windows = np.concatenate(
        [np.arange(b - n + margin, b - margin - ahead - edge + 1, ahead) for n, b in zip(lengths, ends, strict=True)]
    )
    if len(windows) < THRESHOLDS.count("regression_windows"):
        return None
    S, orders = (
        np.concatenate([run.states for run in recording.runs]),
        np.concatenate([run.inputs for run in recording.runs]),
    )
    place, first, last = np.arange(len(S)), np.repeat(ends - lengths, lengths), np.repeat(ends - 1, lengths)

    def rows(lag: float) -> tuple[np.ndarray, np.ndarray]:
        """Changes of the effect (windows,) and integrals of the causes (windows, P), scaled to unit mean squares."""
        moved = np.clip(place + lag / recording.dt, first, last)
        low = np.minimum(moved.astype(int), len(S) - 2)
        part = moved - low
        effect, causes = pair.columns(S, orders, lambda values: (1.0 - part) * values[low] + part * values[low + 1])
        cause = np.column_stack(causes) * recording.dt
        X = _changes(np.cumsum(cause, axis=0) - (1.0 if pair.order else 0.5) * cause, windows, ahead, edge)
        return _changes(effect[:, None], windows, ahead, edge)[:, 0], X / (np.sqrt(np.mean(X**2, axis=0)) + 1e-300)

    y, X = rows(0.0)
    keep = np.ones(len(y), dtype=bool)
    for _ in range(0 if pair.order else 2):
        keep = inliers(y - X @ np.linalg.lstsq(X[keep], y[keep], rcond=None)[0])
    left = [
        float(np.mean((y[keep] - X[keep] @ np.linalg.lstsq(X[keep], y[keep], rcond=None)[0]) ** 2))
        for y, X in map(rows, lags)
    ]
    return _Search(lags, np.array(left), int(keep.sum()))


def _changes(values: np.ndarray, windows: np.ndarray, ahead: int, edge: int) -> np.ndarray:
    """Changes (windows, P): mean of values (T, P) over an edge less the mean over the edge `ahead` samples before;
    windows: their first samples."""
    samples = windows[:, None] + np.arange(edge)
    return np.asarray((values[samples + ahead] - values[samples]).mean(axis=1))


def check(recording: Recording) -> list[Finding]:
    """Find lags, at most one for each pair; none where actuators are commands: the lag is then that of the actuator
    dynamics. A motion that import derived from another is not tested.

    Where rudder or shaft speed is missing from the record, its effect biases the other's lag: the motion is not tested.
    """
    if recording.dataset.actuators != "measured" or command_like(recording):
        return []
    missing = standing(recording.dataset)
    made = {pair.cause for pair in _pairs() if pair.of in recording.dataset.derived}
    asked = [pair for pair in _pairs() if pair.cause in recording.recorded - made and (pair.order or not missing)]
    searches = {pair.cause: _search(recording, pair) for pair in asked}
    waits = {cause: -float(s.lags[s.best]) for cause, s in searches.items() if s is not None and s.gain >= _gain()}
    found = [
        f for pair in asked
        if (s := searches[pair.cause]) is not None and (f := _judge(recording, pair, s,
                waits.get(f"{pair.cause}_c", 0.0))) is not None
    ]  # fmt: skip
    motion = [f for f in found if f.channels == _MOTION]  # rudder and shaft may both say it
    return [f for f in found if f not in motion] + sorted(motion, key=lambda f: -f.evidence["gain"])[:1]


def _judge(recording: Recording, pair: _Pair, found: _Search, waits: float) -> Finding | None:
    """Finding of a pair; waits: delay [s] of the actuator behind its command, 0.0 where it is unknown.

    None where the best lag is the last one searched: unrecorded forces do that.
    """
    lag, gain = float(found.lags[found.best]), pair.gain
    at_130 = lag / recording.froude
    if found.best in (0, len(found.lags) - 1):
        return None
    if at_130 >= pair.lag and waits >= THRESHOLDS.value("order_lag") * recording.froude:
        lag, gain = min(lag, waits), _gain()
    if at_130 >= pair.lag and found.gain >= gain:
        line = {pair.cause: lag}
        said = f"{pair.cause} is recorded about {lag:.2g} s late: the {pair.effect} responds before it"
        todo = "" if not pair.order else "Commands are moved by whole samples."
    elif not pair.order and at_130 <= -pair.lag and found.gain >= _gain():
        line = dict.fromkeys(_MOTION, -lag)
        said = f"the motion is recorded about {-lag:.2g} s late against {pair.cause}: no hull responds so late"
        todo = f"If the clock of {pair.cause} is wrong instead, write [delay] {pair.cause} = {lag:.3g}."
    else:
        return None
    share = float(np.sqrt(found.squares[found.best] / found.squares[found.plain]))
    text = (
        f"{said}. With this shift the residual of a regression of the {pair.effect} is {share:.0%} of that as recorded "
        f"({found.windows} windows)."
    )
    curve = Curve(
        f"{pair.effect} by {pair.cause}", found.lags, np.sqrt(found.squares / found.squares[found.plain]), ".-"
    )
    title = f"Residual of the {pair.effect}, with {pair.cause} shifted in time"
    picture = Picture(title, "lag of the record [s]", "residual, as recorded = 1", (curve,))
    return Finding(
        "response", "warning", "lag", text, toml_line({"delay": {k: round(v, 3) for k, v in line.items()}}), todo,
        tuple(line),
        evidence={"lag_s": lag, "gain": found.gain, "windows": found.windows}, picture=picture,
    )  # fmt: skip


CHECK = check
