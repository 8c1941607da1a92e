"""Base of all predictors: fit, predict, save, load; and the construction of a predictor from a model spec.

A part is one file of this folder whose class is bound to `PREDICTOR`. Its dataclass fields are the parameters that a
spec sets (`mlp[hidden=64,seed=3]`); `_arrays` returns the fitted arrays and `_restore` takes them back.
"""

from __future__ import annotations

import copy
import inspect
from abc import ABC, abstractmethod
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np

from ..errors import InputError, unknown_parameter
from ..names import brief
from ..records import Dataset
from ..signals import COMMANDS, STATES
from ..specs import Spec, parse_spec, spec_of
from ._band import Band, read_band, write_band
from ._saved import (
    SAVED_FILES,
    Origin,
    damaged,
    described,
    origin_of,
    read_arrays,
    read_meta,
    remembers_origin,
    remembers_origins,
    write_saved,
)
from ._user_file import class_from_file, spec_in_file
from .device import check_device
from .own_simulator import simulator_of
from .registered import PREDICTORS

History = tuple[np.ndarray, np.ndarray]
__all__ = ["PREDICTORS", "History", "Predictor", "PredictorBase", "Spec", "make_predictor", "parse_spec"]


@runtime_checkable
class Predictor(Protocol):
    """Interface of a model in the benchmark; foreign classes conform without inheriting.

    `predict(s0, U, history)`: s0 (batch, 10), U (batch, K, inputs) -> S (batch, K, 10), S[:, k] at t_k+1.

    A class may also offer:
        fit_group: class method `fit_group(models, trains, valids, seeds)`, which fits many at once (folds and seeds) in
            place.
        skip: `skip(dataset)`, the reason why it cannot take a data set, or None.
        predict_samples: `predict_samples(s0, U, samples)`, random records (samples, batch, K, 6 or 10) of the motion; a
            band takes its shape from them.
        learns: False where `fit` learns nothing from the runs (a simulator).
        warm_start: an attribute of that name that is set to True lets the next `fit` go on from the last one.
        num_parameters: count of fitted numbers.
        seeded: False where nothing is drawn at random.
        context: an argument of `predict` of that name is given the `Context` of the runs.
        skip_windows: `skip_windows(context, steps)`, the reason for each row why it cannot be predicted, or "".
        replay: True where the states do not follow from s0 and U, since they are read from a file.
        earth_fixed: True where the model knows a place on earth.
        device: set by `--device` ("cpu", "cuda", "cuda:1") before it fits or predicts.
    """

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Any: ...

    def predict(self, s0: np.ndarray, U: np.ndarray, history: History | None = None) -> np.ndarray: ...


