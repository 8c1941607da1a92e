"""Rule whether an effect can act on the data at all, the same for all effects, by their own attributes."""

from __future__ import annotations

from ...effects.base import Effect
from ...estimation.forward import Plant

_PARTS = {"delta": "rudder never moves", "n": "shaft never turns", "F_b": "thrusters are not used"}


def why_not(effect: Effect, plant: Plant) -> str:
    """Reason why an effect cannot be a cause in these data, "" where it can: an input that it needs is not measured,
    the model has it already, or no actuator works through which it acts."""
    if set(effect.channels) - plant.inputs:
        return f"{' and '.join(effect.channels)} are not measured"
    if known := [name for name in effect.known_with if name in plant.inputs]:
        return f"the {known[0].removesuffix('_speed')} is measured and in the model already"
    if effect.acts_through and not plant.seg.working.intersection(effect.acts_through):
        return f"the {_PARTS[effect.acts_through[0]]} in these runs"
    return ""
