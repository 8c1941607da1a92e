"""Errors of the record itself, before any fit.

Errors by `shipbench data check` are corrected where the check has a line of dataset.toml for them, repeated while one
correction reveals the next. A record that still contradicts itself is refused: no model explains it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...checking.applying import laid
from ...checking.base import check_dataset
from ...checking.finding import Finding
from ...checking.units import UnitFinding
from ...checking.units import merged as one_per_channel
from ...data.reread import reread
from ...effects.base import EFFECTS
from ...errors import InputError
from ...estimation.forward import SEGMENT
from ...records import Run
from ...ship import Particulars, complete
from ...signals import COMMANDS, PSI, STATES, X, Y
from ...units import sign_factor, unit_factor
from ..thresholds import THRESHOLDS
from .base import Prepared
from .derived_speeds import beside_heading, beside_track

_KEEP = "To keep the correction: shipbench data check FOLDER --apply."


def joined(errors: Sequence[UnitFinding]) -> list[UnitFinding]:
    """Errors, one per channel; frames and kinds of velocities, which are no factors, first."""
    return [e for e in errors if e.factor == 1.0] + one_per_channel([e for e in errors if e.factor != 1.0])


def correct_record_errors(prepared: Prepared) -> Prepared:
    """Correct units, signs and frames by the errors that the check finds. A fault that is an effect of the library, of
    a plausible size, is left to the fit, which estimates its size and gain.

    Raises:
        InputError: errors remain after repeated correction.
    """
    dataset = prepared.dataset
    errors: list[UnitFinding] = []
    told: dict[str, str] = {}
    ship, rounds = complete(dataset.ship), THRESHOLDS.count("correction_rounds")
    for round_ in range(rounds + 1):
        found = [
            f
            for f in check_dataset(dataset)
            if f.severity == "error" and f.line and f.text not in told and not _has_effect(f, ship)
        ]
        if not found:
            break
        lines = laid({}, found)
        if round_ == rounds or lines.refused:
            raise InputError(
                f"data set '{dataset.name}': {found[0].text} This is left after {round_} corrections, so nothing is "
                "fitted. Accepted: a record "
                "without errors. Correct dataset.toml by the lines of `shipbench data check`, one at a time."
            )
        dataset = reread(dataset, lines.description)
        told |= {f.text: f"{f.text} It is corrected before the fit. {_KEEP}" for f in found}
        errors += [e for f in found for e in _errors(f)]
    return replace(prepared.corrected(dataset, *told.values()), errors=(*prepared.errors, *joined(errors)))


def refuse_contradictions(prepared: Prepared) -> Prepared:
    """Refuse runs whose positions and speeds, or heading and yaw rate, contradict each other most of the time.

    Raises:
        InputError: in most segments in which the ship moves, and in three at least, more than half of the squared
            displacement, or turn, is unexplained.
    """
    dataset = prepared.dataset
    length = max(1, round(SEGMENT * (dataset.ship.L / 130.0) ** 0.5 / dataset.dt))
    track, turns = (np.concatenate(parts) for parts in zip(*(_ends(run, length) for run in dataset.runs), strict=True))
    least_way = THRESHOLDS.value("contradiction_least_way") * dataset.ship.L
    least_turn = np.deg2rad(THRESHOLDS.value("contradiction_least_turn"))
    for (made, said), least, what, by, unit, channels in (
        (track.T, least_way, "positions move", "heading and speeds say", "m", "x, y, psi, u, v"),
        (np.rad2deg(turns.T), np.rad2deg(least_turn), "the heading turns", "the yaw rate says", "deg", "psi, r"),
    ):
        larger = np.maximum(np.abs(made), np.abs(said))
        moving = larger > least
        against = moving & (2.0 * np.abs(made - said) ** 2 > larger**2)
        if np.sum(against) > max(0.5 * np.sum(moving), 2):
            one, other = (float(np.median(np.abs(values[against]))) for values in (made, said))
            raise InputError(
                f"data set '{dataset.name}' contradicts itself, so nothing is fitted. In {np.sum(against)} of "
                f"{np.sum(moving)} pieces {what} by "
                f"{one:.3g} {unit} where {by} {other:.3g} {unit}, or another way. Accepted: 0.3 to 3.4 times as "
                "much, the same way. "
                f"Correct the unit, sign or column of {channels}, or the unit of t, in dataset.toml. Look with: "
                "shipbench data check FOLDER."
            )
    return prepared


def _ends(run: Run, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of segments by positions and by speeds (east as imaginary part), turn by heading and by yaw rate;
    both (segments, 2), in m and rad."""
    edges = np.linspace(0, len(run) - 1, max(1, -(-(len(run) - 1) // length)) + 1).round().astype(int)
    plane = np.array([1.0, 1j])
    pairs = (
        (run.states[:, [X, Y]] @ plane, beside_track(run) @ plane),
        (run.states[:, PSI], beside_heading(run)[:, 0]),
    )
    track, turn = (np.column_stack([np.diff(made[edges]), np.diff((made - off)[edges])]) for made, off in pairs)
    return track, turn


def _has_effect(found: Finding, ship: Particulars) -> bool:
    """Check whether an effect of the library is the fault that was found, of a plausible size."""
    scales = tomllib.loads(found.line).get("scale", {})
    effects = [e for e in map(EFFECTS.get, EFFECTS.names()) if scales and set(scales) <= set(e.scales)]
    return any(e.plausible((value - 1.0,), ship) for e in effects for value in scales.values())


def _errors(found: Finding) -> Sequence[UnitFinding]:
    """Channels that a finding's line reads in another unit, sign or scale, with the commands of their actuators; or in
    another frame."""
    entries = tomllib.loads(found.line)
    factors = {channel: float(value) for channel, value in entries.get("scale", {}).items() if channel in STATES}
    kinds = dict.fromkeys(factors, "recorded in another scale")
    for table, factor_of, kind in (
        ("units", unit_factor, "recorded in {}"),
        ("signs", sign_factor, "recorded positive {}"),
    ):
        for channel, word in entries.get(table, {}).items():
            for name in (channel, *({f"{channel}_c"} & set(COMMANDS))) if channel in STATES else ():
                factors[name] = factors.get(name, 1.0) / factor_of(channel, word)
                kinds[name] = ", ".join(filter(None, (kinds.get(name), kind.format(word))))
    if not factors and found.channels and found.channels[0] in STATES:
        return [UnitFinding(found.channels[0], found.kind, 1.0, found.text)]
    return [UnitFinding(name, kinds[name], factor, found.text) for name, factor in factors.items()]
