"""What stacking saves: five folds trained together beside one alone, in seconds a fold, for the same number of epochs.

    python benchmarks/stacked_training.py [--runs 5] [--quick] [--json FILE]

The peer is the same predictor, fitted to one fold at a time (another in each run). Early stopping is off, so that both
do the same number of steps a fold. Both sides give the same model up to rounding; what training makes of rounding is
printed as the difference of the mean position errors.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import measure
import numpy as np

from shipbench.data.base import load_dataset
from shipbench.predictors.base import make_predictor, parse_spec
from shipbench.records import Dataset
from shipbench.signals import X, Y

SPECS = {"mlp": "mlp[epochs={0},patience=1000]", "lstm": "lstm[epochs={0}]", "neural_ode": "neural_ode[epochs={0}]"}
EPOCHS = {"mlp": 30, "lstm": 20, "neural_ode": 10}
TARGET, ACCEPTED = 2.5, 0.2
"""Five folds together take less than two alone; accepted relative difference of the errors."""


def folds(data: Dataset, number: int = 5, valid: int = 8) -> list[tuple[Dataset, Dataset]]:
    """Training and validation runs of each fold."""
    parts = np.array_split(np.random.default_rng(0).permutation(len(data)), number)
    rest = [np.concatenate([p for j, p in enumerate(parts) if j != i]) for i in range(number)]
    return [(data.subset(r[valid:]), data.subset(r[:valid])) for r in rest]


def fit(spec: str, pairs: list[tuple[Dataset, Dataset]]) -> list[Any]:
    """Models of all `pairs`, trained together."""
    models = [make_predictor(parse_spec(spec)) for _ in pairs]
    type(models[0]).fit_group(models, [t for t, _ in pairs], [v for _, v in pairs], [0] * len(pairs))
    return models


def position_error(model: Any, data: Dataset) -> float:
    """Mean over runs and time [m]."""
    batch = data.batch()
    apart = (model.predict(batch.s0, batch.U) - batch.truth)[..., [X, Y]]
    return float(np.linalg.norm(apart, axis=-1).mean())


def sides(
    spec: str, pairs: list[tuple[Dataset, Dataset]]
) -> tuple[Callable[[], None], Callable[[], None], list[Any], list[Any]]:
    """Both sides' calls, and where they leave their models."""
    together: list[Any] = []
    alone: list[Any] = []

    def ours() -> None:
        together[:] = fit(spec, pairs)

    def peer() -> None:
        alone.extend(fit(spec, [pairs[len(alone) % len(pairs)]]))

    return ours, peer, together, alone


def main() -> None:
    """Every predictor that is stacked."""
    given = measure.options(__doc__)
    measure.header(given, "lightning")
    pairs = folds(load_dataset("harbour90"))
    fit("mlp[epochs=1]", pairs[:1])  # imports and first-call costs
    for name, text in SPECS.items():
        spec = text.format(1 if given.quick else EPOCHS[name])
        ours, peer, together, alone = sides(spec, pairs)
        measure.compare(
            f"{spec}, seconds a fold",
            measure.Side(f"fit_group of {len(pairs)} folds", ours, calls=len(pairs)),
            measure.Side("fit of one fold", peer),
            given,
            target=TARGET,
            warm=False,
        )
        errors = [
            [position_error(m, valid) for m, (_, valid) in zip(side, pairs, strict=False)]
            for side in (together[: len(alone)], alone)
        ]
        apart = abs(np.mean(errors[0]) / np.mean(errors[1]) - 1.0)
        measure.agree(
            f"relative position error, {len(errors[1])} folds, {np.mean(errors[1]):.2f} m", float(apart), ACCEPTED
        )


if __name__ == "__main__":
    main()
