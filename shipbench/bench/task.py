"""Task: data that fully identifies an experiment, read from a TOML file and from the command line."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from ..errors import InputError, option, unknown_name
from ..metrics.base import METRICS
from ..names import LONGEST_LABEL, brief, check_label
from ..toml_files import Number, Whole, fault, read_toml

DEFAULT_METRICS = (
    "ed",
    "edh",
    "cvdm",
    "final_displacement",
    "heading_error",
    "position_rmse",
    "signal_rmse",
    "trial_indices",
)
_Seed = Annotated[Whole, Field(ge=0, lt=2**32)]
_NOT_IDENTITY = {"models", "metrics", "seeds", "title", "bands", "train_on"}
MEASURED: Literal["measured"] = "measured"
SIMULATED: Literal["simulated"] = "simulated"
BOTH: Literal["simulated+measured"] = "simulated+measured"
TrainOn = Literal["measured", "simulated", "simulated+measured"]
"""Runs that a model is trained on; it is always scored on measured ones."""


class Task(BaseModel):
    """One data set, the split, the horizon, and the models and metrics to run. Times in s.

    `history_s`: recorded time before s0 that every predictor may use. `split`: "folds" (by run, seeded by `fold_seed`),
    "published" (the data set's own `split` of each run), "kind" (each fold scores one kind of manoeuvre and trains on
    all others), "speed" (trains on the slower runs and scores the fastest 1/`folds` of them) or "extrapolate" (trains
    on the 60 % of the runs with the least rudder angles, drift angles and speeds, and scores the runs beyond them; see
    `severity`). `stride_s`: distance of the scored windows in runs longer than the horizon (default: they do not
    overlap). `valid_runs`: training runs set aside for early stopping (default: one ninth, 8 of 72). `train_runs`: use
    only that many runs for fitting and early stopping together, the same scored runs (`valid_runs` shrinks in
    proportion, to one at least). `max_runs`: use only that many runs, evenly spread over the data set. `bands`: score
    90 % bands, too (see `bands`); every model is fitted five times more, and its prediction stays the same.
    `simulated`: simulated twin of the data set (see `twins`). `train_on`: runs that every model is trained on,
    "measured", "simulated" and "simulated+measured"; a row for each (default: all three where `simulated` is given).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def __init__(self, where: str = "Task", /, **data: Any) -> None:
        """Check the keys above; `where` names their source in messages.

        Raises:
            InputError: a key is missing or unknown, or a value is not accepted.
        """
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise _refusal(error, where) from None

    dataset: str
    models: tuple[str, ...] = Field(min_length=1)
    horizon_s: Number = Field(120.0, gt=0)
    history_s: Number = Field(0.0, ge=0)
    folds: Whole = Field(5, ge=2)
    split: Literal["folds", "published", "kind", "speed", "extrapolate"] = "folds"
    stride_s: Number | None = Field(None, gt=0)
    seeds: tuple[_Seed, ...] = Field((0,), min_length=1)
    metrics: tuple[str, ...] = DEFAULT_METRICS
    valid_runs: Whole | None = Field(None, ge=0)
    train_runs: Whole | None = Field(None, ge=2)
    max_runs: Whole | None = Field(None, ge=2)
    fold_seed: _Seed = 0
    bands: bool = False
    simulated: str | None = None
    train_on: tuple[TrainOn, ...] = Field((), validate_default=True)
    title: str = ""

    @field_validator("models", "seeds", "metrics")
    @classmethod
    def _once_each(cls, value: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(dict.fromkeys(value))

    @field_validator("models")
    @classmethod
    def _labels(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(check_label(model, "model", LONGEST_LABEL) for model in value)

    @field_validator("metrics")
    @classmethod
    def _known_metrics(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for name in value:
            if name not in METRICS:
                raise unknown_name("metric", name, METRICS.names())
        if "ed" not in value:
            raise ValueError("'ed' must be among the metrics: models are ranked by it")
        return value

    @field_validator("train_on")
    @classmethod
    def _with_twins(cls, value: tuple[TrainOn, ...], info: ValidationInfo) -> tuple[TrainOn, ...]:
        if info.data.get("simulated") is None:
            if set(value) - {MEASURED}:
                raise ValueError(
                    f"no simulated runs are given; add {option('--simulated FOLDER', 'simulated=FOLDER')}, made by "
                    "`shipbench data simulate MODEL --like TRIAL --out FOLDER`"
                )
            return (MEASURED,)
        chosen: tuple[TrainOn, ...] = tuple(dict.fromkeys(value)) or get_args(TrainOn)
        if info.data.get("bands") and chosen != (MEASURED,):
            raise ValueError("bands are computed for models trained on measured runs only; leave bands out")
        labels = [row_label(model, choice) for model in info.data.get("models", ()) for choice in chosen]
        if twice := [label for label in labels if labels.count(label) > 1]:
            raise ValueError(f"two rows would be named '{twice[0]}'; rename the model")
        for label in labels:
            check_label(label, "model", LONGEST_LABEL)
        return chosen

    def __repr__(self) -> str:
        return brief(super().__repr__())

    def steps(self, dt: float) -> int:
        """Number of time steps of the horizon at sample time `dt` [s]."""
        return samples(self.horizon_s, dt, "horizon_s")

    def history(self, dt: float) -> int:
        """Samples of the history at sample time `dt` [s]."""
        return samples(self.history_s, dt, "history_s") if self.history_s else 0

    def stride(self, dt: float) -> int | None:
        """Distance of scored windows in samples, or None for windows that do not overlap."""
        return samples(self.stride_s, dt, "stride_s") if self.stride_s else None

    def key(self, fingerprint: str, simulated: str = "") -> str:
        """Digest of all settings that decide the scored data; rows are ranked together only where it agrees.

        Args:
            fingerprint: of the data set.
            simulated: fingerprint of its simulated twin, where the task has one.
        """
        data = self.model_dump(mode="json", exclude=_NOT_IDENTITY)
        if self.train_runs is None:
            del data["train_runs"]  # tasks from before this key keep theirs
        if self.simulated is None:
            del data["simulated"]
        else:
            data["simulated"] = simulated
        data["dataset"] = fingerprint  # the data's own digest: the same data under another path is the same task
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:12]


def row_label(model: str, train_on: str) -> str:
    """Label of a model in tables: `mlp (simulated)`; trained on measured runs it has its own name alone."""
    return model if train_on == MEASURED else f"{model} ({train_on})"


def samples(seconds: float, dt: float, name: str) -> int:
    """Number of samples of a time [s]; raises InputError where it is no whole number of them. `name` is that of the
    setting."""
    count = round(min(seconds / dt, 1e18))  # the quotient of a huge number may be infinite
    if count < 1 or abs(count * dt - seconds) > 1e-3 * dt:
        raise InputError(
            f"{name} = {seconds:g} s is not a whole number of samples of {dt:g} s; give a multiple of {dt:g} s."
        )
    return count


def make_task(data: dict[str, Any], where: str = "task") -> Task:
    """Validated task.

    Raises:
        InputError: a key is missing or unknown, or a value is not accepted; `where` names the source in the message.
    """
    return Task(where, **data)


def _refusal(error: ValidationError, where: str) -> InputError:
    place, kind, wrong = fault(error)
    key = ".".join(place)
    if kind == "extra_forbidden":
        return InputError(f"{where}: {unknown_name('key', key, [*Task.model_fields, 'datasets'])}")
    if key == "models" and kind in ("missing", "too_short"):
        example = option("--model physics", 'models=["physics"]')
        return InputError(f"{where}: no model is given; name at least one ({example}). `shipbench models` lists them.")
    return InputError(f"{where}: {key}: {wrong}. Keys: {', '.join(Task.model_fields)}.")


def configs_folder() -> Path:
    """Folder of the shipped configs: inside an installed package, else the repository's `configs`."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def read_config(path: str | Path) -> dict[str, Any]:
    """Read the table of a task file; a bare name ("paper", "smoke") means a shipped one.

    Raises:
        InputError: the file is missing, unreadable or not TOML.
    """
    shipped = configs_folder() / f"{path}.toml"
    return read_toml(shipped if not Path(path).exists() and shipped.is_file() else path)


def load_tasks(config: str | Path | None = None, overrides: dict[str, Any] | None = None) -> list[Task]:
    """Tasks of a config, one per data set; entries of `overrides` that are not None replace those of the file.

    A config names one `dataset` or several `datasets`; all other keys are those of `Task`. Without either, the data set
    is harbour90.

    Raises:
        InputError: as `read_config` and `make_task`.
    """
    data = read_config(config) if config is not None else {}
    where = str(config) if config is not None else "command line"
    given = {k: v for k, v in (overrides or {}).items() if v is not None}
    if "datasets" in given:
        data.pop("dataset", None)
    data.update(given)
    if "dataset" in data and "datasets" in data:
        raise InputError(f"{where}: both 'dataset' and 'datasets' are given; keep one of them.")
    names = data.pop("datasets", [data.pop("dataset", "harbour90")])
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise InputError(f'{where}: datasets = {names!r}; accepted: a list of names or folders, such as ["harbour90"].')
    return [make_task({**data, "dataset": name}, where) for name in dict.fromkeys(names)]
