"""CasADi: the step as a serialised function, for optimal control and estimation."""

from __future__ import annotations

from pathlib import Path

import casadi as ca

from ..storage import in_one_step
from .step import Step


def write(step: Step, name: str, path: Path) -> None:
    """Write the functions `step` and `start` to one file.

    `casadi.Function.load(path)` returns the first, (z, u, h) -> (z_next, s). `casadi.FileDeserializer(path)` unpacks
    both; `start` is (s0, u) -> z.
    """
    with in_one_step(path, suffix=".casadi") as part:
        file = ca.FileSerializer(str(part))
        file.pack(step.step)
        file.pack(step.start)
        del file  # closes it
