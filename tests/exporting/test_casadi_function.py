"""The serialised function."""

from __future__ import annotations

import casadi as ca
import numpy as np
from exporting_cases import GEARS, largest

from shipbench.exporting import casadi_function
from shipbench.exporting.step import TOLERANCE, step_of


def test_both_functions_come_back_and_give_the_prediction(made, tmp_path):
    step, path = step_of(made(f"physics+{GEARS}", wind=True)), tmp_path / "ship.casadi"
    casadi_function.write(step, "ship", path)
    loaded = ca.Function.load(str(path))
    assert (loaded.name(), loaded.name_in(), loaded.name_out()) == ("step", ["z", "u", "h"], ["z_next", "s"])
    file = ca.FileDeserializer(str(path))
    moved, start = file.unpack(), file.unpack()
    found = step.reference
    z, S = start(found.s0, found.U[0]), []
    for u in found.U:
        out = moved(z=z, u=u, h=step.model.dt)
        z = out["z_next"]
        S.append(np.asarray(out["s"]).ravel())
    assert largest(np.array(S), found.S) < TOLERANCE
    assert [p.name for p in tmp_path.iterdir()] == ["ship.casadi"]
