"""Tables of a diagnosis page."""

from __future__ import annotations

import math

import numpy as np

from ...diagnosis.evaluation.dependence import AXES
from ...diagnosis.evaluation.residuals import CHANNELS, ErrorTables, squared_error
from ...diagnosis.result import Diagnosis, Trace
from ...estimation.noise import CHANNEL_UNITS
from ...render.table import Table, TableColumn, number, significant
from ...signals import PSI, R, U, V
from .linked import fits, rollouts
from .text import detectable

LEVEL = 0.02
"""Greatest p-value of a significant dependence."""
_SIGNAL = {"heading": PSI, "surge": U, "sway": V, "yaw rate": R}
"""Motion signal of a channel, whose fit stands in the table of channels."""


def channels(trace: Trace, tables: ErrorTables, extended: bool) -> Table:
    """Table of the error of each channel of the open-loop predictions: root mean square, share, fit; of the baseline
    and of the extended model."""
    models = ("calibrated", "extended")[: 2 if extended else 1]
    three, zero = significant(3), number(0)
    columns = [TableColumn("channel", "channel"), *(TableColumn(f"RMS error, {m}", f"rms_{m}", three) for m in models)]
    columns += [TableColumn(f"fit, {m} [%]", f"fit_{m}", zero) for m in models] + [
        TableColumn("share of the error [%]", "share", zero)
    ]
    rows: list[dict[str, object]] = [
        {"channel": f"{c} [{CHANNEL_UNITS[c][0]}]", "share": 100.0 * tables.share[c]} for c in CHANNELS
    ]
    for model, predicted in zip(models, rollouts(trace, extended), strict=True):
        squares = squared_error(trace, predicted)[0].reshape(-1, len(CHANNELS))
        known = np.isfinite(squares)
        size = np.sqrt(np.where(known, squares, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))
        fitted = np.array([fits(m, p) for m, p in zip(trace.measured, predicted, strict=True)])
        for i, channel in enumerate(CHANNELS):
            rows[i][f"rms_{model}"] = float(size[i]) * CHANNEL_UNITS[channel][1]
            if channel in _SIGNAL and np.isfinite(fitted[:, _SIGNAL[channel]]).any():
                rows[i][f"fit_{model}"] = float(np.nanmedian(fitted[:, _SIGNAL[channel]]))
    notes = (
        "RMS error: root mean square over all time steps of all runs. Fit: NRMSE as in MATLAB's `compare`, median "
        "of the runs; 100 % is exact, "
        "0 % is no better than the mean.",
        "Share: of the squared errors of the calibrated ship, each divided by the variance of its channel within the "
        "runs.",
    )
    return Table("Error of each channel", columns, rows, notes)


def dependences(tables: ErrorTables) -> Table:
    """Table of the share of the missing force's variance that each variable explains, by axis."""
    found = {axis: {f.variable: f for f in tables.follows[axis]} for axis in AXES}
    names = list(dict.fromkeys(f.variable for axis in AXES for f in tables.follows[axis]))
    columns = [TableColumn("variable", "variable")]
    for axis in AXES:
        columns += [TableColumn(f"{axis} [%]", axis, number(0)), TableColumn(f"p, {axis}", f"p_{axis}", significant(2))]
    rows: list[dict[str, object]] = []
    for name in names:
        row: dict[str, object] = {"variable": name}
        for axis in AXES:
            if name in found[axis]:
                row |= {axis: 100.0 * found[axis][name].share, f"p_{axis}": found[axis][name].p}
        rows.append(row)
    notes = (
        "Share of the variance, less what chance explains. p: probability that the best of all variables reaches "
        f"this by chance; up to {LEVEL:g} it "
        "counts as a dependence.",
    )
    return Table("Variance of the missing force explained by each variable", columns, rows, notes)


def independent(tables: ErrorTables) -> list[str]:
    """Axes whose missing force shows no significant dependence."""
    return [axis for axis in AXES if not any(f.p <= LEVEL for f in tables.follows[axis])]


def gains(d: Diagnosis) -> Table:
    """Table of the held-out position error of every run before and after."""
    three = significant(3)
    columns = [
        TableColumn("run", "run"), TableColumn("before [m]", "before", three),
        TableColumn("after [m]", "after", three),
        TableColumn("less error [%]", "less", number(0)),
    ]  # fmt: skip
    rows = [
        {"run": n, "before": b, "after": a, "less": 100.0 * (1.0 - a / b) if b > 0 else None}
        for n, b, a in sorted(d.gain_per_run, key=lambda r: -r[1])
    ]
    return Table("Held-out position error of every run", columns, rows)


def candidates(d: Diagnosis) -> Table:
    """Table of every candidate effect, with its score and the reason why it was identified or not."""
    columns = [
        TableColumn("effect", "effect"), TableColumn("family", "family"),
        TableColumn("log Bayes factor", "factor", number(1)),
        TableColumn("p", "p", significant(2)), TableColumn("result", "result"),
    ]  # fmt: skip
    rows = [
        {"effect": c.effect, "family": c.family, "factor": 0.5 * c.score if math.isfinite(c.score) else None,
         "p": c.p_value if math.isfinite(c.p_value) else None, "result": c.rejected_because}
        for c in d.candidates
    ]  # fmt: skip
    notes = (
        "Log Bayes factor: gain in log evidence when this one effect is added to the calibrated ship. Score: twice "
        "that. "
        "p: probability that the best of all candidates reaches this score by chance.",
    )
    return Table("All candidates", columns, rows, notes)


def detection_limits(d: Diagnosis) -> Table:
    """Table of detection limits: the smallest size of each effect that these runs could have shown."""
    columns = [
        TableColumn("effect", "effect"),
        TableColumn("family", "family"),
        TableColumn("detection limit", "limit"),
    ]
    known = [(c, detectable(c)) for c in sorted(d.candidates, key=lambda c: (c.family, c.effect)) if c.detectable]
    rows = [{"effect": c.effect, "family": c.family, "limit": limit} for c, limit in known if limit != "-"]
    never = [c.effect for c, limit in known if limit == "-"]
    notes = (
        "The smallest effect that these runs could have shown. A larger one would probably have been named. A "
        "smaller one may be present.",
        *([f"These runs cannot show {', '.join(never)}."] if never else []),
        "Effects that are not listed are "
        "looked for in another way.",
    )  # fmt: skip
    return Table("Detection limits", columns, rows, notes)


def whiteness(tables: ErrorTables) -> Table:
    """Table of the Ljung-Box statistic of each residual over its 95 % limit."""
    columns = [
        TableColumn("residual", "residual"),
        TableColumn("Ljung-Box / 95 % limit", "ratio", number(2)),
        TableColumn("result", "result"),
    ]
    rows = [
        {"residual": name, "ratio": v, "result": "white" if v <= 1.0 else "not white"}
        for name, v in tables.white.items()
    ]
    return Table("Are the residuals white?", columns, rows)


def against_inputs(tables: ErrorTables) -> Table:
    """Table of pairs of residual and earlier input whose greatest correlation is beyond its 95 % bound."""
    columns = [
        TableColumn("residual", "residual"),
        TableColumn("input", "input"),
        TableColumn("correlation / 95 % bound", "ratio", number(2)),
    ]
    beyond = sorted(((v, *pair) for pair, v in tables.inputs.items() if v > 1.0), reverse=True)
    return Table(
        "Residuals correlated with earlier inputs",
        columns,
        [{"residual": n, "input": label, "ratio": v} for v, n, label in beyond],
    )
