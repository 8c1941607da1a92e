"""Gross errors of unit and sign, found before any model is fitted, by kinematics between the channels.

Increments over windows of some seconds are compared with integrals, never with differences of neighbours: track against
heading and speeds, heading against yaw rate. Every combination of units and signs is tried with the usual errors of
sensors as free parameters (a scale of 15 %, a compass error, an antenna away from midship, a delay, a drift).

A combination is accepted if it leaves `little` of the plain reading's squares. For the small sway alone it may leave
`most`, if that is significant and better than no sway at all. Of combinations that explain the same (a mirrored track
with mirrored sway is a mirrored heading), that with the fewest errors is taken, the rudder's side included.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..effects.unit_or_sign_error import FACTORS
from ..records import Dataset, Run
from ..signals import COMMANDS, DELTA, F_B, F_S, PSI, STATES, N, R, U, V, X, Y
from .rudder_side import Side, rudder_side
from .thresholds import THRESHOLDS

_SWAPPED = "exchanged with y"
_REVERSED = "x and y reversed"
_MOST_WINDOWS = 1500
"""Greatest number of windows that are compared, for the time that they take."""


@dataclass(frozen=True)
class UnitFinding:
    """Channel (state or command) with another unit or sign than the standard one.

    kind: "degrees", "knots", "sign", "degrees, sign", or "exchanged with y" (of x). factor: recorded over true (1:
    exchanged). evidence: in words.
    """

    channel: str
    kind: str
    factor: float
    evidence: str


def check_units(dataset: Dataset) -> list[UnitFinding]:
    """Find gross unit and sign errors of a data set; empty when none is certain.

    Detected are: units and sign of psi, r, u, v; x, y or both reversed, or exchanged; unit and side of delta; unit and
    sign of n; units of the thrusters; commands beside their actuators. A mirror image of everything is not detected.
    """
    runs = [run for run in dataset.runs if len(run) >= 3]
    if not runs:
        return []
    findings = _actuator_units(dataset, runs)
    motion, froude = _motion(dataset, runs), (dataset.ship.L / 130.0) ** 0.5
    shaft = {ahead: _shaft_sign(runs, dataset.dt, froude, ahead) for ahead in (1.0, -1.0)}
    astern = tuple(ahead for ahead, found in shaft.items() if found)
    side = rudder_side(dataset, runs, abs(motion.choose(Side(), astern).r))
    chosen = motion.choose(side, astern)
    findings += motion.findings(chosen) + shaft[float(np.sign(chosen.u))]
    if side.sign * np.sign(chosen.r) < 0:
        findings.append(UnitFinding("delta", "sign", -1.0, side.evidence))
    return merged(findings + check_commands(runs, dataset.dt, findings))


def corrected(dataset: Dataset, findings: Sequence[UnitFinding]) -> Dataset:
    """Data set with the findings corrected: channels divided by their factors, x and y exchanged back."""
    if not findings:
        return dataset
    notes = tuple(f"{f.channel} was recorded otherwise ({f.kind}) and is corrected. {f.evidence}" for f in findings)
    runs = []
    for run in dataset.runs:
        states, inputs = run.states.copy(), run.inputs.copy()
        for f in findings:
            if f.kind == _SWAPPED:
                states[:, [X, Y]] = states[:, [Y, X]]
            elif f.channel in STATES:
                states[:, STATES.index(f.channel)] /= f.factor
            else:
                inputs[:, dataset.inputs.index(f.channel)] /= f.factor
        runs.append(replace(run, states=states, inputs=inputs))
    return replace(dataset, runs=tuple(runs), notes=(*dataset.notes, *notes))


def _finding(channel: str, factor: float, evidence: str) -> UnitFinding:
    units = FACTORS.get(channel.removesuffix("_c"), {})
    near = [name for name, size in units.items() if abs(abs(factor) / size - 1.0) < 0.02]
    return UnitFinding(channel, ", ".join([*near, *(["sign"] if factor < 0.0 else [])]), factor, evidence)


def merged(findings: Sequence[UnitFinding]) -> list[UnitFinding]:
    """Findings with one per channel: unit and sign of delta are found apart. Two that cancel are none."""
    found: dict[str, UnitFinding] = {}
    for f in findings:
        old = found.get(f.channel)
        found[f.channel] = (
            f
            if old is None or f.kind == _SWAPPED
            else _finding(f.channel, f.factor * old.factor, f"{old.evidence} {f.evidence}")
        )
    return [f for f in found.values() if f.factor != 1.0 or f.kind == _SWAPPED]


@dataclass(frozen=True)
class _Reading:
    """Factors recorded over true; frame: (x, y) as recorded from true: plain, y, x or both reversed, exchanged."""

    frame: str = "plain"
    psi: float = 1.0
    u: float = 1.0
    v: float = 1.0
    r: float = 1.0

    @property
    def errors(self) -> int:
        """Number of separate errors; one wrong unit of both speeds counts once."""
        units = {abs(self.u), abs(self.v)} - {1.0}
        signs = sum(f < 0.0 for f in (self.psi, self.u, self.v, self.r))
        return (self.frame != "plain") + (abs(self.psi) != 1.0) + (abs(self.r) != 1.0) + len(units) + signs


def _signed(channel: str) -> list[float]:
    return [s * f for f in (1.0, *FACTORS[channel].values()) for s in (1.0, -1.0)]


_FRAMES = {
    "plain": np.eye(2), "y reversed": np.diag([1.0, -1.0]), "x reversed": np.diag([-1.0, 1.0]),
    _SWAPPED: np.array([[0.0, 1.0], [1.0, 0.0]]),
}  # fmt: skip


@dataclass(frozen=True)
class _Motion:
    """Residual squares of readings: track[reading] of (frame, psi, u, v) over that of no motion, yaw[(psi, r)] in the
    same way; empty where there is none."""

    track: dict[_Reading, float]
    yaw: dict[tuple[float, float], float]
    window: float
    windows: int

    def choose(self, side: Side, astern: Sequence[float]) -> _Reading:
        """Choose the reading with the fewest errors among those that explain the data as well as any; the plain one
        unless it fails by far. astern: signs of u with which the shaft would turn the wrong way."""
        plain = _Reading()
        suits = self._tracks(plain) if self.track else [replace(plain, psi=psi) for psi in self._headings()]
        options = [(replace(k, r=r), self.track.get(k, 0.0)) for k in suits for r in self._rates(k.psi)]
        return min(
            options, key=lambda o: (o[0].errors + (side.sign * np.sign(o[0].r) < 0) + (np.sign(o[0].u) in astern), o[1])
        )[0]

    def _tracks(self, plain: _Reading) -> list[_Reading]:
        """Readings of the track that fit."""
        most, little = THRESHOLDS.value("most"), THRESHOLDS.value("little")
        sane = {k: s for k, s in self.track.items() if k.v in (1.0, k.u) or s < most * self.track[replace(k, v=np.inf)]}
        best, as_read = min(sane.values()), self.track[plain]
        if best < little * min(as_read, 1.0):
            return [k for k, s in sane.items() if s <= THRESHOLDS.value("similar") * best]
        sway = min((k for k in sane if k == replace(plain, v=k.v)), key=lambda k: sane[k])
        gain = 2.0 * self.windows * np.log(as_read / sane[sway])
        sure = sane[sway] < most * as_read and gain > THRESHOLDS.value("explanation_gain")
        return [sway] if sure and sane[sway] < little else [plain]

    def _headings(self) -> list[float]:
        """Readings of psi that fit, without a track."""
        best, little = min(self.yaw.values(), default=np.inf), THRESHOLDS.value("little")
        if best > little * min(self.yaw.get((1.0, 1.0), 1.0), 1.0):
            return [1.0]
        return sorted({psi for (psi, _), s in self.yaw.items() if best > little * s})

    def _rates(self, psi: float) -> list[float]:
        """Readings of r that fit a reading of psi."""
        if not self.yaw:
            return [1.0]
        here = {r: s for (p, r), s in self.yaw.items() if p == psi}
        best = min(here.values())
        if best > THRESHOLDS.value("little") * min(here[1.0], 1.0):
            return [1.0]
        return [r for r, s in here.items() if s <= THRESHOLDS.value("similar") * best]

    def findings(self, chosen: _Reading) -> list[UnitFinding]:
        """Findings under the reading chosen."""
        found = []
        text = "Yaw rate and heading agree only if it is read so."
        if self.track:
            plain, left = self.track[_Reading()] ** 0.5, self.track[replace(chosen, r=1.0)] ** 0.5
            text = (
                f"The track departs from heading and speeds by {plain:.1%} of its length as recorded, by "
                f"{left:.1%} read so"
            )
            text += f" ({self.windows} windows of {self.window:.3g} s)."
        if chosen.frame == _SWAPPED:
            found.append(UnitFinding("x", _SWAPPED, 1.0, text))
        elif chosen.frame != "plain":
            found += [
                UnitFinding(channel, "sign", -1.0, text)
                for channel in ("xy" if chosen.frame == _REVERSED else chosen.frame[0])
            ]
        for channel, factor in (("psi", chosen.psi), ("u", chosen.u), ("v", chosen.v)):
            if factor != 1.0:
                found.append(_finding(channel, factor, text))
        if chosen.r != 1.0:
            plain, left = self.yaw[chosen.psi, 1.0], self.yaw[chosen.psi, chosen.r]
            text = (
                f"The heading departs from the integrated yaw rate by {plain**0.5:.1%} of it as recorded, by "
                f"{left**0.5:.1%} read so."
            )
            found.append(_finding("r", chosen.r, text))
        return found


def _motion(dataset: Dataset, runs: Sequence[Run]) -> _Motion:
    """Compare track, heading, speeds and yaw rate under all readings."""
    L, dt = dataset.ship.L, dataset.dt
    froude = (L / 130.0) ** 0.5
    width = max(3, round(THRESHOLDS.value("short_window") * froude / dt))
    pieces = [run.states[a : a + width + 1] for run in runs for a in range(0, len(run) - width, width)]
    if len(pieces) < THRESHOLDS.count("windows"):
        return _Motion({}, {}, width * dt, len(pieces))
    S = np.stack(pieces[:: max(1, -(-len(pieces) // _MOST_WINDOWS))])
    limits = _limits(L, froude)
    moved, turned = S[:, -1, [X, Y]] - S[:, 0, [X, Y]], S[:, -1, PSI] - S[:, 0, PSI]
    track: dict[_Reading, float] = {}
    whole = float(np.sum(moved**2))
    headings = [
        f for f in _signed("psi") if abs(f) == 1.0 or np.ptp(S[..., PSI]) > 2.0 * np.pi
    ]  # degrees: else all courses would be one
    if whole > len(S) * (THRESHOLDS.value("least_distance") * L) ** 2:
        floor = 2.0 * len(S) * (0.001 * L) ** 2
        for psi in headings:
            parts = _track_parts(S, psi, dt)
            for frame, matrix in _FRAMES.items():
                for (u, v), left in _track_squares(moved @ matrix.T, parts, width * dt, limits).items():
                    track[_Reading(frame, psi, u, v)] = (left + floor) / whole
    for k in [k for k in track if k.frame == "plain"]:  # the same way is made with both speeds reversed
        track[replace(k, frame=_REVERSED, u=-k.u, v=k.v if np.isinf(k.v) else -k.v)] = track[k]
    yaw: dict[tuple[float, float], float] = {}
    yaw_limits = np.array([limits[0], 0.1 / froude, limits[4]])
    rate, jump = np.trapezoid(S[:, :, R], dx=dt, axis=1), S[:, -1, R] - S[:, 0, R]
    for psi, r in itertools.product(headings, _signed("r")) if np.sum(turned**2) > len(S) * 0.01**2 else ():
        columns = np.stack([rate / r, np.full(len(S), width * dt), jump / r], axis=-1)
        left = _bounded_squares((turned / psi - rate / r)[None], columns[None], yaw_limits)[0]
        yaw[psi, r] = (float(left) + len(S) * 0.003**2) / float(np.sum((turned / psi) ** 2))
    return _Motion(track, yaw, width * dt, len(S))


def _limits(L: float, froude: float) -> np.ndarray:
    """Bounds (8,) of scale [1], heading [rad], antenna [m], delays in earth and ship axes [s], drift [m/s]."""
    antenna, delay = THRESHOLDS.value("fault_antenna") * L, THRESHOLDS.value("longest_lag") * froude
    drift = THRESHOLDS.value("fault_drift") * froude
    scale, heading = THRESHOLDS.value("fault_scale"), THRESHOLDS.value("fault_heading")
    return np.array([scale, heading, antenna, antenna, delay, delay, drift, drift])


def _track_parts(S: np.ndarray, psi: float, dt: float) -> dict[str, np.ndarray]:
    """Parts of the displacement by surge, sway, sensor errors, (W, 2) each, in windows S (W, samples, 10); psi:
    heading's factor."""
    c, s = np.cos(S[..., PSI] / psi), np.sin(S[..., PSI] / psi)
    ahead, abeam = np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)
    surge, sway = S[..., U, None] * ahead, S[..., V, None] * abeam

    def gained(speed: np.ndarray, axis: np.ndarray) -> np.ndarray:
        """Change of a speed along an axis that turns with the ship."""
        return np.sum(np.diff(speed, axis=1)[..., None] * 0.5 * (axis[:, 1:] + axis[:, :-1]), axis=1)

    return {
        "u": np.trapezoid(surge, dx=dt, axis=1), "du": surge[:, -1] - surge[:, 0], "own du": gained(S[..., U], ahead),
        "v": np.trapezoid(sway, dx=dt, axis=1), "dv": sway[:, -1] - sway[:, 0], "own dv": gained(S[..., V], abeam),
        "ahead": ahead[:, -1] - ahead[:, 0], "abeam": abeam[:, -1] - abeam[:, 0],
    }  # fmt: skip


