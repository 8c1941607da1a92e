"""Calibration of an FMU (10 parameters, 20 runs of 120 s) beside FMPy in a plain loop with scipy.

    python benchmarks/fmu_calibration.py [--runs N] [--quick] [--json FILE]

The FMU is that of the tests (tests/made_fmu.c, FMI 2, co-simulation, compiled here with gcc). The runs are simulated
with known parameters; white noise of 1 m lies on the recorded positions. Both sides begin with the same wrong values.
They minimise the same residuals of x, y, psi, u, v, r within the same bounds to the same tolerance (1e-7).

- FMPy: `simulate_fmu(folder, ...)` a run, with the FMU extracted and its model description read once, under
  `scipy.optimize.least_squares(method="trf", jac="2-point")`. Each call makes an instance of the FMU.
- FMPy, one instance: the same with `fmu_instance=`, reset by the loop before every call. Shown without a target.
- shipbench: `make_predictor("ship.fmu[fit=[...]]").fit(data)`, all of it: processes, check of the reset, extraction.

Checked: the costs at both optima differ by less than 0.1 %.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import measure
import numpy as np
from fmpy.fmi2 import FMU2Slave
from measure import Side
from scipy.optimize import least_squares

sys.path.append(str(Path(__file__).parent.parent / "tests"))
import made_fmu

from shipbench.predictors.base import make_predictor
from shipbench.predictors.fmu_model.calibration import typical_sizes
from shipbench.records import Dataset
from shipbench.signals import MOTION, PSI, wrap_angle

OUTPUTS = ("x", "y", "psi", "u", "v", "r")


def wrong_values() -> dict[str, float]:
    """Values of the ten parameters at the start: 0.5 to 1.8 times the true ones."""
    rng = np.random.default_rng(1)
    return {name: made_fmu.TRUE[name] * float(rng.uniform(0.5, 1.8)) for name in made_fmu.TEN}


def plain_fit(path: Path, data: Dataset, bounds: np.ndarray, reuse: bool) -> np.ndarray:
    """Ten parameters by FMPy and scipy."""
    description, folder = fmpy.read_model_description(str(path)), fmpy.extract(str(path))
    batch = data.batch()
    start, scale = np.array(list(wrong_values().values())), typical_sizes(batch.s0, batch.truth)
    low, high = bounds
    inputs = []
    for U in batch.U:
        rows = [(float(k), *u[:2]) for k, u in enumerate(U)]
        inputs.append(np.array(rows, dtype=[("time", float), ("n_c", float), ("delta_c", float)]))
    instance = None
    if reuse:
        instance = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier="ship", instanceName="ship")
        instance.instantiate()

    def simulated(run: int, p: np.ndarray) -> np.ndarray:
        values = dict(zip(made_fmu.TEN, p, strict=True)) | dict(
            zip(made_fmu.STATES, batch.s0[run, : len(made_fmu.STATES)], strict=True)
        )
        if instance is not None:
            instance.reset()
        found = fmpy.simulate_fmu(
            folder, model_description=description, fmi_type="CoSimulation", start_values=values, input=inputs[run],
            output=OUTPUTS, output_interval=1.0, stop_time=float(len(batch.U[run])), fmu_instance=instance,
        )  # fmt: skip
        return np.stack([found[name][1:] for name in OUTPUTS], axis=1)

    def residuals(z: np.ndarray) -> np.ndarray:
        p = low + z * (high - low)
        error = np.stack([simulated(i, p) for i in range(len(batch.s0))]) - batch.truth[..., MOTION]
        error[..., PSI] = wrap_angle(error[..., PSI])
        return (error / scale).ravel()

    found = least_squares(
        residuals, (start - low) / (high - low), bounds=(0.0, 1.0), method="trf", jac="2-point", diff_step=1e-4,
        ftol=1e-7, xtol=1e-7, gtol=1e-10,
    )  # fmt: skip
    print(f"  FMPy{', one instance' if reuse else ''}: {found.nfev} steps, {found.njev} Jacobians; {found.message}")
    return low + found.x * (high - low)


def cost(path: Path, data: Dataset, values: np.ndarray) -> float:
    """Sum of squares of the residuals at `values`, by shipbench's rollouts."""
    model = make_predictor(str(path) + f"[fit=[{','.join(made_fmu.TEN)}]]")
    model.dt, model.inputs, model.values = data.dt, data.inputs, values
    batch = data.batch()
    error = (model.predict(batch.s0, batch.U) - batch.truth)[..., MOTION]
    error[..., PSI] = wrap_angle(error[..., PSI])
    return float(np.sum((error / typical_sizes(batch.s0, batch.truth)) ** 2))


def main() -> None:
    """Calibrate on both sides, compare the costs, print the ratio."""
    given = measure.options(__doc__, runs=1)
    measure.header(given, "fmpy")
    data = made_fmu.sail_fmu(*((4, 40) if given.quick else (20, 120)), noise=1.0)
    with tempfile.TemporaryDirectory() as name:
        folder, wrong = Path(name), wrong_values()
        files: dict[str, str | bytes] = {
            "modelDescription.xml": made_fmu.description(2, values=wrong),
            **made_fmu.members(made_fmu.library(folder, 2), 2),
        }
        path = made_fmu.write_archive(folder / "ship.fmu", files)
        bounds = np.array([sorted((wrong[n] / 3.0, wrong[n] * 3.0)) for n in made_fmu.TEN]).T
        spec = f"{path}[fit=[{','.join(made_fmu.TEN)}]]"
        ours, peers = list[Any](), list[np.ndarray]()

        def plain(reuse: bool) -> Callable[[], None]:
            return lambda: peers.append(plain_fit(path, data, bounds, reuse))

        side = Side(
            "make_predictor('ship.fmu[fit=[...]]').fit(data)", lambda: ours.append(make_predictor(spec).fit(data))
        )
        title = f"calibration of 10 parameters on {len(data)} runs of {len(data[0]) - 1} s"
        peer = Side("least_squares over simulate_fmu(folder, ...), a run at a time", plain(False))
        result = measure.compare(title, side, peer, given, target=5, warm=False)
        peer = Side("the same with fmu_instance=..., reset in the loop", plain(True))
        measure.compare(f"{title}, one instance", side, peer, given, warm=False)
        if not given.quick:
            print(f"  under 60 s: {'reached' if result.ours_s < 60.0 else 'NOT reached'} ({result.ours_s:.1f} s)")
        print(f"  ours: {ours[-1].result.simulated} rollouts, those of the short windows included")
        here, there = cost(path, data, ours[-1].values), cost(path, data, peers[0])
        print(f"cost at our values {here:.6f}, at those of FMPy and scipy {there:.6f}")
        measure.agree("cost, relative", abs(here - there) / here, 1e-3)


if __name__ == "__main__":
    main()
