"""How cost grows: rollouts with the number of runs and with the horizon, the fit with the number of runs, the diagnosis
with its candidates.

    python benchmarks/scaling.py [--runs N] [--quick] [--json FILE]

Prints a table and writes `benchmarks/scaling.png` (`--quick` writes nothing). Times are processor seconds of this
process, the smallest of N repeats, so that other work on the machine hardly shows; set OMP_NUM_THREADS=1, or they add
up over threads. What bends the curves is explained in `benchmarks/README.md`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import measure
import numpy as np

from shipbench.data.base import load_dataset
from shipbench.diagnosis.diagnose import diagnose
from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.predictors.physics import Physics
from shipbench.records import Dataset, Run
from shipbench.simulate.simulator import Simulator

PICTURE = Path(__file__).with_name("scaling.png")
NOT_CANDIDATES = ("unit_or_sign_error", "change_point")


@dataclass
class Curve:
    """Seconds against size."""

    panel: str
    axis: str
    label: str
    sizes: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(self, size: int, call: Callable[[], Any], repeats: int) -> None:
        """The smallest of `repeats` times; one alone is long enough not to need a first call that does not count."""
        if repeats > 1:
            call()
        self.sizes.append(size)
        self.seconds.append(min(processor_seconds(call) for _ in range(repeats)))


def processor_seconds(call: Callable[[], Any]) -> float:
    """Of one call, in all threads of this process."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def repeated(data: Dataset, number: int) -> Dataset:
    """`number` runs, those of `data` over and over."""
    runs = (data.runs[i % len(data)] for i in range(number))
    return data.with_runs(tuple(Run(f"run{i}", r.t, r.states, r.inputs) for i, r in enumerate(runs)))


def rollouts(data: Dataset, model: Physics, sizes: Sequence[int], repeats: int) -> list[Curve]:
    """120 s of 1 to 10,000 runs."""
    batch, sim = data.batch(), Simulator(load_mmg_ship("container130"), 1.0)
    panel = ("rollouts of 120 s", "runs")
    physics, fast, plain = (
        Curve(*panel, "physics.predict"),
        Curve(*panel, "Simulator.fast_rollout"),
        Curve(*panel, "Simulator.rollout (numpy)"),
    )
    for size in sizes:
        rows = np.arange(size) % len(data)
        s0, U = batch.s0[rows], batch.U[rows]
        physics.add(size, lambda s0=s0, U=U: model.predict(s0, U), repeats)
        fast.add(size, lambda s0=s0, U=U: sim.fast_rollout(s0, U, 1.0), repeats)
        if size <= 1000:
            plain.add(size, lambda s0=s0, U=U: sim.rollout(s0, U, 1.0), repeats)
    return [physics, fast, plain]


def horizons(data: Dataset, model: Physics, sizes: Sequence[int], batches: Sequence[int], repeats: int) -> list[Curve]:
    """10 s to 3,000 s; the commands of each run are repeated."""
    batch, curves = data.batch(), []
    for number in batches:
        curve = Curve("physics.predict", "horizon [s]", f"{number} run{'s' * (number > 1)}")
        rows = np.arange(number) % len(data)
        for size in sizes:
            U = np.tile(batch.U[rows], (1, -(-size // batch.U.shape[1]), 1))[:, :size]
            curve.add(size, lambda U=U, rows=rows: model.predict(batch.s0[rows], U), repeats)
        curves.append(curve)
    return curves


def fits(data: Dataset, sizes: Sequence[int], repeats: int) -> list[Curve]:
    """The fit of 11 parameters to 10 to 10,000 runs of 120 s."""
    curve = Curve("fit of 11 parameters", "runs of 120 s", "Physics().fit")
    for size in sizes:
        train = repeated(data, size)
        curve.add(size, lambda train=train: Physics().fit(train), repeats if size <= 100 else 1)
    return [curve]


def diagnoses(data: Dataset, sizes: Sequence[int]) -> list[Curve]:
    """24 runs, the first effects of the library by name as candidates; without the held-out gain, which repeats it for
    every fold."""
    curve, names = Curve("diagnosis of 24 runs", "candidates", "diagnose(data, only=..., gain=False)"), EFFECTS.names()
    names = [name for name in names if name not in NOT_CANDIDATES]
    for size in sizes:
        curve.add(
            min(size, len(names)), lambda size=size: diagnose(data.subset(range(24)), gain=False, only=names[:size]), 1
        )
    return [curve]


def draw(curves: list[Curve], picture: Path) -> None:
    """One panel a question, time over size, both logarithmic."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    panels = list(dict.fromkeys(c.panel for c in curves))
    figure, axes = plt.subplots(1, len(panels), figsize=(4.0 * len(panels), 3.6), layout="constrained")
    for axis, panel in zip(axes, panels, strict=True):
        for curve in (c for c in curves if c.panel == panel):
            axis.loglog(curve.sizes, curve.seconds, "o-", label=curve.label)
            axis.set_xlabel(curve.axis)
        axis.set_title(panel)
        axis.set_ylabel("processor seconds")
        axis.grid(True, which="both", alpha=0.2)
        axis.legend(fontsize="small")
    figure.savefig(picture, dpi=110)
    print(f"Written: benchmarks/{picture.name}")


def main() -> None:
    """Measure everything, print the table, draw it."""
    given = measure.options(__doc__, runs=5)
    measure.header(given, "matplotlib")
    data = load_dataset("harbour90")
    model, quick = Physics().fit(data.subset(range(72))), given.quick
    curves: list[Curve] = []
    for question in (
        lambda: rollouts(
            data, model, (1, 9) if quick else (1, 2, 4, 8, 16, 32, 100, 316, 1000, 3162, 10000), given.runs
        ),
        lambda: horizons(
            data,
            model,
            (10, 130) if quick else (10, 30, 100, 300, 1000, 3000),
            (1, 3) if quick else (1, 100, 1000),
            given.runs,
        ),
        lambda: fits(data, (4, 8) if quick else (10, 32, 100, 316, 1000, 3162, 10000), given.runs),
        lambda: diagnoses(data, (1,) if quick else (1, 2, 5, 10, 20, 100)),
    ):
        for curve in question():
            curves.append(curve)
            print(
                f"\n{curve.panel}: {curve.label}\n  {curve.axis:>14s} {'seconds':>12s} {'microseconds each':>18s}",
                flush=True,
            )
            for size, seconds in zip(curve.sizes, curve.seconds, strict=True):
                print(f"  {size:14d} {seconds:12.6f} {1e6 * seconds / size:18.2f}", flush=True)
            measure.record(given, vars(curve))
    if not quick:
        draw(curves, PICTURE)


if __name__ == "__main__":
    main()