def _track_squares(
    moved: np.ndarray, parts: dict[str, np.ndarray], span: float, limits: np.ndarray
) -> dict[tuple[float, float], float]:
    """Residual squares of the displacements `moved` (W, 2) for every reading of u and v."""
    pairs = list(itertools.product(_signed("u"), [*_signed("v"), np.inf]))
    u, v = (np.array(values)[:, None, None] for values in zip(*pairs, strict=True))
    way, change, own_change = (parts[f"{of}u"] / u + parts[f"{of}v"] / v for of in ("", "d", "own d"))
    across = np.stack([-way[..., 1], way[..., 0]], axis=-1)
    drift = span * np.eye(2)[:, None, :]
    shared = np.broadcast_arrays(way, across, parts["ahead"], parts["abeam"], change, own_change, drift[0], drift[1])
    columns = np.stack(shared, axis=-1).reshape(len(pairs), -1, len(limits))
    return dict(
        zip(pairs, _bounded_squares((moved - way).reshape(len(pairs), -1), columns, limits).tolist(), strict=True)
    )


def _bounded_squares(target: np.ndarray, columns: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Least sums of squares (H,) of target (H, T) less columns (H, T, P) times coefficients within +-limits (P,):
    coordinate descent."""
    scaled = columns * limits
    G, b = np.swapaxes(scaled, 1, 2) @ scaled, np.einsum("htp,ht->hp", scaled, target)
    x = np.zeros(b.shape)
    for _ in range(40):
        for i in range(b.shape[1]):
            slope = b[:, i] - np.einsum("hp,hp->h", G[:, i], x) + G[:, i, i] * x[:, i]
            x[:, i] = np.clip(slope / np.maximum(G[:, i, i], 1e-30), -1.0, 1.0)
    return np.sum((target - np.einsum("htp,hp->ht", scaled, x)) ** 2, axis=1)


def _actuator_units(dataset: Dataset, runs: Sequence[Run]) -> list[UnitFinding]:
    """Units of rudder, shaft and thrusters from their physical limits."""
    S, ship = np.concatenate([run.states for run in runs]), dataset.ship
    found = []
    rudder = float(np.quantile(np.abs(S[:, DELTA]), 0.99))
    if THRESHOLDS.value("largest_rudder_angle") < rudder < 75.0:
        found.append(
            _finding(
                "delta", FACTORS["delta"]["degrees"], f"The rudder goes to {rudder:.3g}, which no rudder does in rad."
            )
        )
    turning = S[np.abs(S[:, N]) > THRESHOLDS.value("most") * np.max(np.abs(S[:, N]))]
    diameter = ship.propeller.diameter if ship.propeller else 0.6 * ship.T
    noise = float(np.median(np.abs(np.concatenate([np.diff(run.states[:, N]) for run in runs]))))
    if len(turning) and np.median(np.abs(turning[:, N])) > 20.0 * noise:
        advance = float(np.median(np.hypot(turning[:, U], turning[:, V]) * 60.0 / (np.abs(turning[:, N]) * diameter)))
        if advance > 3.5:
            # a turning rate of rev/s x sqrt(D) is 1 to 7 on ships of any size (Froude), 2 pi times that in rad/s
            unit = "rev/s" if advance > 12.0 or np.median(np.abs(turning[:, N])) * diameter**0.5 < 7.0 else "rad/s"
            text = (
                f"At its highest shaft speed the ship advances {advance:.3g} propeller diameters per turn "
                "if n is in rpm; propellers advance less than 1.5."
            )
            found.append(_finding("n", FACTORS["n"][unit], text))
    greatest = ship.thrusters.max_force if ship.thrusters else 0.0
    for channel in (F_B, F_S):
        push = float(np.max(np.abs(S[:, channel])))
        ordered = any(np.any(run.inputs[:, channel - N]) for run in runs)  # else it is the noise of a thruster at rest
        used = THRESHOLDS.value("large_share") * greatest
        if ordered and used < push * 1e3 and push < 1.5e-3 * greatest:
            text = f"The greatest force recorded is {push:.3g}, that of the ship file {greatest:.4g} N."
            found.append(_finding(STATES[channel], FACTORS["F_b"]["kN"], text))
    return found


def _lagged(runs: Sequence[Run], i: int, lag: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Cosine similarity of a command and its actuator `lag` samples later, and both."""
    wanted = np.concatenate([r.inputs[: max(len(r) - lag, 0), i] for r in runs])
    is_ = np.concatenate([r.states[lag:, N + i] for r in runs])
    size = float(np.sqrt(np.sum(wanted**2) * np.sum(is_**2)))
    return (float(wanted @ is_) / size if size else 0.0), wanted, is_


def _shaft_sign(runs: Sequence[Run], dt: float, froude: float, ahead: float) -> list[UnitFinding]:
    """Find a reversed sign of the shaft speed: the ship keeps her speed against the record, and hardly ever with it.
    ahead: sign of the recorded u."""
    width = max(1, round(THRESHOLDS.value("window") * froude / dt))
    pieces = [run.states[a : a + width + 1] for run in runs for a in range(0, len(run) - width, width)]
    if not pieces:
        return []
    n, u = (np.stack(pieces)[..., channel] for channel in (N, U))
    keeps = np.abs(u[:, -1]) > (1.0 - THRESHOLDS.value("least_share")) * np.abs(u[:, 0])
    keeps &= (np.abs(u[:, 0]) > THRESHOLDS.value("large_share") * np.max(np.abs(u))) & (u[:, -1] * u[:, 0] > 0.0)
    along = np.sign(u[:, :1] * n * ahead)[keeps & np.all(np.abs(n) > 0.3 * np.max(np.abs(n)), axis=1)]
    with_it, against = (int(np.sum(np.all(along == side, axis=1))) for side in (1.0, -1.0))
    if against < THRESHOLDS.count("occurrences") or with_it > THRESHOLDS.value("little") * against:
        return []
    text = (
        f"In {against} stretches of {width * dt:.3g} s the ship keeps her speed against the recorded shaft "
        f"speed, in {with_it} with it."
    )
    return [_finding("n", -1.0, text)]


def check_commands(runs: Sequence[Run], dt: float, findings: Sequence[UnitFinding]) -> list[UnitFinding]:
    """Find commands that share their actuator's error, or have one of their own."""
    own = {f.channel: f.factor for f in merged(findings)}
    found, lags = [], (0.0, 2.0, 5.0, 10.0)  # s by which an actuator may follow its command
    for i, command in enumerate(COMMANDS):
        actuator = command.removesuffix("_c")
        like, wanted, is_ = max((_lagged(runs, i, round(lag / dt)) for lag in lags), key=lambda found: abs(found[0]))
        if abs(like) < THRESHOLDS.value("most"):
            continue
        ratio = float(wanted @ is_) / float(is_ @ is_) * own.get(actuator, 1.0)
        near = min(_signed(actuator), key=lambda f: abs(np.log(abs(f / ratio))) + 10.0 * (f * ratio < 0.0))
        if near != 1.0 and abs(np.log(near / ratio)) < 0.25:
            found.append(
                _finding(command, near, f"It is {ratio / own.get(actuator, 1.0):.3g} times its actuator's record.")
            )
    return found
