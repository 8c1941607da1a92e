"""Facts that an effect states about ships and about confounded effects: all differences between effects that a
diagnosis uses."""

from __future__ import annotations

from dataclasses import dataclass

SEARCHES = {
    "screening": "forward selection beside the plain model",
    "hull": "evidence of a wider prior of the hull's coefficients",
    "change": "another effect that begins with a run",
    "units": "kinematics of the record",
    "record": "record of the actuator against its commands",
    "never": "none: it is fitted only where a model names it",
}
"""Ways in which a diagnosis looks for an effect."""
NEGLIGIBLE = 0.05
"""Least size of a practically significant effect, in typical sizes. With enough samples the form of a hull makes tiny
causes certain."""


@dataclass(frozen=True)
class Traits:
    """Facts about an effect; the defaults are those of an effect that is confounded with no other and that ships do not
    differ in.

    Attributes:
        search: method of the search for it, a key of `SEARCHES`. A limit has no slope where it does not act: the record
            shows it alone.
        describes_data: it is a fault of the data, or of their order, and no part of a predictor: the data are
            corrected, or split.
        wraps: it takes another effect (`Effect.of`), whose values are its own.
        local: it depends on the place or on the time within a run, which a model of accelerations is not given.
        between_ships: ordinary ships differ in it, so that it is confounded with errors of the hull's form: it needs
            more evidence.
        absorbs_misfit: it is confounded with such errors most often: it needs more evidence again.
        persistent: hull, rudder and propeller keep their shape during trials, a bank its place: it does not begin with
            a run.
        least_size: size from which it is practically significant, in typical sizes.
        least_unrecorded: the same behind the record of an actuator, where the motion alone shows it.
        aliases: effects with which it is reported as confounded, however far apart their scores are. One of two
            effects states it, and it holds for both (`aliases_of`).
        group: effects of one group occur together and have similar forces: beside one of them the others are not
            reported.
        imitates: effects whose own law leaves a residual like this one along their normal (`Effect.normal`): there it
            is rejected.
        by_coefficients: a force that breaks a symmetry, but shows by the ship's coefficients alone.
        relies_on: coefficients of the ship (`between_ships`) by which it is judged: beyond those of all ships it is
            rejected.
        faults_of: channels of whose sensors it is an error.
        gear_field: value of the actuator dynamics that it changes: T, rate, delay, deadband or backlash.
        in_place_of: parameters p of eq. (2) to (8), by number, that stay zero where it is fitted: they are confounded.
        in_place_beside_hull: the same where the hull's derivatives are free, too.
        on_card: a data card says whether the runs tell it apart from the other causes.
        ordinary: mean and standard deviation of its first value between the ordinary ships that are simulated with the
            fitted model.
    """

    search: str = "screening"
    describes_data: bool = False
    wraps: bool = False
    local: bool = False
    between_ships: bool = False
    absorbs_misfit: bool = False
    persistent: bool = False
    least_size: float = NEGLIGIBLE
    least_unrecorded: float = 0.0
    aliases: tuple[str, ...] = ()
    group: str = ""
    imitates: tuple[str, ...] = ()
    by_coefficients: bool = False
    relies_on: tuple[str, ...] = ()
    faults_of: frozenset[str] = frozenset()
    gear_field: str = ""
    in_place_of: tuple[int, ...] = ()
    in_place_beside_hull: tuple[int, ...] = ()
    on_card: bool = False
    ordinary: tuple[float, ...] = ()
