"""A small ship with a closed formula, in memory (`toy`) and as a folder in the contract's format (`toy_folder`)."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipbench.records import Dataset, Run
from shipbench.ship import Ship
from shipbench.signals import COMMANDS, STATES

TOY_SHIP = Ship(name="toy", L=50.0, B=8.0, T=3.0, mass=9e5)


def sail(steps: int, seed: int, dt: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """States (steps + 1, 10) and commands (steps + 1, 4) of a first-order (Nomoto) ship at constant speed under a
    random rudder."""
    rng = np.random.default_rng(seed)
    S, C = np.zeros((steps + 1, 10)), np.zeros((steps + 1, 4))
    C[:, 0] = 90.0
    C[:, 1] = np.repeat(rng.uniform(-0.5, 0.5, steps // 10 + 1), 10)[: steps + 1]
    S[0, 3], S[0, 6], S[0, 2] = 3.0 + rng.uniform(-1, 1), 90.0, rng.uniform(-np.pi, np.pi)
    for k in range(steps):
        x, y, psi, u, _, r = S[k, :6]
        r = r + dt * (0.05 * C[k, 1] - r) / 10.0
        psi = psi + dt * r
        S[k + 1] = [x + dt * u * np.cos(psi), y + dt * u * np.sin(psi), psi, u, -0.3 * r, r, 90.0, C[k, 1], 0.0, 0.0]
    return S, C


@pytest.fixture
def toy() -> Callable[..., Dataset]:
    """Makes a data set of `runs` runs; `meta(i)` gives the metadata of run i."""

    def make(
        runs: int = 10, steps: int = 20, meta: Callable[[int], dict] = lambda i: {}, name: str = "toy", **options
    ) -> Dataset:
        made = []
        for i in range(runs):
            S, C = sail(steps, i)
            made.append(Run(f"r{i:02d}", np.arange(steps + 1.0), S, C, COMMANDS, meta(i)))
        return Dataset(name, TOY_SHIP, 1.0, tuple(made), **options)

    return make


def write_toy_folder(
    folder: Path, runs: int = 6, steps: int = 40, *, drop: str = "", spoil: tuple[int, str, str] | None = None
) -> Path:
    """A data set folder named after `folder`: `drop` leaves a column out, `spoil` puts a value (row, column, text) into
    the table."""
    folder.mkdir()
    header = [c for c in ("trajectory", "t", *STATES, *COMMANDS) if c != drop]
    rows = []
    for i in range(runs):
        S, C = sail(steps, i)
        for k in range(steps + 1):
            row = dict(zip((*STATES, *COMMANDS), [*S[k], *C[k]], strict=True)) | {
                "trajectory": f"r{i:02d}",
                "t": float(k),
            }
            rows.append([row[c] for c in header])
    if spoil is not None:
        rows[spoil[0]][header.index(spoil[1])] = spoil[2]
    with (folder / "trajectories.csv").open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
    (folder / "ship.toml").write_text(TOY_SHIP.to_toml())
    (folder / "dataset.toml").write_text(
        f'name = "{folder.name}"\nship = "ship.toml"\ndt = 1.0\nactuators = "measured"\nsource = "formula"\n'
        'licence = "MIT"\n'
    )
    return folder


@pytest.fixture
def toy_folder(tmp_path: Path) -> Callable[..., Path]:
    """`write_toy_folder` below the test's own folder; `name` is the data set's."""

    def write(runs: int = 6, steps: int = 40, *, name: str = "toyset", **options: Any) -> Path:
        return write_toy_folder(tmp_path / name, runs, steps, **options)

    return write
