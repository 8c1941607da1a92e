"""Gross errors of unit and sign, found before any model is fitted: what the channels say of one another by kinematics.

Increments over windows of some seconds are compared with integrals, never with differences of neighbours. Track against heading and
speeds, heading against yaw rate: every combination of units and signs is tried with the ordinary faults of sensors left free (a scale of 15 %, a
compass error, an antenna away from midship, a delay, a drift), and one is believed if it leaves a quarter or less of the plain reading's
squares. Of combinations that explain the same (a mirrored track with mirrored sway is a mirrored heading), that with the fewest errors is
taken, the rudder's side included.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..effects.unit_or_sign_error import FACTORS, in_words
from ..records import Dataset, Run
from ..signals import COMMANDS, DELTA, F_B, F_S, PSI, STATES, N, R, U, V, X, Y

BETTER = 4.0
"""How much larger the plain reading's sum of squares must be than that of the reading believed."""
_ALIKE = 1.5
_WINDOW, _RUDDER_WINDOW = 15.0, 6.0
"""Seconds at 130 m, Froude-scaled."""
_MOST_WINDOWS, _FEWEST_WINDOWS = 1500, 12
_POOR = 0.15
_SWAPPED = "exchanged with y"


@dataclass(frozen=True)
class UnitFinding:
    """A channel (state or command) that is not in our unit or sign.

    kind: "degrees", "knots", "sign", "degrees, sign", or "exchanged with y" (of x). factor: recorded over true (1: exchanged). evidence: in words.
    """

    channel: str
    kind: str
    factor: float
    evidence: str


def check_units(dataset: Dataset) -> list[UnitFinding]:
    """Gross unit and sign errors of a data set; empty when nothing is beyond doubt.

    Seen are: units and sign of psi, r, u, v; x or y reversed or exchanged; unit and side of delta; units of n and of the thrusters; commands beside
    their actuators. Not seen is a mirror image of everything.
    """
    runs = [run for run in dataset.runs if len(run) >= 3]
    if not runs:
        return []
    findings = _actuator_units(dataset, runs)
    motion, side = _motion(dataset, runs), _rudder_side(dataset, runs)
    chosen = motion.choose(side)
    findings += motion.findings(chosen)
    if side.sign * np.sign(chosen.r) < 0:
        findings.append(UnitFinding("delta", "sign", -1.0, side.evidence))
    return _merged(findings + _commands(runs, findings))


def corrected(dataset: Dataset, findings: Sequence[UnitFinding]) -> Dataset:
    """The data set with the findings taken out: channels divided by their factors, x and y exchanged back."""
    if not findings:
        return dataset
    notes = tuple(f"{f.channel} recorded {_words(f)}; corrected. {f.evidence}" for f in findings)
    columns = list(dataset.inputs)
    runs = []
    for run in dataset.runs:
        states, inputs = run.states.copy(), run.inputs.copy()
        for f in findings:
            if f.kind == _SWAPPED:
                states[:, [X, Y]] = states[:, [Y, X]]
            elif f.channel in STATES:
                states[:, STATES.index(f.channel)] /= f.factor
            else:
                inputs[:, columns.index(f.channel)] /= f.factor
        runs.append(replace(run, states=states, inputs=inputs))
    return replace(dataset, runs=tuple(runs), notes=(*dataset.notes, *notes))


def _words(f: UnitFinding) -> str:
    return f.kind if f.kind == _SWAPPED else in_words(_state_of(f.channel), f.factor)


def _state_of(channel: str) -> str:
    return channel.removesuffix("_c")


def _kind(channel: str, factor: float) -> str:
    units = FACTORS.get(_state_of(channel), {})
    near = [name for name, size in units.items() if abs(abs(factor) / size - 1.0) < 0.02]
    return ", ".join([*near, *(["sign"] if factor < 0.0 else [])])


def _finding(channel: str, factor: float, evidence: str) -> UnitFinding:
    return UnitFinding(channel, _kind(channel, factor), factor, evidence)


def _merged(findings: Sequence[UnitFinding]) -> list[UnitFinding]:
    """One finding per channel: unit and sign of delta are found apart."""
    found: dict[str, UnitFinding] = {}
    for f in findings:
        old = found.get(f.channel)
        found[f.channel] = f if old is None or f.kind == _SWAPPED else _finding(f.channel, f.factor * old.factor, f"{old.evidence} {f.evidence}")
    return list(found.values())


