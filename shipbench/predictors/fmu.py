"""Simulation in a functional mock-up unit (FMI 2 and 3), `path/ship.fmu`: open parameters are calibrated.

Co-simulation and model exchange are accepted. Every FMU runs in worker processes, reset before each run: one that
crashes or hangs fails its own rows.

A mapping beside it, `ship.fmu.toml`, says which variable is which channel. `shipbench models ship.fmu --propose FILE`
writes a draft; none is needed where the names are ours.

Source: Functional Mock-up Interface Specification 2.0.4 and 3.0.1; FMPy loads the libraries.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Mapping as Table
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import InputError, WorkError, unknown_parameter
from ..extras import needed_by
from ..records import Dataset
from ..regular_files import open_regular
from ._saved import check_shapes, sample_time
from .base import History, PredictorBase
from .fmu_model.calibration import Calibrated, Rollouts, calibrate
from .fmu_model.crew import Crew
from .fmu_model.description import read_description
from .fmu_model.mapping import draft_command, mapping_of, open_parameters
from .fmu_model.preparing import Prepared, check_platform, kind_of, plan_of, prepare
from .fmu_model.signals_of import input_values, start_values, states_of

_log = logging.getLogger(__name__)


@dataclass
class Fmu(PredictorBase):
    """Model of an FMU.

    Args:
        path: the file; the spec begins with it.
        free: names of parameters to calibrate on the training runs; a spec writes fit=[Xuu,Nrr].
        mapping: file with the mapping (default: NAME.fmu.toml beside the FMU, else equal names).
        kind: co-simulation or model-exchange (default: the first of them that the FMU offers).
        step: communication step, or step of the integration of model exchange [s]; default: the sample time, and for
            model exchange the step size of the FMU's default experiment, or 0.1 s.
        limit: longest time of one run [s]; a longer one is stopped.
        workers: processes (0: one a core).
    """

    name: ClassVar[str] = "fmu"
    seeded: ClassVar[bool] = False
    needs: ClassVar[tuple[str, ...]] = ("fmpy",)

    path: str = ""
    free: list[str] = field(default_factory=list)
    mapping: str = ""
    kind: str = ""
    step: float = 0.0
    limit: float = 60.0
    workers: int = 0

    def __post_init__(self) -> None:
        self.free = [str(n) for n in ([self.free] if isinstance(self.free, str) else self.free)]
        for key in ("step", "limit", "workers"):
            value = getattr(self, key)
            least = 1e-3 if key == "limit" else 0.0
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value < np.inf:
                raise InputError(f"{self.path}: {key} = {value}; accepted: a number of at least {least:g}.")
        with needed_by(f"{self.path}"):
            import fmpy  # noqa: F401 - for its message here, not in a worker
        self._description = read_description(Path(self.path))
        self._mapping = mapping_of(self._description, self.mapping)
        self._open = open_parameters(self._description, self._mapping, self.free)
        self.values = np.array([value for _, value, _, _ in self._open])
        self.result: Calibrated | None = None
        self.kind = kind_of(self._description, self.kind)
        check_platform(self._description, self.kind)
        self.dt = float("nan")
        self._crew: Crew | None = None
        self._prepared: Prepared | None = None
        self._held: Rollouts | None = None

    @classmethod
    def of_file(cls, path: Path, params: Table[str, Any]) -> Self:
        """Model of the FMU at `path`; `params` are those of the spec.

        Raises:
            InputError: an unknown parameter, or an FMU or mapping that cannot be used.
        """
        known = ("fit", "mapping", "kind", "step", "limit", "workers")
        for key in params:
            if key not in known:
                raise unknown_parameter(f"'{path}'", key, known)
        return cls(str(path.absolute()), **{{"fit": "free"}.get(key, key): value for key, value in params.items()})

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return not np.isnan(self.dt)

    @property
    def earth_fixed(self) -> bool:
        """Whether it may know a place on earth: its position or heading is set at the start."""
        return bool({"x", "y", "psi"} & {link.channel for link in self._mapping.start})

    @property
    def learns(self) -> bool:
        """Whether `fit` calibrates parameters."""
        return bool(self._open)

    @property
    def num_parameters(self) -> int:
        """Count of calibrated parameters."""
        return len(self._open)

    def skip(self, dataset: Dataset) -> str | None:
        """Reason why the FMU cannot be simulated on these data: they lack one of its inputs."""
        if lacking := self._mapping.lacking(dataset.inputs):
            return (
                f"the FMU needs the input {', '.join(lacking)}, which the data have not. Give it a value in "
                "[constants] of its mapping"
            )
        return None

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Store sample time and inputs, and calibrate the open parameters on the training runs.

        Raises:
            InputError: the data lack an input of the FMU, or the sample time is no multiple of `step`.
            WorkError: the FMU cannot be loaded, crashed or exceeded the limit of a run.
        """
        if (reason := self.skip(train)) is not None:
            raise InputError(f"{self.path}: {reason}.")
        if own := self._mapping.own_start:
            _log.warning(
                "warning: %s begins with its own %s, since no start value is mapped. Draft of a mapping: %s",
                self.path, ", ".join(own), draft_command(Path(self.path)),
            )  # fmt: skip
        if train.dt != self.dt:
            self._close()
        self.dt, self.inputs = train.dt, train.inputs
        if self._open:
            self._running().start(len(train))
            _, start, low, high = (np.array(column) for column in zip(*self._open, strict=True))
            self.result = calibrate(self._simulated, _rollouts(train), start.astype(float), low, high)
            self.values = self.result.values
        return self

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        return self._simulated(Rollouts(s0, U, U), self.values[None], refuse=True)[0]

    def _simulated(self, windows: Rollouts, values: np.ndarray, refuse: bool = False) -> np.ndarray:
        """States (columns, runs, K, 10) for the open parameters `values` (columns, parameters); NaN where a run failed.

        Raises:
            WorkError: with `refuse`, all runs failed.
        """
        s0, U = windows.s0, windows.U
        crew = self._running()
        if self._held is not windows:
            crew.load(list(input_values(self._mapping, U, self.inputs)))
            self._held = windows
        start = start_values(self._mapping, s0)
        constants = np.array([value for _, value in self._mapping.constants])
        jobs = [(run, np.concatenate([start[run], constants, column])) for column in values for run in range(len(s0))]
        answers = crew.run(jobs)
        failed = [answer.reason for answer in answers if answer.reason]
        if refuse and failed:
            if len(failed) == len(answers):
                raise WorkError(f"{self.path}: {failed[0]}")
            _log.warning("warning: %s fails in %d of %d runs: %s", self.path, len(failed), len(answers), failed[0])
        outputs = np.stack([answer.outputs for answer in answers])
        many = len(values)
        S = states_of(
            self._mapping, outputs, np.tile(s0, (many, 1)), np.tile(U, (many, 1, 1)), self.dt
        )  # the rows of one column lie together
        lost = ~np.isfinite(outputs[:, 1:]).all(axis=2)
        S[lost] = np.nan
        return S.reshape(many, len(s0), *S.shape[1:])

    def _running(self) -> Crew:
        if self._crew is None:
            self._prepared = self._prepared or prepare(self._description, self.kind)
            plan = plan_of(self._description, self._mapping, self._open, self.kind, self._prepared, self.dt, self.step)
            self._crew, self._held = Crew(plan, self.path, self.limit, int(self.workers)), None
        return self._crew

    def _close(self) -> None:
        if self._crew is not None:
            self._crew.close()
        self._crew = None

    def __getstate__(self) -> dict[str, Any]:
        """State without the worker processes, for copies."""
        return {**self.__dict__, "_crew": None, "_prepared": None, "_held": None}

    def describe(self) -> str:
        """The FMU, the mapping, and the calibrated parameters with their bounds."""
        d = self._description
        lines = [f"FMU {d.name}, FMI {d.version}, {self.kind}"]
        lines += [
            f"{table} {link.channel} = {link.variable.name}"
            + (f" [{link.variable.unit}]" if link.variable.unit else "")
            for table in ("inputs", "outputs", "start")
            for link in getattr(self._mapping, table)
        ]
        deviations = self.result.deviations if self.result is not None else np.full(len(self.values), np.nan)
        for (variable, start, low, high), value, spread in zip(self._open, self.values, deviations, strict=True):
            at = " (at its bound)" if min(value - low, high - value) < 1e-3 * (high - low) else ""
            lines.append(
                f"{variable.name} = {value:.6g} +- {spread:.2g} {variable.unit}, from {start:.6g}, bounds {low:.6g} to "
                f"{high:.6g}{at}"
            )
        if self.result is not None:
            lines.append(
                f"residual of the training runs: {self.result.before:.3g} before, {self.result.after:.3g} after, in "
                f"typical sizes of the motion; {self.result.simulated} runs simulated"
            )
        return "\n".join(lines)

    def _meta(self) -> dict[str, Any]:
        path = Path(self.path).absolute()
        return {"dt": self.dt, "fmu": str(path), "sha256": _digest(path)}

    def _arrays(self) -> dict[str, np.ndarray]:
        return {"values": self.values}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        check_shapes(arrays, {"values": (len(self._open),)})
        if not Path(self.path).is_absolute():  # a stranger's folder could bring an FMU, which is code
            raise InputError(f"the saved model names its FMU '{self.path}' without its folder; accepted: a whole path.")
        if _digest(Path(self.path)) != meta["sha256"]:
            raise InputError(
                f"{self.path} is not the FMU that the model was fitted with (its SHA-256 differs). Put that one in its "
                "place, or fit again."
            )
        self.dt, self.values = sample_time(meta), arrays["values"]


def _digest(path: Path) -> str:
    with open_regular(path, "FMU") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()  # type: ignore[arg-type]


def _rollouts(train: Dataset) -> Rollouts:
    """Training runs in windows as long as the shortest of them."""
    samples = min(len(run) for run in train.runs)
    if samples < 2:
        raise InputError(f"a training run of '{train.name}' has one sample; at least 2 are needed.")
    windows = [w for run in train.runs for w in run.windows(samples, samples - 1)]
    states, inputs = (np.stack([getattr(w, part) for w in windows]) for part in ("states", "inputs"))
    return Rollouts(states[:, 0], inputs[:, :-1], states[:, 1:])


PREDICTOR = Fmu
