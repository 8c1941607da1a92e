"""Recording to check: the data set as far as it can be read, its raw table, and the time scale of its ship."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..records import Dataset, Run
from ..signals import STATES, R, U, V
from .statistics import stretches


@dataclass(frozen=True, eq=False)
class Recording:
    """Data set to check.

    dataset: runs without missing values, uniform in time (pieces of one run share the group `parent`). given:
    dataset.toml as written, {} for a registered set. recorded: columns of the table (without states that were filled
    in). wrapped: runs whose heading was wrapped.
    parent: id of a piece -> id of the run that it is a piece of. turned: u, v were velocities over ground, rotated into
    the ship's axes by psi; the track then does not depend on psi. turn: full turn in the unit of psi (undeclared
    degrees are read as they are).
    """

    dataset: Dataset
    given: dict[str, Any] = field(default_factory=dict)
    recorded: frozenset[str] = frozenset(STATES)
    wrapped: tuple[str, ...] = ()
    parent: dict[str, str] = field(default_factory=dict)
    turned: bool = False
    turn: float = 2.0 * np.pi

    @property
    def runs(self) -> tuple[Run, ...]:
        """Runs of the data set."""
        return self.dataset.runs

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return self.dataset.dt

    @property
    def froude(self) -> float:
        """Time scale relative to a ship of 130 m, sqrt(L/130)."""
        return float((self.dataset.ship.L / 130.0) ** 0.5)

    @cached_property
    def speed(self) -> float:
        """Typical speed [m/s]: root mean square over all samples."""
        S = np.concatenate([r.states for r in self.runs])
        return float(np.sqrt(np.mean(S[:, U] ** 2 + S[:, V] ** 2))) + 1e-12

    @cached_property
    def turning(self) -> float:
        """Typical yaw rate [rad/s]: root mean square over all samples."""
        return float(np.sqrt(np.mean(np.concatenate([r.states[:, R] for r in self.runs]) ** 2))) + 1e-12

    @cached_property
    def steps(self) -> np.ndarray:
        """Resolution (10,) of each state, or less: one in a hundred of the changes between neighbours is smaller; 0:
        none."""
        changes = np.abs(np.concatenate([np.diff(run.states, axis=0) for run in self.runs]))
        return np.array([np.quantile(c[c > 0.0], 0.01) if np.any(c > 0.0) else 0.0 for c in changes.T])

    def rounded(self, channel: int) -> bool:
        """Whether the resolution of a state is as coarse as its changes, so that values may repeat (1 % of the changes
        in noise are smaller than a fiftieth of the median)."""
        changes = np.abs(np.concatenate([np.diff(run.states[:, channel]) for run in self.runs]))
        return bool(np.any(changes > 0.0) and self.steps[channel] > 0.1 * np.median(changes[changes > 0.0]))

    def name_of(self, run: Run) -> str:
        """Id under which the user knows a run."""
        return self.parent.get(run.id, run.id)

    def names(self, runs: Any) -> tuple[str, ...]:
        """Ids of runs as the user knows them, each once."""
        return tuple(dict.fromkeys(self.name_of(run) for run in runs))

    def without(self, bad: dict[str, np.ndarray]) -> Recording:
        """Recording without the samples bad[run id] (samples,), split there as a cut would."""
        runs, parent = [], dict(self.parent)
        for run in self.runs:
            pieces = stretches(~bad[run.id]) if run.id in bad else [(0, len(run))]
            for number, (a, b) in enumerate(pieces, 1):
                if len(pieces) == 1 and b - a == len(run):
                    runs.append(run)
                elif b - a >= 2:
                    piece, name = f"{run.id}/{number}", self.name_of(run)
                    runs.append(
                        Run(
                            piece,
                            run.t[a:b],
                            run.states[a:b],
                            run.inputs[a:b],
                            run.inputs_names,
                            run.meta.in_group(name),
                        )
                    )
                    parent[piece] = name
        return replace(self, dataset=self.dataset.with_runs(runs), parent=parent)

    def with_dataset(self, dataset: Dataset) -> Recording:
        """Recording with another data set."""
        return replace(self, dataset=dataset)