# --- track, heading and speeds ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Reading:
    """Factors recorded over true; frame: (x, y) as recorded from true: plain, y or x reversed, exchanged."""

    frame: str = "plain"
    psi: float = 1.0
    u: float = 1.0
    v: float = 1.0
    r: float = 1.0

    @property
    def errors(self) -> int:
        """Number of separate mistakes; one wrong unit of both speeds counts once."""
        units = {abs(self.u), abs(self.v)} - {1.0}
        signs = sum(f < 0.0 for f in (self.psi, self.u, self.v, self.r))
        return (self.frame != "plain") + (abs(self.psi) != 1.0) + (abs(self.r) != 1.0) + len(units) + signs


def _signed(channel: str) -> list[float]:
    return [s * f for f in (1.0, *FACTORS[channel].values()) for s in (1.0, -1.0)]


_FRAMES = {
    "plain": np.eye(2), "y reversed": np.diag([1.0, -1.0]), "x reversed": np.diag([-1.0, 1.0]), _SWAPPED: np.array([[0.0, 1.0], [1.0, 0.0]]),
}  # fmt: skip
_LIMITS = np.array([0.15, 0.1, 0.7, 0.7, 6.0, 1.0, 1.0])
"""Of scale [1], compass error [rad], antenna [L], delay [s at 130 m] and drift [m/s at 130 m]."""


@dataclass(frozen=True)
class _Motion:
    """Squares that readings leave: track[reading] of (frame, psi, u, v) over that of no motion, yaw[(psi, r)] likewise; empty where there is none."""

    track: dict[_Reading, float]
    yaw: dict[tuple[float, float], float]
    window: float
    windows: int

    def choose(self, side: _Side) -> _Reading:
        """The reading with the fewest errors among those that explain the data as well as any; the plain one unless it fails by far."""
        plain = _Reading()
        readings = self.track or {replace(plain, psi=psi): 0.0 for psi in _signed("psi")}
        best = min(readings.values())
        suits = [plain] if readings[plain] <= BETTER * best or best > _POOR else [k for k, s in readings.items() if s <= _ALIKE * best]
        if not self.track and self.yaw and not self._fails(1.0):
            suits = [plain]
        elif not self.track:
            suits = list(readings)
        options = [(replace(k, r=r), readings[k]) for k in suits for r in self._rates(k.psi)]
        if not options:
            return plain
        return min(options, key=lambda o: (o[0].errors + (side.sign * np.sign(o[0].r) < 0), o[1]))[0]

    def _fails(self, psi: float) -> bool:
        best = min(self.yaw.values())
        return self.yaw[psi, 1.0] > BETTER * best and best < _POOR

    def _rates(self, psi: float) -> list[float]:
        """Readings of r that suit a reading of psi."""
        if not self.yaw:
            return [1.0]
        here = {r: s for (p, r), s in self.yaw.items() if p == psi}
        best = min(here.values())
        if here[1.0] <= BETTER * best or best > _POOR:
            return [1.0]
        return [r for r, s in here.items() if s <= _ALIKE * best]

    def findings(self, chosen: _Reading) -> list[UnitFinding]:
        """What is wrong under the reading chosen."""
        found = []
        track = f"over {self.windows} windows of {self.window:.3g} s"
        if self.track:
            plain, left = self.track[_Reading()], self.track[replace(chosen, r=1.0)]
            track = f"The track departs from heading and speeds by {plain**0.5:.0%} of its length as read, {left**0.5:.1%} so read ({track})."
        if chosen.frame != "plain":
            channel, kind = ("x", _SWAPPED) if chosen.frame == _SWAPPED else (chosen.frame[0], "sign")
            found.append(UnitFinding(channel, kind, 1.0 if kind == _SWAPPED else -1.0, track))
        for channel, factor in (("psi", chosen.psi), ("u", chosen.u), ("v", chosen.v)):
            if factor != 1.0:
                found.append(_finding(channel, factor, track if self.track else "Yaw rate and heading agree only if it is read so."))
        if chosen.r != 1.0:
            plain, left = self.yaw[chosen.psi, 1.0], self.yaw[chosen.psi, chosen.r]
            text = f"The heading departs from the integrated yaw rate by {plain**0.5:.0%} as read, {left**0.5:.1%} so read."
            found.append(_finding("r", chosen.r, text))
        return found


