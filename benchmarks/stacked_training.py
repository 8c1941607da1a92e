"""What stacking saves: time to train five folds together against one fold, for the same number of epochs.

    python benchmarks/stacked_training.py [mlp] [lstm] [neural_ode]

Prints seconds and the ratio, which must stay below 2. Early stopping is off, so that both do the same number of steps per fold.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from shipbench.data.harbour90 import make
from shipbench.predictors.base import make_predictor, parse_spec
from shipbench.records import Dataset

SPECS = {"mlp": "mlp[epochs=30,patience=1000]", "lstm": "lstm[epochs=40]", "neural_ode": "neural_ode[epochs=20]"}


def folds(data: Dataset, number: int = 5, valid: int = 8) -> list[tuple[Dataset, Dataset]]:
    """Training and validation runs of each fold."""
    parts = np.array_split(np.random.default_rng(0).permutation(len(data)), number)
    rest = [np.concatenate([p for j, p in enumerate(parts) if j != i]) for i in range(number)]
    return [(data.subset(r[valid:]), data.subset(r[:valid])) for r in rest]


def seconds(spec: str, pairs: list[tuple[Dataset, Dataset]]) -> float:
    """Wall time of one stacked fit."""
    models = [make_predictor(parse_spec(spec)) for _ in pairs]
    begin = time.perf_counter()
    type(models[0]).fit_group(models, [t for t, _ in pairs], [v for _, v in pairs], [0] * len(pairs))
    return time.perf_counter() - begin


def main() -> None:
    """Time the predictors named on the command line."""
    pairs = folds(make())
    seconds("mlp[epochs=1]", pairs[:1])  # imports and first-call costs
    for name in sys.argv[1:] or SPECS:
        one = min(seconds(SPECS[name], pairs[:1]) for _ in range(2))
        five = min(seconds(SPECS[name], pairs) for _ in range(2))
        print(f"{SPECS[name]:32s} one fold {one:6.2f} s   five folds {five:6.2f} s   ratio {five / one:.2f}")


if __name__ == "__main__":
    main()
