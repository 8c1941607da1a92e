"""Share of held-out measurements inside the 90 % bands of `calibrated`, by horizon.

    python benchmarks/band_coverage.py harbour90_noisy 120
    python benchmarks/band_coverage.py 'esso_osaka[path=FOLDER]' 100

The published split where there is one, else every second run is held out. Position counts north and east apart.
"""

from __future__ import annotations

import sys

import numpy as np

from shipbench.data.base import load_dataset
from shipbench.predictors.calibrated import Calibrated
from shipbench.signals import PSI

HORIZONS = (10.0, 30.0, 60.0, 120.0)


def main(spec: str, seconds: float) -> None:
    data = load_dataset(spec)
    published = {r.meta.split for r in data.runs} >= {"train", "test"}
    held = [r.meta.split == "test" if published else i % 2 == 0 for i, r in enumerate(data.runs)]
    train = [r for r, out in zip(data.runs, held, strict=True) if not out]
    test = data.with_runs([r for r, out in zip(data.runs, held, strict=True) if out])
    model = Calibrated().fit(data.with_runs([r for i, r in enumerate(train) if i % 9]), data.with_runs(train[::9]))
    batch = test.windows(round(seconds / data.dt)).batch()
    low, high = np.nanquantile(model.predict_samples(batch.s0, batch.U), [0.05, 0.95], axis=0)
    inside = (batch.truth[..., :6] >= low) & (batch.truth[..., :6] <= high)
    print(f"{data.name}: {len(batch.s0)} windows")
    for horizon in HORIZONS:
        if (k := round(horizon / data.dt) - 1) < inside.shape[1]:
            position, heading = inside[:, k, :2].mean(), inside[:, k, PSI].mean()
            print(f"{horizon:4.0f} s: position {position:.2f}, heading {heading:.2f}")


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
