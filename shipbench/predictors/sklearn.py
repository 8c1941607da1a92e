"""Regressors of scikit-learn as one-step models, `sklearn:HistGradientBoostingRegressor[max_iter=50]` (needs the extra
`sklearn`).

It learns y_k+1 - y_k from y_k and the inputs at k, both standardised, and is rolled out like the paper's network. A
regressor with one output is fitted once per channel. Where it has a `random_state`, that is the seed.

Source: Pedregosa et al. (2011), Scikit-learn: machine learning in Python, JMLR 12.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
import sklearn
from sklearn.multioutput import MultiOutputRegressor
from sklearn.utils import all_estimators
from sklearn.utils._param_validation import InvalidParameterError

from ..errors import InputError, unknown_name, unknown_parameter
from ..records import Dataset
from ._features import InputFeatures
from ._one_step import NUM_CHANNELS, check_target, one_step_rollout, transitions
from ._saved import check_shapes, sample_time
from .base import History, PredictorFamily

_OWN = ("target",)
_TOO_LARGE = 1e30
"""Largest standardised value of a rollout that has not diverged; regressors refuse values beyond float32 (3.4e38)."""


def _regressors() -> dict[str, Any]:
    """Regressors of scikit-learn itself, by class name."""
    return dict(all_estimators(type_filter="regressor"))


@dataclass
class SklearnOneStep(PredictorFamily):
    """One-step model around a scikit-learn regressor.

    `save` keeps the training samples and fits again on `load`, since a fitted regressor can otherwise only be pickled,
    and a pickle runs code when it is read. The saved folder therefore contains the training data; where the refitted
    model does not predict what the saved one did (another version of scikit-learn), `load` refuses.

    Args:
        regressor: class name of the regressor, such as "Ridge".
        params: its parameters.
        target: "increment" learns y_k+1 - y_k, "state" learns y_k+1.
    """

    name: ClassVar[str] = "sklearn"
    needs: ClassVar[tuple[str, ...]] = ("sklearn",)
    regressor: str
    params: dict[str, Any] = field(default_factory=dict)
    target: str = "increment"

    def __post_init__(self) -> None:
        check_target(self.target)
        self._x = np.empty((0, 0))
        self._z = np.empty((0, NUM_CHANNELS))
        self._dt, self._seed = 0.0, 0
        self._fitted: Any = None
        self._new(0)  # a wrong name or parameter is told before anything is fitted

    @classmethod
    def member(cls, member: str, params: dict[str, Any]) -> Self:
        """Member of a spec, as `sklearn:Ridge[alpha=0.1,target=state]`: `target` is of this class, all other parameters
        are the regressor's."""
        if not member:
            raise InputError(
                "model spec 'sklearn' names no regressor; write sklearn:HistGradientBoostingRegressor, or another "
                "of scikit-learn's."
            )
        own = {k: v for k, v in params.items() if k in _OWN}
        try:
            return cls(member, {k: v for k, v in params.items() if k not in _OWN}, **own)
        except (TypeError, ValueError) as error:
            raise InputError(f"model spec 'sklearn:{member}': {error}.") from None

    def _new(self, seed: int) -> Any:
        """Unfitted regressor.

        Raises:
            InputError: scikit-learn has no regressor of that name, or it has no such parameter, or cannot be made
                without a further one.
        """
        known = _regressors()
        if self.regressor not in known:
            raise unknown_name("regressor of scikit-learn", self.regressor, known)
        cls = known[self.regressor]
        accepted = cls._get_param_names()
        for key in self.params:
            if key not in accepted:
                raise unknown_parameter(f"'sklearn:{self.regressor}'", key, [*accepted, *_OWN, "seed"])
        try:
            made = cls(**self.params)
        except TypeError as error:
            raise InputError(
                f"'sklearn:{self.regressor}' cannot be made from a spec: {error}. Use one that needs no other "
                "estimator."
            ) from None
        if "random_state" in accepted and "random_state" not in self.params:
            made.set_params(random_state=seed)
        return made if made.__sklearn_tags__().target_tags.multi_output else MultiOutputRegressor(made)

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return self._fitted is not None

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Fit on the transitions of `train` and, without early stopping, of `valid`.

        Raises:
            InputError: scikit-learn refuses a parameter's value.
        """
        data = train.merged(valid)
        self.inputs, self._dt, self._seed = data.inputs, data.dt, seed
        batch = data.batch()
        y, inputs, after = transitions(
            np.concatenate([batch.s0[:, None], batch.truth], axis=1), batch.U, InputFeatures(self.inputs)
        )
        self._x = np.concatenate([y, inputs], axis=-1)
        self._z = after - y if self.target == "increment" else after
        try:
            self._fit_regressor()
        except InvalidParameterError as error:
            raise InputError(f"model 'sklearn:{self.regressor}': {error}") from None
        return self

    def _fit_regressor(self) -> None:
        self._scale_x, self._scale_z = _scale(self._x), _scale(self._z)
        x, z = ((a - mean) / std for a, (mean, std) in ((self._x, self._scale_x), (self._z, self._scale_z)))
        self._fitted = self._new(self._seed).fit(x, z)

    def _step(self, x: np.ndarray) -> np.ndarray:
        """Next y, or its change; NaN for the runs whose state is no longer finite, which a regressor would refuse."""
        scaled = (x - self._scale_x[0]) / self._scale_x[1]
        good = (np.abs(scaled) < _TOO_LARGE).all(axis=1)  # False for NaN
        z = np.full((len(scaled), NUM_CHANNELS), np.nan)
        if good.any():
            z[good] = (
                np.asarray(self._fitted.predict(scaled[good])).reshape(-1, NUM_CHANNELS) * self._scale_z[1]
                + self._scale_z[0]
            )
        return z

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        return one_step_rollout(
            self._step, s0, U, InputFeatures(self.inputs), self._dt, increment=self.target == "increment"
        )

    def num_parameters(self) -> int | None:
        """Number of coefficients and intercepts of a linear regressor; None for any other."""
        found = getattr(self._fitted, "estimators_", [self._fitted])  # one for each channel, or one for all
        if not all(hasattr(linear, "coef_") for linear in found):
            return None
        return sum(np.size(linear.coef_) + np.size(linear.intercept_) for linear in found)

    def _probe(self) -> np.ndarray:
        """Predictions of the fitted regressor for a few training samples."""
        return self._step(self._x[:: max(1, len(self._x) // 20)])

    def _arrays(self) -> dict[str, np.ndarray]:
        return {"x": self._x, "z": self._z, "probe": self._probe()}

    def _meta(self) -> dict[str, Any]:
        return {"dt": self._dt, "seed": self._seed, "scikit-learn": sklearn.__version__}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        self._x, self._z = arrays["x"], arrays["z"]
        check_shapes(
            arrays,
            {"x": (len(self._x), NUM_CHANNELS + InputFeatures(self.inputs).count), "z": (len(self._x), NUM_CHANNELS)},
        )
        self._dt, self._seed = sample_time(meta), int(meta["seed"])
        self._fit_regressor()
        if not np.allclose(self._probe(), arrays["probe"], rtol=1e-9, atol=1e-12):
            raise InputError(
                f"the saved model 'sklearn:{self.regressor}' was fitted with scikit-learn {meta['scikit-learn']}; "
                "fitted again with "
                f"{sklearn.__version__} it predicts something else. Install scikit-learn {meta['scikit-learn']}, or "
                "fit it anew."
            )


def _scale(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of the columns; a column that does not move up to round-off keeps the scale 1."""
    mean, std = a.mean(axis=0), a.std(axis=0)
    return mean, np.where(std <= 1e-9 * (np.abs(mean) + 1e-12), 1.0, std)


PREDICTOR = SklearnOneStep