class PredictorBase(ABC):
    """Input checks, single runs, saving and loading, for the predictors of this package."""

    name: ClassVar[str]
    needs: ClassVar[tuple[str, ...]] = ()
    """Optional packages that its module imports, by their names in `extras.EXTRAS`; `shipbench models` reads them
    without importing the module."""
    inputs: tuple[str, ...] = COMMANDS
    """Names of the columns of U, known after `fit`."""
    origin: Origin | None = None
    """Training data, known after `fit`."""
    band: Band | None = None
    """Band about the predictions, where one was computed (`fit_band`) or loaded; it is saved with the model."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Wrap every `fit` and `fit_group` to record the training data: a saved model can then refuse other data."""
        super().__init_subclass__(**options)
        if "__repr__" not in cls.__dict__:
            # A dataclass would write one that does not say whether it is fitted.
            cls.__repr__ = PredictorBase.__repr__  # type: ignore[method-assign]
        if "fit" in cls.__dict__:
            cls.fit = remembers_origin(cls.__dict__["fit"])  # type: ignore[method-assign]
        if "fit_group" in cls.__dict__:
            own = cls.__dict__["fit_group"].__func__
            cls.fit_group = classmethod(remembers_origins(own))  # type: ignore[attr-defined]

    def __repr__(self) -> str:
        """The class with its parameters, and whether it is fitted."""
        given = (
            ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in fields(self) if f.repr)
            if is_dataclass(self)
            else ""
        )
        return brief(f"<{type(self).__name__}({given}), {'fitted' if self.fitted else 'not fitted'}>")

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return True

    def _refuse_unfitted(self, what: str) -> None:
        if not self.fitted:
            raise InputError(f"{self.name}: {what} was called before fit; fit or load the model first.")

    def skip(self, dataset: Dataset) -> str | None:
        """Reason why this model cannot take `dataset`, or None; a study then has rows with the status `skipped` and
        this reason."""
        return None

    @abstractmethod
    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Learn from `train`; `valid` only decides when to stop or what to keep."""

    @abstractmethod
    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        """Prediction on checked arrays with a batch axis."""

    def _arrays(self) -> dict[str, np.ndarray]:
        """Fitted arrays, by name."""
        return {}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:  # noqa: B027
        """Take back the values that `_arrays` and `_meta` returned; a model without state does nothing."""

    def _meta(self) -> dict[str, Any]:
        """Further values to save, as JSON."""
        return {}

    def predict(self, s0: np.ndarray, U: np.ndarray, history: History | None = None) -> np.ndarray:
        """Roll out from `s0` under the inputs `U`.

        Args:
            s0: (batch, 10) or (10,), order and units of `signals.STATES`.
            U: (batch, K, inputs) or (K, inputs); U[:, k] is held on [t_k, t_k+1).
            history: states (batch, H, 10) and inputs (batch, H, inputs) before s0, or None.

        Returns:
            S (batch, K, 10) or (K, 10); S[:, k] is the state at t_k+1.

        Raises:
            InputError: the model is not fitted, a shape does not fit, or a value is not finite.
        """
        self._refuse_unfitted("predict")
        # Contiguous: PyTorch takes no array with a negative stride, such as s0[::-1].
        try:
            s0, U = np.ascontiguousarray(s0, dtype=float), np.ascontiguousarray(U, dtype=float)
        except (TypeError, ValueError) as error:
            raise InputError(f"s0 and U cannot be read as numbers ({error}); accepted: arrays of floats.") from None
        single = s0.ndim == 1
        if single:
            s0, U = s0[None], U[None]
            history = None if history is None else (np.asarray(history[0])[None], np.asarray(history[1])[None])
        if history is not None:
            history = np.ascontiguousarray(history[0], dtype=float), np.ascontiguousarray(history[1], dtype=float)
        if s0.ndim != 2 or s0.shape[1] != len(STATES):
            raise InputError(
                f"s0 has shape {s0.shape}; accepted: (batch, {len(STATES)}) or ({len(STATES)},): {', '.join(STATES)}."
            )
        if U.ndim != 3 or U.shape[0] != s0.shape[0] or U.shape[2] != len(self.inputs) or U.shape[1] == 0:
            raise InputError(
                f"U has shape {U.shape}; accepted: ({s0.shape[0]}, K, {len(self.inputs)}) with K >= 1 and the "
                f"inputs {', '.join(self.inputs)}."
            )
        for label, array in (("s0", s0), ("U", U)):
            if not np.isfinite(array).all():
                where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
                raise InputError(f"{label}{list(where)} is {array[where]}; every value must be finite.")
        if history is not None and (history[0].shape[2] != len(STATES) or history[1].shape[:2] != history[0].shape[:2]):
            raise InputError(
                f"history has shapes {history[0].shape} and {history[1].shape}; accepted: (batch, H, 10) and "
                "(batch, H, inputs)."
            )
        S = self._rollout(s0, U, history)
        return S[0] if single else S

    def save(self, path: str | Path) -> None:
        """Write the model into the folder `path` (JSON and plain arrays: nothing is pickled).

        Raises:
            InputError: it is not fitted.
        """
        self._refuse_unfitted("save")
        params: dict[str, Any] = asdict(self) if is_dataclass(self) else {}
        meta = {
            "predictor": self.name,
            "params": params,
            "inputs": list(self.inputs),
            "meta": self._meta(),
            **described(self.origin),
        }
        write_saved(Path(path), meta, self._arrays())
        write_band(Path(path), self.band, SAVED_FILES)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a model that `save` wrote.

        Raises:
            InputError: the folder holds no saved model of this kind, or a damaged one, or a band of another model.
        """
        folder = Path(path)
        meta = read_meta(folder)
        arrays = read_arrays(folder, meta)
        try:
            # Where it was trained says nothing of where it is read: a model from a machine with a GPU predicts on one
            # without.
            model = cls(**{key: value for key, value in meta["params"].items() if key != "device"})
            model.inputs = tuple(meta["inputs"])
            model._restore(arrays, meta["meta"])
            model.origin = origin_of(meta)
            model.band = read_band(folder)
        except InputError:
            raise
        except Exception as error:  # a stranger's file may hold anything
            raise damaged(folder, error) from None
        return model


class PredictorFamily(PredictorBase):
    """Family of predictors: `sklearn:Ridge[alpha=0.1]` is the member "Ridge" of the family "sklearn"."""

    @classmethod
    @abstractmethod
    def member(cls, member: str, params: dict[str, Any]) -> Self:
        """Unfitted model of a spec; `member` is the text behind the colon ("" where there is none), `params` are
        unchecked.

        Raises:
            InputError: an unknown member or parameter, or a value that is not accepted.
        """


