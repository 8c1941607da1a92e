"""The source paper's physics: eq. (2) to (8) with 11 parameters fitted by constrained nonlinear least squares over
whole rollouts (eq. 9).

Source: the source paper, eq. (2) to (9).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from ..errors import WorkError
from ..estimation.actuator_fit import fit_actuators
from ..estimation.eq2_rollout import Rolling, parameter_scale
from ..estimation.extension import Active, Extension, accelerations, measured, roll, true_start
from ..estimation.gears import fit_gears
from ..estimation.priors import EQ2
from ..ops import Array
from ..physics.modifiers import Flow
from ..records import Batch, Dataset
from ..signals import ACTUATORS, COMMANDS, MOTION
from ._numbers import check_numbers
from ._saved import check_shapes
from .base import History
from .hold import Hold
from .physics_model.fit_report import FitReport, position_error, with_reversed_shaft
from .physics_model.fitted_ship import ACTUATOR_PARAMETERS, FittedShip

if TYPE_CHECKING:
    from .physics_model.fit import Fit

PARAMETERS = (
    ("p0", "lateral over axial propeller force", "1"),
    ("p1", "linear resistance", "N s/m"),
    ("p2", "quadratic resistance", "N s^2/m^2"),
    ("p3", "cubic resistance", "N s^3/m^3"),
    ("p4", "rudder lift at zero angle", "1"),
    ("p5", "rudder lift slope", "1/rad"),
    ("p6", "rudder lift, quadratic", "1/rad^2"),
    ("p7", "rudder lift, cubic (stall)", "1/rad^3"),
    ("p8", "rudder drag at zero angle", "1"),
    ("p9", "rudder drag, linear", "1/rad"),
    ("p10", "rudder drag, quadratic", "1/rad^2"),
)


@dataclass
class Physics(FittedShip):
    """Fitted eq. (2) to (8).

    Args:
        iterations: most Gauss-Newton steps of the fit.
        tolerance: relative decrease of the cost below which the fit stops.
        piece: longest rollout in the fit [s], 0 for whole runs: runs are cut into pieces that each start from the
            measured state. Where gusts push a ship, the end of a long rollout is their work and says little of the
            parameters.
    """

    iterations: int = 30
    tolerance: float = 1e-4
    piece: float = 0.0
    name: ClassVar[str] = "physics"

    def __post_init__(self) -> None:
        check_numbers(self, {"iterations": (0, 10_000), "tolerance": (0.0, 1.0)})
        if isinstance(self.piece, bool) or not isinstance(self.piece, (int, float)) or not 0.0 <= self.piece < np.inf:
            raise ValueError(f"piece = {self.piece}; accepted: 0 (whole runs), or a time in s")
        self.held: dict[int, str] = {}

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return hasattr(self, "p")

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Fit actuator dynamics, then p0..p10, over full rollouts of all runs of `train` and `valid` (nothing is tuned
        on `valid`).

        Raises:
            InputError: the spec gives an effect a value that no such ship has.
            WorkError: the fit found no finite rollouts.
        """
        from .physics_model.fit import fit_parameters  # casadi is loaded only for fitting

        data = train.merged(valid)
        self._set_ship(data.ship, data.inputs, data.dt, data.actuators == "commanded")
        if self.extension is not None:
            self.extension.check(self.particulars.L)
        batch = self._pieces(data).batch()
        asked, self.extension = self.extension, None
        if not self.commanded:
            self.actuator_params = fit_actuators(batch, self.dt)
        result = fit_parameters(self._rolling(), batch, self.iterations, self.tolerance)
        self.extension = asked
        if asked is not None and np.isfinite(result.cost):
            result = self._fit_effects(batch, result, asked)
        if not np.isfinite(result.cost):
            raise WorkError(
                f"the physics fit of '{data.name}' found no finite rollouts; check units and signs with `shipbench "
                "data check`."
            )
        self.p, self.ci95, self.cost = result.p, result.ci95, result.cost
        self.report = self._report(batch)
        return self

    def of_particulars(self, data: Dataset) -> Self:
        """Take the ship as its particulars describe it, in place of a fit: p0..p10 at their means between ordinary
        ships, actuators with ordinary dynamics. Nothing is learned from the runs of `data`.

        Source: docs/calibration.md#ordinary-differences-between-ships.
        """
        self._set_ship(data.ship, data.inputs, data.dt, data.actuators == "commanded")
        means = {prior.name: prior.centre for prior in EQ2}
        self.p = parameter_scale(self.c) * [means.get(symbol, 0.0) for symbol, _, _ in PARAMETERS]
        self.ci95, self.cost = np.full((len(PARAMETERS), 2), np.nan), np.nan
        return self

    def _report(self, batch: Batch) -> FitReport:
        """Report of the fit on its own runs."""
        from .physics_model.fit import bounds, fit_parameters, parameter_scale

        low, high = bounds(parameter_scale(self.c))
        edge = 1e-4 * (high - low)
        at = [
            s
            for i, (s, _, _) in enumerate(PARAMETERS)
            if i not in self.held and not low[i] + edge[i] < self.p[i] < high[i] - edge[i]
        ]
        kept = Hold.at(self.dt)._rollout(batch.s0, batch.U, None)
        error = position_error(self._rollout(batch.s0, batch.U, None), batch)

        def error_on(other: Batch) -> float:
            p = fit_parameters(self._rolling(), other, self.iterations, self.tolerance).p
            return position_error(self._rolling().states(other.s0, other.U, p), other)

        return with_reversed_shaft(
            FitReport(tuple(at), len(PARAMETERS) - len(self.held), error, position_error(kept, batch)), batch, error_on
        )

    def _pieces(self, data: Dataset) -> Dataset:
        """Runs cut into pieces of `piece` seconds, or of the shortest run where that is shorter."""
        steps = min(max(1, round(self.piece / data.dt)), min(len(r) for r in data.runs) - 1)
        return data.windows(steps) if self.piece else data

    def _fit_effects(self, batch: Batch, base: Fit, asked: Extension) -> Fit:
        """Fit the actuator effects first where actuators are recorded, then all other values together, once for every
        choice of open shape parameters; the best fit is kept."""
        from .physics_model.effects_fit import fit_extension
        from .physics_model.fit import Data

        asked = Extension(asked.terms)  # a second fit starts afresh
        if not self.commanded:
            self.actuator_params, asked = fit_gears(
                batch, self.dt, self.substeps, asked, self.actuator_params, self.particulars
            )
        self.held = asked.held()
        best: tuple[Fit, Extension] | None = None
        for choice in asked.settings(batch.truth[:, :, :2], self.particulars):
            data = Data(self.c, batch, self._path_under(choice, batch), self._wind(batch.U), self.dt, self.substeps)

            def repath(extension: Extension) -> np.ndarray:
                return self._path_under(extension, batch)

            found = fit_extension(
                data, base, choice, self.particulars, repath, self.commanded, self.iterations, self.tolerance
            )
            if best is None or not best[0].cost <= found[0].cost:  # also where the best so far diverged
                best = found
        if best is None:
            return base
        self.extension = best[1]
        return best[0]

    def _path_under(self, extension: Extension, batch: Batch) -> np.ndarray:
        self.extension = extension
        return self.actuator_path(batch.s0, batch.U)

    def forces(self) -> tuple[Sequence[Array], list[Active]]:
        """Fitted p0..p10, and the effects of the spec that act as forces."""
        return list(self.p), [] if self.extension is None else list(self.extension.active("force"))

    def accelerations(
        self, flow: Flow, wind: tuple[Array, Array] | None, p: Sequence[Array], active: Sequence[Active]
    ) -> tuple[Array, ...]:
        """Accelerations of eq. (2) with effects; without measured wind there is no air resistance."""
        return accelerations(active, flow, wind, self.c, p, self.particulars)

    def _rolling(self) -> Rolling:
        columns = (*range(len(COMMANDS)), *self._wind_columns())
        return Rolling(self.c, None if self.commanded else self.actuator_params, columns, self.dt, self.substeps)

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        if self.extension is None:
            return self._rolling().states(s0, U, self.p)
        forces, sensors = self.extension.active("force"), self.extension.active("sensor")
        start, path = true_start(s0, sensors, self.dt), self.actuator_path(s0, U)
        S = np.empty((len(s0), U.shape[1] + 1, s0.shape[1]))
        S[:, 0] = start
        S[:, 1:, MOTION] = roll(
            forces,
            start,
            path,
            self._wind(U),
            self.dt / self.substeps,
            self.substeps,
            self.c,
            list(self.p),
            self.particulars,
        )
        S[:, 1:, ACTUATORS] = (
            U[..., : len(COMMANDS)] if self.commanded else path[:, self.substeps - 1 :: self.substeps, 2]
        )
        return measured(S, sensors, self.dt)[:, 1:]

    def describe(self) -> str:
        """Text of the fitted equations with units and 95 % confidence intervals (clustered over runs), and of the
        quantities estimated from the particulars."""
        lines = [
            (
                f"physics of {self.ship.name}: eq. (2) to (8), left side from Inoue (1981), Clarke (1983) and Soeding "
                "(1982)"
            ),
            (
                f"  surge  {self.c.m + self.c.m_x:.4g} du = {self.c.X_vr:.4g} v r + {self.c.X_rr:.4g} r^2 + X_n + "
                "X_delta + X_e - R"
            ),
            f"  sway   {self.c.m11:.4g} dv + {self.c.m12_Y:.4g} dr = {self.c.Y_v:.4g} U v + ({self.c.Y_r:.4g} U - "
            f"{self.c.m:.4g} u) r "
            f"+ {self.c.Y_vv:.4g} v|v| + {self.c.Y_vr:.4g} v|r| + {self.c.Y_rr:.4g} r|r| + Y_n + Y_delta + Y_e",
            f"  yaw    {self.c.m12_N:.4g} dv + {self.c.m22:.4g} dr = {self.c.N_v:.4g} U v + ({self.c.N_r:.4g} U - "
            f"{self.c.m * self.c.x_G:.4g} u) r "
            f"+ {self.c.N_rr:.4g} r|r| + {self.c.N_vvr:.4g} v^2 r/U + {self.c.N_vrr:.4g} v r^2/U + N_n + N_delta + "
            "N_e   [SI]",
            (
                "  Y_n = p0 X_n; R = p1 u + p2 u|u| + p3 u^3; c_L = p4 + p5 a + p6 a^2 + p7 a^3; c_D = p8 + p9 a + p10 "
                "a^2 [a in rad]"
            ),
        ]
        for i, ((symbol, meaning, unit), value, (low, high)) in enumerate(
            zip(PARAMETERS, self.p, self.ci95, strict=True)
        ):
            interval = (
                f"zero: {self.held[i]}"
                if i in self.held
                else "at its bound"
                if np.isnan(low)
                else f"[{low:.4g}, {high:.4g}]"
            )
            lines.append(f"  {symbol:4s} = {value:11.4g} {unit:12s} {interval:28s} {meaning}")
        if self.commanded:
            lines.append("  actuators: the data record commands only; no dynamics between command and actuator")
        else:
            lines += [
                f"  {symbol:10s} = {value:10.4g} {unit:6s} {meaning}"
                for (symbol, meaning, unit), value in zip(ACTUATOR_PARAMETERS, self.actuator_params, strict=True)
            ]
        lines += self.extension.describe() if self.extension is not None else []
        lines += (
            [f"  fit: {self.report.summary}", *([f"  {self.report.note}"] if self.report.note else [])]
            if self.report is not None
            else []
        )
        return "\n".join(lines + [f"  note: {n}" for n in self.particulars.notes])

    def _arrays(self) -> dict[str, np.ndarray]:
        return {"p": self.p, "ci95": self.ci95, **self._ship_arrays()}

    def _meta(self) -> dict[str, Any]:
        meta = self._ship_meta() | {"cost": float(self.cost)}
        if self.report is not None:
            meta["report"] = self.report.as_dict()
        return meta

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        num = len(PARAMETERS)
        check_shapes(arrays, {"p": (num,), "ci95": (num, 2)})
        self._restore_ship(arrays, meta)
        self.p, self.ci95, self.cost = arrays["p"], arrays["ci95"], float(meta["cost"])
        self.report = FitReport.from_dict(meta["report"]) if "report" in meta else None
        if self.extension is not None:
            self.held = self.extension.held()


PREDICTOR = Physics
