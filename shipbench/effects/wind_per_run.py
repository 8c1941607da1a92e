"""A mean wind that is not measured and differs from run to run."""

from __future__ import annotations

from .traits import Traits
from .wind import Wind


class WindPerRun(Wind):
    summary = "mean wind, another one in each run"
    phrase = "a wind that differs from run to run"
    source = "Blendermann (1994), J. Wind Eng. Ind. Aerodyn. 51: as wind, one for each run"
    traits = Traits(
        least_size=0.15,
        group="wind and waves",
        by_coefficients=True,
        relies_on=("wind_X", "wind_Y", "wind_N", "wind_lever"),
    )
    per_run = True
    separate = "an anemometer, or reciprocal courses within one run"


EFFECT = WindPerRun()