def _motion(dataset: Dataset, runs: Sequence[Run]) -> _Motion:
    """Compare track, heading, speeds and yaw rate under all readings."""
    L, dt = dataset.ship.L, dataset.dt
    froude = (L / 130.0) ** 0.5
    width = max(3, round(_WINDOW * froude / dt))
    pieces = [run.states[a : a + width + 1] for run in runs for a in range(0, len(run) - width, width)]
    if len(pieces) < _FEWEST_WINDOWS:
        return _Motion({}, {}, width * dt, len(pieces))
    S = np.stack(pieces[:: max(1, -(-len(pieces) // _MOST_WINDOWS))])
    limits = _LIMITS * np.array([1.0, 1.0, L, L, froude, froude, froude])
    moved, turned = S[:, -1, [X, Y]] - S[:, 0, [X, Y]], S[:, -1, PSI] - S[:, 0, PSI]
    track: dict[_Reading, float] = {}
    whole = float(np.sum(moved**2))
    if whole > len(S) * (0.02 * L) ** 2:
        floor = 2.0 * len(S) * (0.003 * L) ** 2
        for psi in _signed("psi"):
            parts = _track_parts(S, psi, dt)
            for frame, matrix in _FRAMES.items():
                for (u, v), left in _track_squares(moved @ matrix.T, parts, width * dt, limits).items():
                    track[_Reading(frame, psi, u, v)] = (left + floor) / whole
    yaw: dict[tuple[float, float], float] = {}
    rate, jump = np.trapezoid(S[:, :, R], dx=dt, axis=1), S[:, -1, R] - S[:, 0, R]
    for psi, r in itertools.product(_signed("psi"), _signed("r")) if np.sum(turned**2) > len(S) * 0.01**2 else ():
        columns = np.stack([rate / r, np.full(len(S), width * dt), jump / r], axis=-1)
        left = _bounded_squares(turned / psi - rate / r, columns[None], np.array([0.15, 0.1 / froude, limits[4]]))[0]
        yaw[psi, r] = (float(left) + len(S) * 0.003**2) / float(np.sum((turned / psi) ** 2))
    return _Motion(track, yaw, width * dt, len(S))


def _track_parts(S: np.ndarray, psi: float, dt: float) -> dict[str, np.ndarray]:
    """Of windows S (W, samples, 10) whose heading is read with the factor psi: surge and sway's part of the way, (W, 2) each, and what faults do."""
    c, s = np.cos(S[..., PSI] / psi), np.sin(S[..., PSI] / psi)
    ahead, abeam = np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)
    surge, sway = S[..., U, None] * ahead, S[..., V, None] * abeam
    return {
        "u": np.trapezoid(surge, dx=dt, axis=1), "du": surge[:, -1] - surge[:, 0], "ahead": ahead[:, -1] - ahead[:, 0],
        "v": np.trapezoid(sway, dx=dt, axis=1), "dv": sway[:, -1] - sway[:, 0], "abeam": abeam[:, -1] - abeam[:, 0],
    }  # fmt: skip


def _track_squares(moved: np.ndarray, parts: dict[str, np.ndarray], span: float, limits: np.ndarray) -> dict[tuple[float, float], float]:
    """Squares left of the ways `moved` (W, 2) for every reading of u and v."""
    pairs = list(itertools.product(_signed("u"), _signed("v")))
    found: dict[tuple[float, float], float] = {}
    drift = np.zeros((2, *moved.shape))
    drift[0, :, 0] = drift[1, :, 1] = span
    for u, v in pairs:
        way, change = parts["u"] / u + parts["v"] / v, parts["du"] / u + parts["dv"] / v
        across = np.stack([-way[:, 1], way[:, 0]], axis=-1)
        columns = np.stack([way, across, parts["ahead"], parts["abeam"], change, drift[0], drift[1]], axis=-1)
        found[u, v] = float(_bounded_squares((moved - way).reshape(-1), columns.reshape(1, -1, len(limits)), limits)[0])
    return found


def _bounded_squares(target: np.ndarray, columns: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Least sums of squares (H,) of target (T,) less columns (H, T, P) times coefficients within +-limits (P,): coordinate descent."""
    scaled = columns * limits
    G, b = np.swapaxes(scaled, 1, 2) @ scaled, np.swapaxes(scaled, 1, 2) @ target
    x = np.zeros(b.shape)
    for _ in range(40):
        for i in range(b.shape[1]):
            slope = b[:, i] - np.einsum("hp,hp->h", G[:, i], x) + G[:, i, i] * x[:, i]
            x[:, i] = np.clip(slope / np.maximum(G[:, i, i], 1e-30), -1.0, 1.0)
    return np.sum((target - np.einsum("htp,hp->ht", scaled, x)) ** 2, axis=1)


# --- rudder, shaft, thrusters ----------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Side:
    """sign: +1 where the recorded rudder turns the recorded yaw rate to its own side, -1 to the other, 0 where it is not clear."""

    sign: float = 0.0
    evidence: str = ""


def _rudder_side(dataset: Dataset, runs: Sequence[Run]) -> _Side:
    """Which way the yaw rate goes after the rudder: r(t + 6 s) - r(t) against delta(t), given r(t), ahead and without thrusters."""
    ahead = max(1, round(_RUDDER_WINDOW * (dataset.ship.L / 130.0) ** 0.5 / dataset.dt))
    rows = []
    for run in runs:
        S = run.states
        idle = (S[:, F_B] == 0.0) & (S[:, F_S] == 0.0) & (S[:, U] * np.sign(np.median(S[:, U])) > 0.0) & (S[:, N] >= 0.0)
        at = np.arange(0, len(S) - ahead, max(1, ahead // 2))
        at = at[np.array([bool(np.all(idle[a : a + ahead + 1])) for a in at], dtype=bool)]
        if len(at) < 6 or np.std(S[at, DELTA]) <= 1e-9:
            continue
        block = np.stack([S[at + ahead, R] - S[at, R], S[at, R], S[at, DELTA]], axis=-1)
        rows.append(block - block.mean(axis=0))
    if len(rows) < 3:
        return _Side()
    own = [_slopes(block)[0][0] for block in rows]
    slope, sd = _slopes(np.concatenate(rows))
    sign = float(np.sign(slope[0]))
    agree = sum(np.sign(b) == sign for b in own)
    if abs(slope[0]) < 10.0 * sd or agree < 0.85 * len(own):
        return _Side()
    return _Side(
        sign, f"In {agree} of {len(own)} runs the yaw rate goes to the other side after the rudder (pooled slope {abs(slope[0]) / sd:.0f} sigma)."
    )


def _slopes(block: np.ndarray) -> tuple[np.ndarray, float]:
    """(slope of column 0 on column 2, on column 1) and the first one's standard error."""
    A, y = block[:, [2, 1]], block[:, 0]
    G = A.T @ A + 1e-12 * np.trace(A.T @ A) * np.eye(2)
    slope = np.linalg.solve(G, A.T @ y)
    variance = float(np.mean((y - A @ slope) ** 2))
    return slope, float(np.sqrt(2.0 * variance * np.linalg.inv(G)[0, 0])) + 1e-300


def _actuator_units(dataset: Dataset, runs: Sequence[Run]) -> list[UnitFinding]:
    """Units of rudder, shaft and thrusters from what is possible at all."""
    S, ship = np.concatenate([run.states for run in runs]), dataset.ship
    found = []
    rudder = float(np.quantile(np.abs(S[:, DELTA]), 0.99))
    if 1.3 < rudder < 75.0:
        found.append(_finding("delta", FACTORS["delta"]["degrees"], f"The rudder goes to {rudder:.3g}, which no rudder does in rad."))
    turning = S[np.abs(S[:, N]) > 0.7 * np.max(np.abs(S[:, N]))]
    diameter = ship.propeller.diameter if ship.propeller else 0.6 * ship.T
    noise = float(np.median(np.abs(np.concatenate([np.diff(run.states[:, N]) for run in runs]))))
    if len(turning) and np.median(np.abs(turning[:, N])) > 20.0 * noise:
        advance = float(np.median(np.hypot(turning[:, U], turning[:, V]) * 60.0 / (np.abs(turning[:, N]) * diameter)))
        for unit, low, high in (("rad/s", 3.5, 12.0), ("rev/s", 12.0, 150.0)):
            if low < advance <= high:
                text = f"At its highest revolutions the ship advances {advance:.3g} diameters per turn if n is in rpm; a screw gives way below 1.5."
                found.append(_finding("n", FACTORS["n"][unit], text))
    greatest = ship.thrusters.max_force if ship.thrusters else 0.0
    for channel in (F_B, F_S):
        push = float(np.max(np.abs(S[:, channel])))
        if 0.0 < push < 2e-3 * greatest and push * 1e3 < 1.5 * greatest:
            text = f"The greatest force recorded is {push:.3g}, that of the ship file {greatest:.4g} N."
            found.append(_finding(STATES[channel], FACTORS["F_b"]["kN"], text))
    return found


def _commands(runs: Sequence[Run], findings: Sequence[UnitFinding]) -> list[UnitFinding]:
    """Commands that share their actuator's error, or have one of their own."""
    own = {f.channel: f.factor for f in _merged(findings)}
    found = []
    for i, command in enumerate(COMMANDS):
        actuator = _state_of(command)
        wanted, is_ = np.concatenate([r.inputs[:, i] for r in runs]), np.concatenate([r.states[:, N + i] for r in runs])
        size = float(np.sqrt(np.sum(wanted**2) * np.sum(is_**2)))
        if size == 0.0 or abs(float(wanted @ is_)) < 0.7 * size:
            continue
        ratio = float(wanted @ is_) / float(is_ @ is_) * own.get(actuator, 1.0)
        near = min(_signed(actuator), key=lambda f: abs(np.log(abs(f / ratio))) + 10.0 * (f * ratio < 0.0))
        if near != 1.0 and abs(np.log(near / ratio)) < 0.25:
            found.append(_finding(command, near, f"It is {ratio / own.get(actuator, 1.0):.3g} times its actuator's record."))
    return found
