"""Faults of `shipbench suite check`, with the finding expected for each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from . import planting as plant
from . import planting_logging as logging
from .planting import DEG, KNOT, Planting


@dataclass(frozen=True)
class Fault:
    """Fault to plant. plant changes the planting; kinds: findings that count as right, as (kind, channels or None for
    any); also: kinds that follow from the fault and are neither right nor false; wind: needs recorded wind."""

    name: str
    plant: Callable[[Planting], None]
    kinds: Sequence[tuple[str, frozenset[str] | None]]
    wind: bool = False
    size: str = ""
    also: tuple[str, ...] = ()

    def expects(self, kind: str, channels: Sequence[str]) -> bool:
        """Whether a finding is expected for this fault."""
        return any(
            kind == k and (wanted is None or bool(wanted & {c.removesuffix("_c") for c in channels}))
            for k, wanted in self.kinds
        )


def _any(*kinds: str) -> list[tuple[str, frozenset[str] | None]]:
    return [(kind, None) for kind in kinds]


def _of(kind: str, *channels: str) -> list[tuple[str, frozenset[str] | None]]:
    return [(kind, frozenset(channels))]


FAULTS: tuple[Fault, ...] = (
    Fault("heading in degrees", plant.times(psi=DEG), _of("unit", "psi")),
    Fault("heading in degrees, 0 to 360", plant.degrees_wrapped, _of("unit", "psi"), also=("wrapped heading",)),
    Fault("rudder in degrees", plant.times(delta=DEG), _of("unit", "delta")),
    Fault("yaw rate in deg/s", plant.times(r=DEG), _of("unit", "r")),
    Fault("yaw rate in deg/min", plant.times(r=60.0 * DEG), _of("unit", "r")),
    Fault("speeds in knots", plant.times(u=KNOT, v=KNOT), _of("unit", "u", "v")),
    Fault("speeds in km/h", plant.times(u=3.6, v=3.6), _of("unit", "u", "v")),
    Fault("positions in feet", plant.times(x=1.0 / 0.3048, y=1.0 / 0.3048), _of("unit", "x", "y")),
    Fault("revolutions in rev/s", plant.times(n=1.0 / 60.0), _of("unit", "n")),
    Fault("rudder sign", plant.times(delta=-1.0), _of("sign", "delta")),
    Fault("heading sign", plant.times(psi=-1.0), _of("sign", "psi")),
    Fault("yaw rate sign", plant.times(r=-1.0), _of("sign", "r")),
    Fault("sway sign", plant.times(v=-1.0), _of("sign", "v")),
    Fault(
        "rudder in degrees, other sign",
        plant.times(delta=-DEG),
        _of("sign and unit", "delta") + _of("unit and sign", "delta"),
    ),
    Fault("west positive", plant.times(y=-1.0), _of("sign", "y")),
    Fault("x east, y north", plant.swapped, _any("ENU")),
    Fault("ENU, v and r ours", plant.enu(1.0, 1.0), _any("ENU")),
    Fault("ENU, v to port, r to port", plant.enu(-1.0, -1.0), _any("ENU") + _of("sign", "delta")),
    Fault("position reversed", plant.times(x=-1.0, y=-1.0), _any("position reversed")),
    Fault("heading from east", plant.from_east, _any("heading from east")),
    Fault("velocities north, east", plant.earth("u", "v"), _any("earth-fixed velocities")),
    Fault("velocities east, north", plant.earth("v", "u"), _any("earth-fixed velocities")),
    Fault("speeds through water", plant.through_water, _any("through water"), size="current 0.5 m/s"),
    Fault("speeds 8 % high", plant.times(u=1.08, v=1.08), _of("scale", "u", "v")),
    Fault("speeds 5 % low", plant.times(u=0.95, v=0.95), _of("scale", "u", "v")),
    Fault("heading bias", plant.plus(psi=np.deg2rad(3.0)), _any("heading bias"), size="3 deg"),
    Fault("u, v late", plant.late("u", "v", seconds=4.0), _of("lag", "u", "v"), size="4 s"),
    Fault("velocity vector late", plant.vector_late, _of("lag", "u", "v"), size="5 s"),
    Fault("position late", plant.late("x", "y", seconds=3.0), _of("lag", "x", "y"), size="3 s"),
    Fault("antenna off midship", plant.off_midship, _any("off midship"), size="8 m forward, 2 m to starboard"),
    Fault("yaw rate late", plant.late("r", seconds=3.0), _of("lag", "r"), size="3 s"),
    Fault("heading late", plant.late("psi", seconds=3.0), _of("lag", "psi"), size="3 s"),
    Fault("rudder late", plant.late("delta", seconds=5.0), _of("lag", "delta"), size="5 s"),
    Fault("revolutions late", plant.late("n", seconds=8.0), _of("lag", "n"), size="8 s"),
    Fault("rudder order late", plant.late("delta_c", seconds=4.0), _of("lag", "delta"), size="4 s"),
    Fault("engine order late", plant.late("n_c", seconds=4.0), _of("lag", "n"), size="4 s"),
    Fault("motion late", plant.late("x", "y", "psi", "u", "v", "r", seconds=5.0), _of("lag", "r"), size="5 s"),
    Fault("yaw rate bias", plant.plus(r=np.deg2rad(0.05)), _any("yaw rate bias"), size="0.05 deg/s"),
    Fault(
        "yaw rate bias, some runs",
        plant.plus(0.2, r=np.deg2rad(0.1)),
        _any("yaw rate bias"),
        size="0.1 deg/s in a fifth",
    ),
    Fault("yaw rate 10 % high", plant.times(r=1.1), _of("scale", "r")),
    Fault("repeated positions", plant.repeated, _any("repeated samples"), size="5 % of samples"),
    Fault("held fixes", logging.held_fixes, _of("held fixes", "x", "y"), size="one in five samples"),
    Fault(
        "heading placeholder",
        logging.placeholder("psi", np.deg2rad(511.0)),
        _of("placeholder", "psi"),
        size="511 deg, 8 s",
        also=("wrapped heading",),
    ),
    Fault("speed placeholder", logging.placeholder("u", 102.3 / KNOT), _of("placeholder", "u"), size="102.3 kn, 8 s"),
    Fault(
        "heading interpolated",
        logging.interpolated_north,
        _any("interpolated across north"),
        size="from every third sample",
        also=("wrapped heading",),
    ),
    Fault("clock set back", logging.clock_set(6.0), _any("clock step"), size="6 s in a turn", also=("jump",)),
    Fault("clock set ahead", logging.clock_ahead(6.0), _any("clock step"), size="6 s in a gap of 10 s", also=("gap",)),
    Fault("frozen yaw rate", plant.frozen("r"), _of("frozen", "r"), size="15 s"),
    Fault("frozen heading", plant.frozen("psi"), _of("frozen", "psi"), size="15 s"),
    Fault("frozen position", plant.frozen("x", "y"), _of("frozen", "x", "y"), size="15 s", also=("jump",)),
    Fault("frozen surge", plant.frozen("u"), _of("frozen", "u"), size="15 s"),
    Fault("silent log", plant.silent_log(0.3), _any("speed-log dropout"), size="slowest 30 % of samples"),
    Fault("stuck rudder", plant.stuck_rudder, _of("frozen", "delta"), size="25 s"),
    Fault("rudder dead", plant.times(delta=0.0), _of("actuator never moves", "delta"), size="0 throughout"),
    Fault("revolutions dead", plant.times(n=0.0), _of("actuator never moves", "n"), size="0 throughout"),
    Fault("outliers of x", plant.spiked("x", 15.0, 1.0), _of("outliers", "x"), size="15 m"),
    Fault("outliers of heading", plant.spiked("psi", np.deg2rad(8.0), 0.0), _of("outliers", "psi"), size="8 deg"),
    Fault("outliers of surge", plant.spiked("u", 1.5, 0.5), _of("outliers", "u"), size="1.5 m/s"),
    Fault("outliers of yaw rate", plant.spiked("r", np.deg2rad(1.2), -0.5), _of("outliers", "r"), size="1.2 deg/s"),
    Fault("jump of position", plant.jumped("y", 20.0, 1.0), _of("jump", "x", "y"), size="20 m"),
    Fault("jump of heading", plant.jumped("psi", np.deg2rad(10.0), 0.0), _of("jump", "psi"), size="10 deg"),
    Fault("gaps", plant.without_rows, _any("gap"), size="4 samples"),
    Fault("NaN tails", plant.nan("tail"), _any("NaN tail"), size="20 samples"),
    Fault("NaN rows", plant.nan("rows"), _any("missing values"), size="4 samples"),
    Fault("NaN of u, v", plant.nan("channels"), _any("missing values"), size="4 samples"),
    Fault("text among numbers", plant.text, _any("text"), also=("missing values", "NaN tail")),
    Fault("dt wrong", plant.time("dt"), _any("dt"), size="half the steps"),
    Fault("a row twice", plant.time("twice"), _any("time runs back")),
    Fault("uneven time", plant.time("jitter"), _any("uneven time"), size="10 % of dt"),
    Fault("t not from 0", plant.time("late"), _any("late start")),
    Fault("wrapped heading", plant.wrapped, _any("wrapped heading")),
    Fault("coarse rudder", plant.coarse, _any("quantised"), size="0.56 deg"),
    Fault("duplicate run", plant.copied("whole"), _any("duplicate run")),
    Fault("piece of a run", plant.copied("piece"), _any("piece of a run")),
    Fault("overlapping runs", plant.copied("overlap"), _any("overlapping runs"), also=("jump", "wrapped heading")),
    Fault("log cut in two", plant.cut_log, _any("pieces of one log")),
    Fault("commands beside commands", plant.commands, _any("commands"), also=("quantised",)),
    Fault("commands for actuators", plant.commands_only, _any("commands"), also=("quantised",)),
    Fault("wind to", plant.wind_to, _any("wind to"), wind=True, size="12 m/s with gusts of 2 m/s"),
    Fault("wind in degrees", plant.times(wind_from=DEG), _of("unit", "wind_from"), wind=True),
    Fault(
        "wind as felt",
        plant.felt_wind("apparent"),
        _any("wind not true"),
        wind=True,
        size="off the bow, ship's motion in it",
    ),
    Fault(
        "wind as felt, in knots and degrees",
        plant.felt_wind("apparent", KNOT, DEG),
        _any("wind not true"),
        wind=True,
        size="off the bow",
    ),
    Fault(
        "wind as felt, from north",
        plant.felt_wind("apparent-north"),
        _any("wind not true"),
        wind=True,
        size="ship's motion in it",
    ),
    Fault("true wind off the bow", plant.felt_wind("true-bow"), _any("wind not true"), wind=True),
)
