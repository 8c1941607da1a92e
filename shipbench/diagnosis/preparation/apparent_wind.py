"""Wind channels that hold apparent wind: an instrument on board also measures the ship's own motion. Read as true wind,
it is confounded with a current, added resistance in waves or another ship's superstructure."""

from __future__ import annotations

from ...checking.recording import Recording
from ...checking.wind import blows_to
from ...checking.wind_reading import CHANNELS, WindReading, said, wind_reading
from .base import Prepared

_ADVICE = "`shipbench data check` has the lines for dataset.toml."


def true_wind(prepared: Prepared) -> Prepared:
    """Put the true wind into its channels where they hold another one."""
    dataset = prepared.dataset
    recorded = [name for name in CHANNELS if name in dataset.inputs]
    if len(recorded) == 1:
        alone = (
            f"{recorded[0]} is recorded alone: without both {' and '.join(CHANNELS)} the wind counts as not measured."
        )
        return prepared.corrected(dataset, alone)
    if not recorded:
        return prepared
    lines = []
    found = wind_reading(Recording(dataset))
    if found is not None:
        dataset = found[0].applied(dataset)
        lines.append(f"wind_speed and wind_from are {said(found[0])}: they are converted to true wind. {_ADVICE}")
    if blows_to(Recording(dataset)) is not None:
        dataset = WindReading(sign="to").applied(dataset)
        lines.append(f"wind_from is where the wind blows to: it is reversed. {_ADVICE}")
    return prepared.corrected(dataset, *lines)
