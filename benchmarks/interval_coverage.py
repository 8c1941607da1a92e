"""How often the leaderboard's intervals hold the truth and its paired test rejects models that are equally good.

Errors are drawn for runs (clusters) with some windows each: a part that the windows of a run share and a part of their
own, standard deviation 0.7 each, as they are (normal) or exponentiated (lognormal, skewed as errors are).

    python benchmarks/interval_coverage.py  # 5 s
"""

from __future__ import annotations

import numpy as np

from shipbench.leaderboard.statistics import Bootstrap, interval

REPEATS, RESAMPLES, SIGMA = 1000, 999, 0.7


def shares(rng: np.random.Generator, runs: int, windows: int, lognormal: bool) -> tuple[float, float]:
    """Share of the intervals that hold the true mean, and of the tests with p < 0.05 where there is no difference."""
    boot = Bootstrap([f"{i:03d}" for i in range(runs)], RESAMPLES)
    codes, ones = np.repeat(np.arange(runs), windows), np.ones((runs * windows, 1))
    truth = float(np.exp(SIGMA**2)) if lognormal else 0.0

    def drawn() -> np.ndarray:
        z = SIGMA * (np.repeat(rng.standard_normal(runs), windows) + rng.standard_normal(runs * windows))
        return np.exp(z) if lognormal else z

    covered = rejected = 0
    for _ in range(REPEATS):
        low, high = interval(boot.means(codes, drawn()[:, None], ones)[:, 0], runs)
        covered += low <= truth <= high
        totals = boot.totals(codes, np.stack([drawn() - drawn(), ones[:, 0]], axis=1))
        rejected += boot.p_value(totals[:, 0], totals[:, 1]) < 0.05
    return covered / REPEATS, rejected / REPEATS


if __name__ == "__main__":
    rng = np.random.default_rng(1)
    print("runs  windows  errors     interval holds the truth  equal models rejected at 5 %")
    for runs in (6, 20, 90):
        for windows in (1, 3):
            for lognormal in (False, True):
                covered, rejected = shares(rng, runs, windows, lognormal)
                print(
                    f"{runs:4d}  {windows:7d}  {'lognormal' if lognormal else 'normal':9s}  {100 * covered:22.1f} % "
                    f" {100 * rejected:26.1f} %"
                )