def _no_effects(spec: Spec) -> InputError:
    added = "+".join(e.name for e in spec.effects)
    return InputError(
        f"model spec '{spec.text}': effects extend 'physics' and 'neural_ode', '{spec.name}' takes none. Write "
        f"physics+{added}."
    )


def make_predictor(model: Any, device: str | None = None) -> Any:
    """Unfitted predictor of a spec (or the fitted one, for a saved folder), to compute on `device` if it has one and
    the spec names none.

    Args:
        model: "physics+current", "mlp[hidden=64]", "my_model.py:MyNet", the folder of a saved model, a `Spec`, a class,
            or an object (then a copy).
        device: "cpu", "cuda" or "cuda:1".

    Raises:
        InputError: unknown name or parameter, a value that the class refuses, or a device that is not here.
    """
    spec = spec_of(model)
    model = _made(spec)
    if device is not None and check_device(device) and hasattr(model, "device") and "device" not in spec.params:
        model.device = device
    return model


def learns(spec: Spec, model: Any) -> bool:
    """Whether the fit of the model of a spec learns from the runs: not where it comes fitted, or says that it does
    not."""
    return not spec.saved and getattr(model, "learns", True) is not False


def _given(spec: Spec) -> Any:
    """New object of a class in memory, or a copy of an object."""
    try:
        if (simulator := simulator_of(spec.given)) is not None:
            return simulator
        return spec.given() if isinstance(spec.given, type) else copy.deepcopy(spec.given)
    except (TypeError, ValueError) as error:
        made, instead = (
            ("made", "an object, such as MyNet(hidden=64)") if isinstance(spec.given, type) else ("copied", "its class")
        )
        raise InputError(f"model '{spec.text}' cannot be {made}: {error}. Give {instead}.") from error


def _of_file(spec: Spec) -> Any:
    """Model of a file or folder that a registered predictor reads."""
    if spec.effects:
        raise _no_effects(spec)
    model = PREDICTORS.get(spec.reader).of_file(spec.path, {k: v for k, v in spec.params.items() if k != "seed"})
    if spec.matched is not None:
        model.matched = spec.matched
    return model


def _made(spec: Spec) -> Any:
    if spec.given is not None:
        return _given(spec)
    if spec.saved:
        if spec.effects:
            raise _no_effects(spec)
        return PREDICTORS.get(read_meta(Path(str(spec.path)))["predictor"]).load(spec.path)
    if spec.reader:
        return _of_file(spec)
    family, _, member = (spec.name, "", "") if spec.path is not None else spec.name.partition(":")
    if spec.path is None and family not in PREDICTORS and (meant := spec_in_file(family)):
        half = "a file without its class or function" if family.endswith(".py") else "a class without its file"
        raise InputError(f"model spec '{spec.text}' names {half}. Give {meant}.")
    cls = class_from_file(spec.path, str(spec.class_name)) if spec.path is not None else PREDICTORS.get(family)
    if spec.path is None and hasattr(cls, "of_file"):
        raise InputError(
            f"model spec '{spec.text}': '{spec.name}' is made of a file. Accepted: predictions:FOLDER, or path.fmu."
        )
    if spec.effects and not hasattr(cls, "extend"):
        raise _no_effects(spec)
    params = {k: v for k, v in spec.params.items() if k != "seed"}
    if isinstance(cls, type) and issubclass(cls, PredictorFamily):
        return cls.member(member, params)
    if member:
        raise InputError(
            f"model spec '{spec.text}': '{family}' takes no ':{member}'. Write {family}, or {family}[parameter=value]."
        )
    if is_dataclass(cls):
        for key in params:
            if key not in {f.name for f in fields(cls)}:
                raise unknown_parameter(f"'{spec.name}'", key, [f.name for f in fields(cls)] + ["seed"])
    try:
        if spec.path is not None and (simulator := simulator_of(cls, params)) is not None:
            return simulator
        model = cls(**params)
        return model.extend(spec.effects) if spec.effects else model
    except (TypeError, ValueError) as error:
        known = (
            "See `shipbench models` for the parameters" if spec.path is None else f"Its arguments: {_arguments(cls)}"
        )
        raise InputError(f"model spec '{spec.text}': {error}. {known}.") from None


def _arguments(part: Any) -> str:
    """Arguments with which a class or function of the user's is made or called, as it writes them."""
    try:
        return str(inspect.signature(part))
    except (TypeError, ValueError):  # some have none
        return "unknown"
