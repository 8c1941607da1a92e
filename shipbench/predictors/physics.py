"""The source paper's physics: eq. (2) to (8) with 11 parameters fitted by constrained nonlinear least squares over whole rollouts (eq. 9)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import WorkError
from ..integrate import motion_rhs, rk4_step
from ..physics import eq2
from ..physics.actuators import lag_with_rate_limit
from ..physics.wind import apparent_wind
from ..records import Dataset
from ..ship import Ship, complete
from ..signals import ACTUATORS, COMMANDS, MOTION
from ._actuator_fit import DEFAULT_ACTUATORS, fit_actuators
from .base import History, PredictorBase

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
ACTUATOR_PARAMETERS = (
    ("T_n", "shaft time constant", "s"), ("rate_n", "shaft rate limit", "rpm/s"),
    ("T_delta", "rudder time constant", "s"), ("rate_delta", "rudder rate limit", "rad/s"),
    ("T_F", "thruster time constant", "s"), ("rate_F", "thruster rate limit", "N/s"),
)  # fmt: skip


@dataclass
class Physics(PredictorBase):
    """Fitted eq. (2) to (8).

    Args:
        iterations: most Gauss-Newton steps of the fit.
        tolerance: relative decrease of the cost below which the fit stops.
    """

    iterations: int = 30
    tolerance: float = 1e-4
    name: ClassVar[str] = "physics"

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Fit actuator dynamics, then p0..p10, over full rollouts of all runs of `train` and `valid` (nothing is tuned on `valid`).

        Raises:
            WorkError: the fit found no finite rollouts.
        """
        from ._physics_fit import fit_parameters  # casadi is loaded only for fitting

        data = train.merged(valid)
        self._set_ship(data.ship, data.inputs, data.dt, data.actuators == "commanded")
        batch = data.batch()
        if not self.commanded:
            self.actuator_params = fit_actuators(batch, self.dt)
        result = fit_parameters(
            self.c, batch, self.actuator_path(batch.s0, batch.U), self._wind(batch.U), self.dt, self.substeps, self.iterations, self.tolerance
        )
        if not np.isfinite(result.cost):
            raise WorkError(f"the physics fit of '{data.name}' found no finite rollouts; check units and signs with `shipbench data check`.")
        self.p, self.ci95, self.cost = result.p, result.ci95, result.cost
        return self

    def _set_ship(self, ship: Ship, inputs: tuple[str, ...], dt: float, commanded: bool) -> None:
        self.ship, self.inputs, self.dt, self.commanded = ship, inputs, dt, commanded
        self.particulars = complete(ship)
        self.c = eq2.coefficients(self.particulars)
        self.actuator_params = DEFAULT_ACTUATORS.copy()
        # One step a second serves 100 m; the time scale of a ship goes with sqrt(L) (Froude).
        self.substeps = max(1, int(np.ceil(dt / (0.15 * np.sqrt(self.c.L)) - 1e-9)))

    def actuators_after(self, actuators: np.ndarray, commands: np.ndarray, dt: float) -> np.ndarray:
        """Actuator states (..., 4) after `dt` seconds of held commands (..., 4); they are the commands themselves where none were measured."""
        if self.commanded:
            return commands.copy()
        T_n, rate_n, T_d, rate_d, T_F, rate_F = self.actuator_params
        pairs = ((T_n, rate_n), (T_d, rate_d), (T_F, rate_F), (T_F, rate_F))
        return np.stack([lag_with_rate_limit(actuators[..., i], commands[..., i], dt, T, rate) for i, (T, rate) in enumerate(pairs)], axis=-1)

    def actuator_path(self, s0: np.ndarray, U: np.ndarray) -> np.ndarray:
        """n, delta, F_b, F_s at the beginning, middle and end of every substep, (batch, K * substeps, 3, 4)."""
        h = self.dt / self.substeps
        path = np.empty((len(s0), U.shape[1] * self.substeps, 3, 4))
        now = s0[:, ACTUATORS]
        for j in range(path.shape[1]):
            command = U[:, j // self.substeps, : len(COMMANDS)]
            path[:, j, 0] = command if self.commanded else now
            path[:, j, 1] = self.actuators_after(now, command, 0.5 * h)
            now = self.actuators_after(now, command, h)
            path[:, j, 2] = now
        return path

    def _wind(self, U: np.ndarray) -> np.ndarray | None:
        """Measured wind speed and direction (batch, K, 2), or None."""
        if not {"wind_speed", "wind_from"} <= set(self.inputs):
            return None
        return U[..., [self.inputs.index("wind_speed"), self.inputs.index("wind_from")]]

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        path, air = self.actuator_path(s0, U), self._wind(U)
        S = np.empty((len(s0), U.shape[1], s0.shape[1]))
        motion = tuple(s0[:, MOTION].T)
        h = self.dt / self.substeps
        with np.errstate(all="ignore"):  # a diverged run becomes non-finite and is reported as such by the runner
            for j in range(path.shape[1]):
                k = j // self.substeps

                def acc(psi, u, v, r, stage, j=j, k=k):
                    wind = None if air is None else apparent_wind(psi, u, v, air[:, k, 0], air[:, k, 1])
                    n, delta, F_b, F_s = path[:, j, stage].T
                    return eq2.accelerations(u, v, r, n, delta, F_b, F_s, wind, self.c, list(self.p))

                motion = rk4_step(motion_rhs(acc), motion, h)
                S[:, k, MOTION] = np.stack(motion, axis=-1)
        S[:, :, ACTUATORS] = path[:, self.substeps - 1 :: self.substeps, 2]
        return S

    def describe(self) -> str:
        """The fitted equations with units and 95 % confidence intervals (clustered over runs), and what was estimated of the ship."""
        lines = [
            f"physics of {self.ship.name}: eq. (2) to (8), left side from Inoue (1981), Clarke (1983) and Soeding (1982)",
            f"  surge  {self.c.m + self.c.m_x:.4g} du = {self.c.X_vr:.4g} v r + {self.c.X_rr:.4g} r^2 + X_n + X_delta + X_e - R",
            f"  sway   {self.c.m11:.4g} dv + {self.c.m12_Y:.4g} dr = {self.c.Y_v:.4g} U v + ({self.c.Y_r:.4g} U - {self.c.m:.4g} u) r "
            f"+ {self.c.Y_vv:.4g} v|v| + {self.c.Y_vr:.4g} v|r| + {self.c.Y_rr:.4g} r|r| + Y_n + Y_delta + Y_e",
            f"  yaw    {self.c.m12_N:.4g} dv + {self.c.m22:.4g} dr = {self.c.N_v:.4g} U v + ({self.c.N_r:.4g} U - {self.c.m * self.c.x_G:.4g} u) r "
            f"+ {self.c.N_rr:.4g} r|r| + {self.c.N_vvr:.4g} v^2 r/U + {self.c.N_vrr:.4g} v r^2/U + N_n + N_delta + N_e   [SI]",
            "  Y_n = p0 X_n; R = p1 u + p2 u|u| + p3 u^3; c_L = p4 + p5 a + p6 a^2 + p7 a^3; c_D = p8 + p9 a + p10 a^2 [a in rad]",
        ]
        for (symbol, meaning, unit), value, (low, high) in zip(PARAMETERS, self.p, self.ci95, strict=True):
            interval = "at its bound" if np.isnan(low) else f"[{low:.4g}, {high:.4g}]"
            lines.append(f"  {symbol:4s} = {value:11.4g} {unit:12s} {interval:28s} {meaning}")
        if self.commanded:
            lines.append("  actuators: the data record commands only; no dynamics between command and actuator")
        else:
            lines += [
                f"  {symbol:10s} = {value:10.4g} {unit:6s} {meaning}"
                for (symbol, meaning, unit), value in zip(ACTUATOR_PARAMETERS, self.actuator_params, strict=True)
            ]
        return "\n".join(lines + [f"  note: {n}" for n in self.particulars.notes])

    def _arrays(self) -> dict[str, np.ndarray]:
        return {"p": self.p, "ci95": self.ci95, "actuators": self.actuator_params}

    def _meta(self) -> dict[str, Any]:
        return {"ship": self.ship.model_dump(exclude_none=True), "dt": self.dt, "commanded": self.commanded, "cost": float(self.cost)}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        self._set_ship(Ship.from_dict(meta["ship"], "saved model"), self.inputs, float(meta["dt"]), bool(meta["commanded"]))
        self.p, self.ci95, self.actuator_params, self.cost = arrays["p"], arrays["ci95"], arrays["actuators"], float(meta["cost"])


PREDICTOR = Physics
