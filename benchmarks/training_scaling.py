"""How the cost of training grows with runs, epochs, batch size and folds.

    python benchmarks/training_scaling.py [--runs N] [--quick] [--json FILE]

Prints a table and writes `benchmarks/training_scaling.png` (`--quick` writes nothing). Every time is the smallest of N
repeats of a whole fit: a busy machine only adds. What bends the curves is explained in `benchmarks/README.md`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import measure
from scaling import Curve, draw, repeated
from stacked_training import SPECS, fit

from shipbench.data.base import load_dataset
from shipbench.records import Dataset

PICTURE = Path(__file__).with_name("training_scaling.png")
EPOCHS = {"mlp": 3, "lstm": 4, "neural_ode": 4}


def swept(
    panel: str, axis: str, label: str, cases: Iterable[tuple[int, str, list[tuple[Dataset, Dataset]]]], repeats: int
) -> Curve:
    """A fit for every (size, spec, folds)."""
    curve = Curve(panel, axis, label)
    for size, spec, pairs in cases:
        curve.add(size, lambda spec=spec, pairs=pairs: fit(spec, pairs), repeats)
    return curve


def curves(data: Dataset, quick: bool, repeats: int) -> Iterator[Curve]:
    """All questions, in the order of the panels; eight runs validate."""
    pair = data.subset(range(8, 72)), data.subset(range(8))
    valid = pair[1]
    specs = {name: spec.format(1 if quick else EPOCHS[name]) for name, spec in SPECS.items()}
    fit("mlp[epochs=1]", [pair])  # imports and first-call costs
    for name, spec in specs.items():
        sizes = (8, 16) if quick else (10, 32, 100, 316, 1000)
        yield swept(
            "one fold",
            "training runs of 120 s",
            spec,
            ((n, spec, [(repeated(data, n), valid)]) for n in sizes),
            1 if name != "mlp" else repeats,
        )
    for spec in ("mlp[epochs={},patience=1000]", "lstm[epochs={}]"):
        cases = ((n, spec.format(n), [pair]) for n in ((1, 2) if quick else (1, 3, 10, 30)))
        yield swept("one fold, 64 runs", "epochs", spec.partition("[")[0], cases, repeats)
    cases = (
        (n, f"mlp[epochs=2,patience=1000,batch={n}]", [pair])
        for n in ((32, 64) if quick else (8, 16, 32, 64, 128, 512, 2048))
    )
    yield swept("one fold, 64 runs, two epochs", "batch size", "mlp", cases, repeats)
    for spec in specs.values():
        cases = ((n, spec, [pair] * n) for n in ((1, 2) if quick else (1, 2, 5, 10, 20)))
        yield swept("folds and seeds together", "folds", spec, cases, repeats)


def main() -> None:
    """Measure everything, print the table, draw it."""
    given = measure.options(__doc__, runs=2)
    measure.header(given, "lightning", "matplotlib")
    data, found = load_dataset("harbour90"), list[Any]()
    for curve in curves(data, given.quick, given.runs):
        found.append(curve)
        print(f"\n{curve.panel}: {curve.label}\n  {curve.axis:>22s} {'seconds':>10s} {'milliseconds each':>18s}")
        for size, seconds in zip(curve.sizes, curve.seconds, strict=True):
            print(f"  {size:22d} {seconds:10.3f} {1e3 * seconds / size:18.2f}", flush=True)
        measure.record(given, vars(curve))
    if not given.quick:
        draw(found, PICTURE)


if __name__ == "__main__":
    main()
