"""Particulars of the vessel as a user knows them (`ship.toml`), and estimates of missing ones.

Units are SI; lengths along the ship are measured from midship, forward positive (a rudder has x < 0).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from .errors import InputError, unknown_name
from .toml_files import Number, Whole, fault, read_toml

_LENGTHS = (1e-3, 1000.0)
"""Range of main dimensions [m] of ships and models; the longest ship has 458 m."""
_LEAST_FULLNESS = 0.1
"""Least block coefficient over the whole breadth; below it a unit is wrong."""
_WITHIN, _DIAMETER, _RUDDER, _GYRATION = 0.6, 2.0, 0.15, (0.1, 0.5)
"""Limits beyond which a unit or an axis is wrong: place over L, propeller over T, rudder over L T (0.1 on yachts and
tugs), radius of gyration over L (0.2 to 0.3)."""
_SPAN, _FRONTAL, _LATERAL, _THRUST = 2.0, 10.0, 1.0, 1.0
"""Limits beyond which a unit is wrong: rudder's span over T (1 at most), wind areas over B^2 (1 to 3) and L^2 (0.05 to
0.2), thruster force over the ship's weight (0.01)."""
_PITCH, _KT = 5.0, 5.0
"""Limits beyond which a value is wrong: pitch ratio (0.5 to 2), and each coefficient of K_T (below 1 in size)."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Propeller(_Part):
    """Fixed-pitch propeller. `kt` are k0, k1, k2 of K_T = k0 + k1 J + k2 J^2."""

    diameter: Number = Field(gt=0)
    x: Number | None = None
    pitch_ratio: Number | None = Field(None, gt=0, le=_PITCH)
    blades: Whole | None = Field(None, ge=2, le=7)
    area_ratio: Number | None = Field(None, gt=0, le=1.5)
    kt: tuple[Number, Number, Number] | None = None
    wake: Number | None = Field(None, ge=0, lt=1)
    thrust_deduction: Number | None = Field(None, ge=0, lt=1)


class Rudder(_Part):
    """Movable rudder area [m^2], span `height` [m], position `x` [m]."""

    area: Number = Field(gt=0)
    height: Number | None = Field(None, gt=0)
    x: Number | None = None


class Thrusters(_Part):
    """Tunnel thrusters: positions [m] and greatest force of each [N]."""

    x_bow: Number = 0.0
    x_stern: Number = 0.0
    max_force: Number = Field(0.0, ge=0)


class Wind(_Part):
    """Areas above water [m^2]."""

    frontal_area: Number = Field(gt=0)
    lateral_area: Number = Field(gt=0)


_TABLES: dict[str, type[_Part]] = {"propeller": Propeller, "rudder": Rudder, "thrusters": Thrusters, "wind": Wind}


class Ship(_Part):
    """Main dimensions [m], displacement [m^3] or mass [kg], and the optional rest of `ship.toml` (docs/formats.md)."""

    name: str
    L: Number = Field(ge=_LENGTHS[0], le=_LENGTHS[1])
    B: Number = Field(ge=_LENGTHS[0], le=_LENGTHS[1])
    T: Number = Field(ge=_LENGTHS[0], le=_LENGTHS[1])
    displacement: Number | None = Field(None, gt=0)
    mass: Number | None = Field(None, gt=0)
    Cb: Number | None = Field(None, gt=0, le=1)
    xG: Number | None = None
    Izz: Number | None = Field(None, gt=0)
    rho: Number = Field(1025.0, ge=900, le=1200)
    propeller: Propeller | None = None
    rudder: Rudder | None = None
    thrusters: Thrusters | None = None
    wind: Wind | None = None

    @model_validator(mode="after")
    def _needs_displacement_or_mass(self) -> Ship:
        if self.displacement is None and self.mass is None:
            raise ValueError("one of 'displacement' [m^3] or 'mass' [kg] is required")
        return self

    @classmethod
    def from_dict(cls, data: dict[str, Any], where: str) -> Ship:
        """Validate `data`; `where` names the source in messages.

        Raises:
            InputError: a required key is missing, a key is unknown, a value is out of range, or together they are of no
                ship (see `complete`).
        """
        try:
            ship = cls.model_validate(data)
            complete(ship)
            return ship
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        except ValidationError as error:
            place, kind, wrong = fault(error)
            if kind == "extra_forbidden":
                *table, name = place
                accepted = _TABLES[table[0]].model_fields if table else cls.model_fields
                raise InputError(
                    f"{where}: {f'[{table[0]}] ' if table else ''}{unknown_name('key', name, accepted)}"
                ) from None
            raise InputError(
                f"{where}: {'.'.join(place) or 'ship'}: {wrong}. Required: name, L, B, T [m], displacement [m^3] or "
                "mass [kg]; "
                "optional: Cb, xG, Izz, rho, [propeller], [rudder], [thrusters], [wind] (SI)."
            ) from None

    @classmethod
    def load(cls, path: str | Path) -> Ship:
        """Read a `ship.toml`.

        Raises:
            InputError: the file is missing, is not TOML, or has a missing, unknown or impossible entry.
        """
        data = read_toml(path)
        data.pop("mmg", None)  # the simulator's own coefficients: never visible to a predictor
        return cls.from_dict(data, str(path))

    def to_toml(self) -> str:
        """The particulars as the text of a `ship.toml`."""
        return tomli_w.dumps(self.model_dump(exclude_none=True))


class Particulars(BaseModel):
    """Ship with all particulars: `complete(ship)` fills in estimates and notes them."""

    model_config = ConfigDict(frozen=True)
    L: float
    B: float
    T: float
    Cb: float
    rho: float
    mass: float
    xG: float
    Izz: float
    D_P: float
    x_P: float
    kt: tuple[float, float, float]
    w_P0: float
    t_P: float
    A_R: float
    H_R: float
    x_R: float
    x_bow: float
    x_stern: float
    F_max: float
    A_F: float
    A_L: float
    notes: tuple[str, ...]

    def resized(self, factor: float) -> Particulars:
        """Geometrically similar ship whose lengths are `factor` times these; thrusters keep their force."""
        powers = dict.fromkeys(("L", "B", "T", "xG", "D_P", "x_P", "H_R", "x_R", "x_bow", "x_stern"), 1)
        powers |= {"A_R": 2, "A_F": 2, "A_L": 2, "mass": 3, "Izz": 5}
        return self.model_copy(update={key: getattr(self, key) * factor**power for key, power in powers.items()})

    def lacks(self, key: str) -> bool:
        """Whether the file did not give `key`, such as "xG" or "propeller.kt", so that an estimate replaces it."""
        return any(note.startswith(f"{key} not given: ") for note in self.notes)


def complete(ship: Ship) -> Particulars:
    """Fill in missing values of `ship` from published regressions and rules of thumb, each named in `notes`.

    Raises:
        InputError: mass, displacement and Cb contradict one another by more than 10 %, no hull is so full or so
            slender, or a part is too large for the ship or outside of her.
    """
    notes: list[str] = []

    def take(value: float | None, estimate: float, what: str, source: str) -> float:
        if value is not None:
            return float(value)
        notes.append(f"{what} not given: {estimate:.4g} from {source}")
        return estimate

    box = ship.L * ship.B * ship.T
    mass = ship.mass if ship.mass is not None else ship.rho * float(ship.displacement or 0.0)
    Cb = take(ship.Cb, mass / (ship.rho * box), "Cb", "mass / (rho L B T)")
    if not _LEAST_FULLNESS < mass / (ship.rho * box) <= 1.1:
        raise InputError(
            f"ship '{ship.name}': mass {mass:.4g} kg, rho {ship.rho:g} kg/m^3 and L B T = {ship.L:g} x {ship.B:g} x "
            f"{ship.T:g} m give a block "
            f"coefficient of {mass / (ship.rho * box):.3g}; hulls have 0.3 to 0.9, catamarans over all "
            f"{_LEAST_FULLNESS:g} at least. Check units "
            "(m, m^3, kg; 1000 t are mass = 1e6)."
        )
    if not 0.9 < mass / (ship.rho * box * Cb) < 1.1:
        raise InputError(
            f"ship '{ship.name}': mass {mass:.4g} kg, rho {ship.rho:g} kg/m^3 and L B T = {box:.4g} m^3 give a "
            "block coefficient of "
            f"{mass / (ship.rho * box):.3f}, the file says {Cb:.3f}; they must agree within 10 %. Check units (kg, "
            "m, m^3)."
        )
    _check_proportions(ship, mass)
    xG = take(ship.xG, 0.0, "xG", "the centre of gravity at midship")
    Izz = take(ship.Izz, mass * (0.25 * ship.L) ** 2, "Izz", "a radius of gyration of 0.25 L")
    prop = ship.propeller or Propeller(diameter=0.6 * ship.T)
    if ship.propeller is None:
        notes.append(f"propeller not given: diameter {prop.diameter:.4g} m from 0.6 T")
    pitch = prop.pitch_ratio or 0.8
    # Line through K_T(0) and the zero-thrust point J ~ 1.05 P/D of the Wageningen B series (Oosterveld & van Oossanen
    # 1975), curvature from the B4-70 fit of Roddy, Hess & Faller (2006).
    k0, k2 = 0.44 * pitch, -0.135
    kt = prop.kt
    if kt is None:
        kt = (k0, -(k0 + k2 * (1.05 * pitch) ** 2) / (1.05 * pitch), k2)
        notes.append(
            f"propeller.kt not given: ({kt[0]:.3f}, {kt[1]:.3f}, {kt[2]:.3f}) from the B series at P/D = {pitch:g}"
        )
    wake = take(prop.wake, max(0.1, 0.5 * Cb - 0.05), "propeller.wake", "Taylor's 0.5 Cb - 0.05")
    t_P = take(prop.thrust_deduction, 0.6 * wake, "propeller.thrust_deduction", "0.6 w")
    rudder = ship.rudder or Rudder(area=ship.L * ship.T / 55.0)
    if ship.rudder is None:
        notes.append(f"rudder not given: area {rudder.area:.4g} m^2 from L T / 55")
    thrusters = ship.thrusters or Thrusters(x_bow=0.4 * ship.L, x_stern=-0.4 * ship.L)
    if ship.thrusters is None:
        notes.append(
            f"thrusters not given: any there are {thrusters.x_bow:.4g} m ahead and astern of midship, from 0.4 L"
        )
    wind = ship.wind or Wind(frontal_area=0.6 * ship.B**2, lateral_area=ship.L * 0.08 * ship.L)
    if ship.wind is None:
        notes.append(
            f"wind areas not given: frontal {wind.frontal_area:.4g} m^2 from 0.6 B^2, lateral "
            f"{wind.lateral_area:.4g} m^2 from 0.08 L^2"
        )
    return Particulars(
        L=ship.L, B=ship.B, T=ship.T, Cb=Cb, rho=ship.rho, mass=mass, xG=xG, Izz=Izz,
        D_P=prop.diameter, x_P=take(prop.x, -0.48 * ship.L, "propeller.x", "-0.48 L"), kt=kt, w_P0=wake, t_P=t_P,
        A_R=rudder.area,
        H_R=take(rudder.height, math.sqrt(1.5 * rudder.area), "rudder.height", "an aspect ratio of 1.5"),
        x_R=take(rudder.x, -0.5 * ship.L, "rudder.x", "-0.5 L"),
        x_bow=thrusters.x_bow, x_stern=thrusters.x_stern, F_max=thrusters.max_force,
        A_F=wind.frontal_area, A_L=wind.lateral_area, notes=tuple(notes),
    )  # fmt: skip


def _check_proportions(ship: Ship, mass: float) -> None:
    """Raise InputError for proportions of no ship, all faults in one message."""
    faults = []
    if not ship.L >= ship.B >= ship.T:
        faults.append(f"L, B, T are {ship.L:g}, {ship.B:g}, {ship.T:g} m; accepted: L >= B >= T")
    propeller, rudder, thrusters = ship.propeller, ship.rudder, ship.thrusters
    places = {
        "xG": ship.xG, "propeller.x": propeller.x if propeller else None, "rudder.x": rudder.x if rudder else None,
        "thrusters.x_bow": thrusters.x_bow if thrusters else None,
        "thrusters.x_stern": thrusters.x_stern if thrusters else None,
    }  # fmt: skip
    for name, x in places.items():
        most = 0.0 if name == "rudder.x" else _WITHIN * ship.L
        if x is not None and not -_WITHIN * ship.L <= x <= most:
            faults.append(
                f"{name} is {x:g} m; accepted: {-_WITHIN * ship.L:.4g} to {most:.4g} (from midship, forward positive)"
            )
    if propeller and propeller.diameter > _DIAMETER * ship.T:
        faults.append(
            f"propeller.diameter is {propeller.diameter:g} m; accepted: up to {_DIAMETER:g} T = "
            f"{_DIAMETER * ship.T:.4g}"
        )
    if propeller and propeller.kt and max(map(abs, propeller.kt)) > _KT:
        faults.append(
            f"propeller.kt is {list(propeller.kt)}; accepted: {-_KT:g} to {_KT:g} each, of K_T = k0 + k1 J + k2 J^2"
        )
    if rudder and rudder.area > _RUDDER * ship.L * ship.T:
        faults.append(
            f"rudder.area is {rudder.area:g} m^2; accepted: up to {_RUDDER:g} L T = {_RUDDER * ship.L * ship.T:.4g}"
        )
    if rudder and rudder.height and rudder.height > _SPAN * ship.T:
        faults.append(f"rudder.height is {rudder.height:g} m; accepted: up to {_SPAN:g} T = {_SPAN * ship.T:.4g}")
    if ship.wind and ship.wind.frontal_area > _FRONTAL * ship.B**2:
        faults.append(
            f"wind.frontal_area is {ship.wind.frontal_area:g} m^2; accepted: up to {_FRONTAL:g} B^2 = "
            f"{_FRONTAL * ship.B**2:.4g}"
        )
    if ship.wind and ship.wind.lateral_area > _LATERAL * ship.L**2:
        faults.append(
            f"wind.lateral_area is {ship.wind.lateral_area:g} m^2; accepted: up to {_LATERAL:g} L^2 = "
            f"{_LATERAL * ship.L**2:.4g}"
        )
    if thrusters and thrusters.max_force > _THRUST * mass * 9.81:
        faults.append(
            f"thrusters.max_force is {thrusters.max_force:g} N; accepted: up to the weight of the ship, "
            f"{mass * 9.81:.4g}"
        )
    low, high = (mass * (k * ship.L) ** 2 for k in _GYRATION)
    if ship.Izz is not None and not low <= ship.Izz <= high:
        faults.append(
            f"Izz is {ship.Izz:.4g} kg m^2; accepted: {low:.3g} to {high:.3g}, radii of gyration of "
            f"{_GYRATION[0]:g} to {_GYRATION[1]:g} L"
        )
    if faults:
        raise InputError(
            f"ship '{ship.name}': {'; '.join(faults)}. Check units and axes (m, m^2, kg m^2; lengths from midship)."
        )
