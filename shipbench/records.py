"""Runs and data sets in memory: SI units, standard signs, checked once on construction."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from .arrays import numbers
from .errors import InputError, unknown_name
from .names import brief, check_name, check_run
from .notebook import Runs, dataset_html, dataset_text, run_text
from .run_meta import RunMeta
from .ship import Ship
from .signals import COMMANDS, STATES

if TYPE_CHECKING:
    import pandas as pd

LARGEST = 1e12
"""Largest value of any signal in its standard unit: beyond every sensor, and its square is still finite."""
_SHOWN_NAMES = 20
"""Most names of runs in a message."""
_UNEVEN = 2e-3
"""Largest difference of two steps of one run, relative to the sample time."""


@dataclass(frozen=True, eq=False)
class Run:
    """One recorded manoeuvre, uniformly sampled.

    Args:
        id: unique inside the data set.
        t: (samples,) [s], growing by the same step.
        states: (samples, 10), order and units of `signals.STATES`; heading unwrapped.
        inputs: (samples, inputs), the four commands, then the environment channels; row k is held on [t_k, t_k+1).
        inputs_names: names of the columns of `inputs`.
        meta: what is known of the run, `run.meta.manoeuvre` and so on (see `RunMeta`); a dict with the keys of
            dataset.toml becomes one.
    """

    id: str
    t: np.ndarray
    states: np.ndarray
    inputs: np.ndarray
    inputs_names: tuple[str, ...] = COMMANDS
    meta: RunMeta = field(default_factory=RunMeta)

    def __post_init__(self) -> None:
        check_run(self.id, "run")
        object.__setattr__(self, "meta", RunMeta.of(self.meta, f"run '{self.id}'"))
        for part in ("t", "states", "inputs"):
            object.__setattr__(self, part, numbers(getattr(self, part), f"run '{self.id}': {part}"))
        object.__setattr__(self, "inputs_names", tuple(self.inputs_names))
        names = self.inputs_names
        if names[: len(COMMANDS)] != COMMANDS or len(set(names)) != len(names):
            raise InputError(
                f"run '{self.id}': inputs_names are {names}; accepted: {', '.join(COMMANDS)}, then other names, "
                "each once."
            )
        n = len(self.t) if self.t.ndim == 1 else 0
        if n == 0 or self.states.shape != (n, len(STATES)) or self.inputs.shape != (n, len(names)):
            raise InputError(
                f"run '{self.id}': t has the shape {self.t.shape}, states {self.states.shape}, inputs "
                f"{self.inputs.shape}; "
                f"accepted: t (samples,), states (samples, {len(STATES)}), inputs (samples, {len(names)}), and one "
                "sample at least."
            )
        self._check_values(self.states, STATES)
        self._check_values(self.inputs, names)
        self._check_time()

    def _check_values(self, array: np.ndarray, names: tuple[str, ...]) -> None:
        if np.abs(array).max() <= LARGEST:  # not-a-number is not
            return
        bad = np.argwhere(~(np.abs(array) <= LARGEST))
        k, j = bad[0]
        accepted = f"at most {LARGEST:g} in size" if np.isfinite(array[k, j]) else "finite"
        raise InputError(
            f"run '{self.id}', t = {self.t[k]:g} s: {names[j]} is {array[k, j]} ({len(bad)} such values in the run). "
            f"Every value must be {accepted}: cut the run there or fill the gap before loading."
        )

    def _check_time(self) -> None:
        steps = np.diff(self.t)
        typical = float(steps.mean()) if len(steps) else 1.0
        if np.isfinite(self.t).all() and typical > 0.0 and (np.abs(steps - typical) <= _UNEVEN * typical).all():
            return
        typical = float(np.nanmedian(steps)) if len(steps) else 1.0  # of most steps: some may be far off
        k = int(np.argmax(~(np.abs(steps - typical) <= _UNEVEN * abs(typical)))) if len(steps) else 0
        raise InputError(
            f"run '{self.id}': t goes from {self.t[k]:g} s to {self.t[min(k + 1, len(steps))]:g} s; accepted: t "
            "that grows by the same step"
            f"{f', {typical:g} s here' if typical > 0.0 else ''}. Resample the run."
        )

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return brief(run_text(self))

    @property
    def commands(self) -> np.ndarray:
        """The four commands (samples, 4), order and units of `signals.COMMANDS`."""
        return self.inputs[:, : len(COMMANDS)]

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    @property
    def group(self) -> str:
        """Name of the group whose runs (pieces of one log, copies of one manoeuvre, windows of one run) must not be
        split; a run without one is its own."""
        return str(self.parent if self.meta.group is None else self.meta.group)

    @property
    def parent(self) -> str:
        """Id of the run of which it is a window; of a run that is none, its own."""
        return self.id if self.meta.parent is None else self.meta.parent

    @property
    def kind(self) -> str:
        """Kind of manoeuvre, "" where it is not given."""
        return self.meta.manoeuvre or ""

    @property
    def began(self) -> datetime | None:
        """Date and time at which it began (UTC where no zone is given); None where they are not given."""
        given = self.meta.from_
        if given is None or isinstance(given, Real):
            return None
        began = given if isinstance(given, datetime) else datetime.fromisoformat(str(given))
        return began if began.tzinfo else began.replace(tzinfo=UTC)

    def slice(self, start: int, stop: int, suffix: str = "") -> Run:
        """Samples [start, stop) as a run that keeps the metadata and names its parent."""
        return Run(
            self.id + suffix, self.t[start:stop], self.states[start:stop], self.inputs[start:stop], self.inputs_names,
            replace(self.meta, parent=self.parent),
        )  # fmt: skip

    def windows(self, samples: int, stride: int) -> list[Run]:
        """Windows of that many samples, `stride` apart; a single one keeps the run's name."""
        starts = range(0, len(self) - samples + 1, stride)
        return [self.slice(s, s + samples, f"@{self.t[s]:g}s" if len(starts) > 1 else "") for s in starts]


