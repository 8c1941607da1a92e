"""Result of a diagnosis as plain data: the verdict and further contents of the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..names import brief

if TYPE_CHECKING:
    from ..predictors.physics_model.correction import Correction

SCHEMA = 1


@dataclass(frozen=True)
class Estimate:
    """Effect size with its 95 % interval, in `unit`; NaN where none is known (null in the document)."""

    value: float
    unit: str
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Moved:
    """Quantity that the ship's coefficients give together, such as her speed at a shaft speed: relative change from the
    ship file to the calibrated ship, with its 95 % interval; spreads: the same in prior standard deviations."""

    coefficient: str
    change: float
    unit: str
    ci95: tuple[float, float]
    spreads: float


@dataclass(frozen=True)
class NoiseFloor:
    """Mean errors of position [m] and heading [rad] that the sensors' noise alone makes in open-loop rollouts: at their
    beginning, which a model that is not stable enlarges, and in the record that they are compared with."""

    position: float
    heading: float


@dataclass(frozen=True)
class Calibrated:
    """Mean position error ED [m] of open-loop rollouts: `before`, of the ship file's model, and `after`, with the
    ship's own coefficients calibrated.

    ci95: interval of `after` over runs. seconds: longest rollout. held_out: whether every run was predicted by a model
    that was fitted to others. moved: quantities of the calibrated ship that differ from those of her file. noise_floor:
    the part of both errors that the sensors' noise makes.
    """

    before: float
    after: float
    ci95: tuple[float, float]
    seconds: float
    held_out: bool
    moved: tuple[Moved, ...] = ()
    noise_floor: NoiseFloor | None = None


@dataclass(frozen=True)
class Gain:
    """Error of open-loop rollouts on held-out runs, before and after the model is extended.

    relative: 1 - after/before of the means; ci95: its interval, clustered by run; runs_better: such as "19/24";
    after_ci95: interval of `after`.
    """

    metric: str
    before: float
    after: float
    relative: float
    ci95: tuple[float, float]
    runs_better: str
    after_ci95: tuple[float, float] = (np.nan, np.nan)


@dataclass(frozen=True)
class Cause:
    """Identified cause. score: twice the log Bayes factor; p_value: of the greatest score of all candidates under the
    null.

    support: such as "12 of 12 runs". force: 99th percentile of its magnitude on the runs in "surge", "sway" [N] and
    "yaw" [N m], where practically significant. correction: the line of dataset.toml that corrects the record for it,
    where there is one.
    """

    effect: str
    rank: int
    score: float
    p_value: float
    parameters: dict[str, Estimate]
    confused_with: tuple[str, ...] = ()
    separating_manoeuvre: str = ""
    gain: Gain | None = None
    evidence: str = ""
    support: str = ""
    force: dict[str, float] = field(default_factory=dict)
    correction: str = ""

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name} {e.value:.3g} {e.unit}" for name, e in self.parameters.items())
        return brief(f"<Cause {self.rank}: {self.effect}; {sizes}>")


@dataclass(frozen=True)
class Candidate:
    """Candidate and the reason why it was not identified. detectable: detection limit per parameter name; NaN where it
    cannot be detected."""

    effect: str
    score: float
    p_value: float
    rejected_because: str
    estimate: dict[str, float] = field(default_factory=dict)
    detectable: dict[str, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    family: str = ""

    def __repr__(self) -> str:
        return brief(f"<Candidate {self.effect}: {self.rejected_because}>")


@dataclass(frozen=True)
class Wrong:
    """Line of errors by channel. depends_on: variable on which the unexplained force or error depends ("" when none);
    when: in words."""

    channel: str
    share_of_error: float
    depends_on: str
    when: str


@dataclass(frozen=True, repr=False)
class Trace:
    """Time series of the plots, per segment of a run (padded with NaN).

    run (B,) index of the run, names: of the runs. start (B,) [s]. t (K + 1,) [s]. measured, before, after (B, K + 1,
    6): x y psi u v r recorded, rolled out open-loop by the plain model, and by the extended one (held out where
    `held_out`; equal to `before` when nothing was named). inputs (B, K + 1, 4): n delta F_b F_s. knots (J,) [s]; force
    (B, J, 3), force_sd (B, J, 3): latent acceleration in surge, sway [m/s^2], yaw [rad/s^2], that the plain model needs
    to follow the measurement; force_after: the same for the extended model. white (B, K + 1, 6): residuals of
    the smoothed plain model over the noise.
    """

    run: np.ndarray
    names: tuple[str, ...]
    start: np.ndarray
    t: np.ndarray
    measured: np.ndarray
    before: np.ndarray
    after: np.ndarray
    inputs: np.ndarray
    knots: np.ndarray
    force: np.ndarray
    force_sd: np.ndarray
    force_after: np.ndarray
    white: np.ndarray
    held_out: bool = True


def what_it_is(unknown: Mapping[str, Any]) -> str:
    """Words for an unknown force, or error of a sensor, with the variable on which it depends."""
    kind = "error of the" if unknown["axis"].startswith(("recorded", "ordered")) else "force in"
    if unknown["variable"] == "nothing":
        return f"a constant {kind} {unknown['axis']}"
    return (
        f"{'an' if kind[0] == 'e' else 'a'} {kind} {unknown['axis']} that depends on {unknown['variable']}, best "
        f"as {unknown['form']}"
    )


@dataclass(frozen=True)
class Diagnosis:
    """Verdict and its evidence; `document` is the content of `diagnosis.json`.

    spec: name of the data set in commands, a folder or name[key=value]; "" where that is its own name.
    simulation: spec of the simulation that was judged in place of the ship file's physics, or "". correction: what
    corrects it. stand_in: what a reader must know where another model stands in for the simulation, or "".
    """

    dataset: str
    verdict: str
    causes: tuple[Cause, ...]
    candidates: tuple[Candidate, ...]
    what_is_wrong: tuple[Wrong, ...]
    unexplained_after: dict[str, Any]
    extended_model: str
    fingerprint: str
    seconds: float
    warnings: tuple[str, ...] = ()
    gain: Gain | None = None
    unknown: dict[str, Any] | None = None
    gain_per_run: tuple[tuple[str, float, float], ...] = ()
    trace: Trace | None = None
    spec: str = ""
    calibration: Calibrated | None = None
    simulation: str = ""
    stand_in: str = ""
    correction: Correction | None = None

    def __repr__(self) -> str:
        return brief(f"<Diagnosis of {self.dataset}: {self.verdict}, {self.extended_model}>")

    def document(self) -> dict[str, Any]:
        """Content of diagnosis.json by the contract, with `warnings`, the gain of all causes together, and `unknown`
        (channel and variable) where that is the verdict. `base_model` is the one that the proposed model is compared
        with."""
        return {
            "schema": SCHEMA, "dataset": self.dataset, "base_model": self.simulation or "physics",
            "verdict": self.verdict,
            "causes": [_plain(asdict(c)) for c in self.causes],
            "candidates": [_plain(asdict(c)) for c in self.candidates],
            "what_is_wrong": [_plain(asdict(w)) for w in self.what_is_wrong],
            "calibration": None if self.calibration is None else self._calibration(self.calibration),
            "unexplained_after": _plain(self.unexplained_after),
            "extended_model": self.extended_model, "fingerprint": self.fingerprint, "seconds": round(self.seconds, 2),
            "gain": None if self.gain is None else _plain(asdict(self.gain)), "unknown": _plain(self.unknown),
            "warnings": list(self.warnings),
            **({"stand_in": self.stand_in} if self.stand_in else {}),
        }  # fmt: skip

    def _calibration(self, found: Calibrated) -> dict[str, Any]:
        on = "held-out runs" if found.held_out else "fitted runs"
        return _plain({"metric": "ED", "on": on, **{k: v for k, v in asdict(found).items() if k != "held_out"}})


def _plain(value: Any) -> Any:
    """Value for JSON, which has no NaN and no tuples."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value