@dataclass(frozen=True, eq=False)
class Batch:
    """Runs of equal length, stacked for a rollout: the input of a predictor (s0, U, history) and the truth, which it
    must not use.

    Shapes: s0 (batch, 10), U (batch, K, inputs), truth (batch, K, 10), history ((batch, H, 10), (batch, H, inputs)) or
    None.
    """

    ids: tuple[str, ...]
    s0: np.ndarray
    U: np.ndarray
    truth: np.ndarray
    history: tuple[np.ndarray, np.ndarray] | None = None

    def __repr__(self) -> str:
        past = f", history of {self.history[0].shape[1]} samples" if self.history else ""
        return brief(
            f"<Batch of {len(self.ids)} runs: s0 {self.s0.shape}, U {self.U.shape}, truth {self.truth.shape}{past}>"
        )


@dataclass(frozen=True, eq=False)
class Dataset:
    """Runs of one ship with one sample time and one list of inputs: a sequence of runs, `data["run07"]`, `data[3]`,
    `for run in data`.

    A slice, `data[:5]`, is a data set of those runs.

    Args:
        name: registered name, or the `name` of dataset.toml (see `names.check_name`).
        ship: the vessel's particulars.
        dt: sample time [s].
        runs: the runs.
        actuators: "measured" (n, delta, F_b, F_s are sensor readings) or "commanded" (they repeat the commands).
        source, licence: where the data come from and under which terms.
        simulation: name of the simulator's ship file when the data are simulated without a hidden cause, else None.
        notes: what a reader must know (estimated or missing channels).
        derived: names of the speeds (u, v, r) that were derived from positions and headings, not measured.
    """

    name: str
    ship: Ship
    dt: float
    runs: tuple[Run, ...]
    actuators: str = "measured"
    source: str = ""
    licence: str = ""
    simulation: str | None = None
    notes: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_name(self.name, "name")
        object.__setattr__(self, "runs", Runs(self.runs))
        if isinstance(self.dt, bool) or not isinstance(self.dt, Real) or not 0.0 < self.dt < np.inf:
            raise InputError(f"data set '{self.name}': dt = {self.dt!r}; accepted: a number of seconds above 0.")
        if not all(isinstance(run, Run) for run in self.runs):
            raise InputError(
                f"data set '{self.name}': runs holds {type(self.runs[0]).__name__}; accepted: objects of "
                "shipbench.records.Run."
            )
        if not self.runs:
            raise InputError(f"data set '{self.name}' has no runs; at least one is needed.")
        if self.actuators not in ("measured", "commanded"):
            raise InputError(
                f"data set '{self.name}': actuators = '{self.actuators}'; accepted: 'measured' or 'commanded'."
            )
        ids = [r.id for r in self.runs]
        if len(set(ids)) != len(ids):
            twice = sorted({i for i in ids if ids.count(i) > 1})
            raise InputError(f"data set '{self.name}': run ids are not unique: {', '.join(twice[:5])}. Rename them.")
        for run in self.runs:
            if run.inputs_names != self.inputs:
                raise InputError(
                    f"run '{run.id}' has inputs {run.inputs_names}, the data set {self.inputs}; they must agree."
                )
            if len(run) > 1 and abs(run.dt - self.dt) > 1e-3 * self.dt:
                raise InputError(
                    f"run '{run.id}' is sampled at {run.dt:g} s, the data set at {self.dt:g} s; resample one of them."
                )

    @classmethod
    def from_frame(
        cls, frame: pd.DataFrame, ship: Ship | str | Path, dt: float | None = None, *, name: str = "trial",
        actuators: str = "measured",
        meta: Mapping[str, RunMeta | Mapping[str, Any]] | None = None, **about: Any,
    ) -> Dataset:  # fmt: skip
        """Data set of a long table, one row per sample, in SI units and standard signs.

        Args:
            frame: columns trajectory, t [s], the ten states, the four commands, then wind_speed, wind_from, depth where
                they are measured; others are ignored. Missing actuators are filled in as for a file; `notes` say how.
            ship: the vessel's particulars, or the path of a ship.toml.
            dt: sample time [s]; None: that of t.
            name, actuators: as of a data set.
            meta: metadata of each run, by its id: a RunMeta, or a dict with the keys of dataset.toml.
            about: source, licence, simulation, notes or derived of the data set.

        Raises:
            InputError: a column is missing, a value is no number, time is not uniform, or the ship's file cannot be
                read.
        """
        from .frames import samples_of

        found, inputs, filled = samples_of(frame)
        known = dict(meta or {})
        if unknown := [run for run in known if run not in found]:
            raise unknown_name("run in meta", str(unknown[0]), [*found][:_SHOWN_NAMES])
        runs = tuple(
            Run(run, *arrays, inputs, RunMeta.of(known.get(run, {}), f"run '{run}'")) for run, arrays in found.items()
        )
        longest = max(runs, key=len)
        step = dt if dt is not None else float(f"{longest.dt:.9g}") if len(longest) > 1 else 1.0
        about["notes"] = tuple(dict.fromkeys((*about.get("notes", ()), *filled)))
        return cls(name, ship if isinstance(ship, Ship) else Ship.load(ship), step, runs, actuators, **about)

    def to_frame(self) -> pd.DataFrame:
        """Long table, one row per sample: trajectory, t, the states, the inputs. `from_frame` reads the same samples
        back, bit for bit."""
        from .frames import long_table

        return long_table(self.runs)

    def __len__(self) -> int:
        return len(self.runs)

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    def __contains__(self, run: object) -> bool:
        return any(own is run or own.id == run for own in self.runs)

    @overload
    def __getitem__(self, key: str | int) -> Run: ...

    @overload
    def __getitem__(self, key: slice) -> Dataset: ...

    def __getitem__(self, key: str | int | slice) -> Run | Dataset:
        if isinstance(key, slice):
            return self.with_runs(self.runs[key])
        if not isinstance(key, str):
            if not -len(self) <= key < len(self):
                raise IndexError(
                    f"data set '{self.name}' has no run {key}; it has {len(self)} runs, 0 to {len(self) - 1}."
                )
            return self.runs[key]
        if found := [run for run in self.runs if run.id == key]:
            return found[0]
        raise unknown_name("run", key, [run.id for run in self.runs[:_SHOWN_NAMES]])

    def __repr__(self) -> str:
        return brief(dataset_text(self))

    def _repr_html_(self) -> str:
        return dataset_html(self)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the columns of U: the four commands, then the measured environment channels."""
        return self.runs[0].inputs_names

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 (first 16 digits) over every sample, the run names, dt, the inputs and the ship."""
        digest = hashlib.sha256(
            repr((float(self.dt), self.inputs, self.actuators, self.ship.model_dump_json())).encode()
        )
        for run in self.runs:
            digest.update(run.id.encode())
            for array in (run.t, run.states, run.inputs):
                digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
        return digest.hexdigest()[:16]

    def with_runs(self, runs: Iterable[Run]) -> Dataset:
        """Copy of the data set with other runs."""
        return replace(self, runs=tuple(runs))

    def subset(self, indices: Sequence[int]) -> Dataset:
        """Data set of the runs at `indices`."""
        return self.with_runs(self.runs[i] for i in indices)

    def merged(self, other: Dataset | None) -> Dataset:
        """Data set with the runs of both (used by predictors that need no validation set)."""
        return self if other is None else self.with_runs((*self.runs, *other.runs))

    def windows(self, steps: int, stride: int | None = None, history: int = 0) -> Dataset:
        """Cut every run into windows of `history + steps` transitions, `stride` samples apart (default:
        non-overlapping).

        A run of exactly `history + steps + 1` samples gives one window; a run that gives one window only keeps its
        name.

        Raises:
            InputError: no run is long enough, or a number is not one of samples.
        """
        for what, value, least in (
            ("steps", steps, 1),
            ("stride", 1 if stride is None else stride, 1),
            ("history", history, 0),
        ):
            if not isinstance(value, (int, np.integer)) or value < least:
                raise InputError(f"{what} = {value}; accepted: a whole number of samples, {least} or more.")
        need = history + steps + 1
        windows = [window for run in self.runs for window in run.windows(need, stride or steps)]
        if not windows:
            longest = max(self.runs, key=len)
            raise InputError(
                f"data set '{self.name}': no run is as long as the horizon: {steps} steps + {history} of history "
                f"need {need} samples "
                f"({(need - 1) * self.dt:g} s); the longest run '{longest.id}' has {len(longest)}. Shorten the horizon."
            )
        return self.with_runs(windows)

    def batch(self, history: int = 0) -> Batch:
        """Stack runs of equal length; the first `history` samples before s0 become the history.

        Raises:
            InputError: the runs differ in length (cut them with `windows` first), or leave no step after the history.
        """
        lengths = {len(r) for r in self.runs}
        if len(lengths) > 1:
            raise InputError(
                f"data set '{self.name}': runs have {min(lengths)} to {max(lengths)} samples; cut them with windows()."
            )
        if not isinstance(history, (int, np.integer)) or not 0 <= history < len(self.runs[0]):
            raise InputError(
                f"history = {history}; accepted: 0 to {len(self.runs[0]) - 1} samples, since the runs have "
                f"{len(self.runs[0])}."
            )
        S = np.stack([r.states for r in self.runs])
        U = np.stack([r.inputs for r in self.runs])
        past = (S[:, :history], U[:, :history]) if history else None
        return Batch(tuple(r.id for r in self.runs), S[:, history], U[:, history:-1], S[:, history + 1 :], past)
