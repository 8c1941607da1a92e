"""Plots of a leaderboard: tracks, box plots and error against horizon, from saved predictions. PNG, drawn without a
display."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bench.results import Cell, read_predictions, read_truth
from ..bench.submissions import Results
from ..errors import InputError
from ..metrics.ed import ed
from ..names import shown
from ..signals import PSI, X, Y
from ..storage import Frame, in_one_step

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, told apart with every common colour blindness; line styles differ too.
_PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_KNOWN = {
    "physics": "#0072B2",
    "mlp": "#D55E00",
    "neural_ode": "#009E73",
    "lstm": "#CC79A7",
    "hold": "#8C8C8C",
    "oracle": "#E69F00",
}
_DASHES: dict[str, Any] = {
    "physics": "-", "neural_ode": (0, (5, 1.5)), "mlp": (0, (3, 1, 1, 1)), "lstm": (0, (1, 1)), "hold": (0, (7, 3)),
    "oracle": (0, (1, 2)),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Prediction:
    """Scored windows of one model and cell: ids, s0 (batch, 10), truth and S (batch, K, 10), and a mask of those that
    are scored."""

    ids: tuple[str, ...]
    s0: np.ndarray
    truth: np.ndarray
    S: np.ndarray
    ok: np.ndarray


def _predictions(results: Results, dataset: str, model: str) -> Iterator[_Prediction]:
    """Cells of a model that hold predictions; of several seeds the first."""
    found = [
        (s, p)
        for s, p in zip(results.summaries, results.sources, strict=True)
        if s["dataset"] == dataset and s["model"] == model
    ]
    first = min((s["seed"] for s, _ in found), default=0)
    for summary, source in found:
        if summary["seed"] != first:
            continue
        S = read_predictions(source, Cell(dataset, model, summary["fold"], summary["seed"]))
        if S is not None:
            batch = read_truth(source, dataset, summary["fold"])
            if S.shape != batch.truth.shape or len(S) != len(summary["run_status"]):
                raise InputError(f"{source}: predictions of shape {S.shape} for a truth of shape {batch.truth.shape}.")
            yield _Prediction(batch.ids, batch.s0, batch.truth, S, np.array([s == "ok" for s in summary["run_status"]]))


def _readable(results: Results, dataset: str, model: str) -> bool:
    """Whether any scored window of the model can be drawn."""
    try:
        return any(cell.ok.any() for cell in _predictions(results, dataset, model))
    except InputError:
        return False


def short_name(model: str) -> str:
    """Spec shortened for a legend: no folders, at most 28 characters."""
    name = Path(model).name if "/" in model else model
    return plain(name if len(name) <= 28 else f"{name[:25]}...")


def plain(text: str) -> str:
    """Text with dollar signs escaped: matplotlib would read a formula between them."""
    return shown(text).replace("$", r"\$")


def style(models: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Colour and dashes of each model: the same for a known name in every plot."""
    bases: dict[str, str] = {}  # of variants such as mlp and mlp[hidden=64] the first has the name's colour
    for model in sorted(models, key=len):
        bases.setdefault(re.split(r"[\[+]", model)[0], model)
    known = {model: base for base, model in bases.items() if base in _KNOWN}
    free = [c for c in _PALETTE if c not in {_KNOWN[base] for base in known.values()}] or list(_PALETTE)
    others = itertools.cycle(free)
    return {
        m: {"color": _KNOWN[known[m]], "linestyle": _DASHES[known[m]]}
        if m in known
        else {"color": next(others), "linestyle": "-"}
        for m in models
    }


def new_figure(width: float, height: float) -> Figure:
    """Figure on the Agg canvas, without pyplot's global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: Path) -> Path:
    """Write a figure atomically and return its path."""
    with in_one_step(path, suffix=path.suffix) as part:
        figure.savefig(part)
    return path


def drawable(results: Results, dataset: str, ranking: Sequence[str]) -> tuple[list[str], list[str]]:
    """Models with a scored run: those with saved predictions, and those without."""
    rows = results.rows[results.rows["dataset"] == dataset]
    scored = set(rows.loc[rows["status"] == "ok", "model"])
    models: list[str] = []
    without: list[str] = []
    for model in (m for m in ranking if m in scored):
        (models if _readable(results, dataset, model) else without).append(model)
    return models, without


def draw_all(
    results: Results,
    dataset: str,
    ranking: Sequence[str],
    folder: Path,
    tell: Callable[[str], None] = lambda line: None,
) -> list[Path]:
    """Draw every plot of a data set into `folder`. Models without a single scored run are left out, and those without
    saved predictions; `tell` gets one line on the latter."""
    rows = results.rows[results.rows["dataset"] == dataset]
    models, without = drawable(results, dataset, ranking)
    if without:
        what = (
            f"plots without {', '.join(without[:5])}{' and others' if len(without) > 5 else ''}"
            if models
            else "no plots"
        )
        tell(f"{what}: no saved predictions. Give the folder that `shipbench run` wrote, whole, or --no-plots.")
    if not models:
        return []
    summary = next(s for s in results.summaries if s["dataset"] == dataset)
    return [
        save(tracks(results, dataset, models, summary), folder / "tracks.png"),
        save(boxes(rows, models, summary), folder / "errors.png"),
        save(against_horizon(results, dataset, models, summary["dt"]), folder / "error-against-horizon.png"),
    ]


def choose_runs(rows: Frame, models: Sequence[str]) -> dict[str, str]:
    """Names of a good, a median and a bad run: the 10, 50 and 90 % points of the models' median ED (baseline and oracle
    left out)."""
    compared = [m for m in models if m not in ("hold", "oracle")] or list(models)
    scored = rows[(rows["status"] == "ok") & rows["model"].isin(compared)]
    order = scored.groupby("run")["ed"].median().sort_values().index
    places = {"good": 0.1, "median": 0.5, "bad": 0.9}
    return {name: str(order[round(q * (len(order) - 1))]) for name, q in places.items()}


def outline(x: float, y: float, psi: float, L: float, B: float) -> np.ndarray:
    """Corners (east, north) [m] of a ship's deck with its bow at heading `psi` [rad]."""
    ahead = L * np.array([0.5, 0.3, -0.44, -0.5, -0.5, -0.44, 0.3])
    starboard = B * np.array([0.0, 0.5, 0.5, 0.3, -0.3, -0.5, -0.5])
    return np.stack(
        [y + ahead * np.sin(psi) + starboard * np.cos(psi), x + ahead * np.cos(psi) - starboard * np.sin(psi)], axis=1
    )


def tracks(
    results: Results, dataset: str, models: Sequence[str], summary: dict[str, Any], runs: Sequence[str] = ()
) -> Figure:
    """Figure of the tracks of `runs`, or of a good, a median and a bad one; the true ship every quarter of the horizon,
    the predicted ones at its end."""
    rows = results.rows[results.rows["dataset"] == dataset]
    chosen = {plain(run): run for run in runs} or {
        f"{name} run: {plain(run)}": run for name, run in choose_runs(rows, models).items()
    }
    figure = new_figure(5.0 * len(chosen), 6.2)
    axes = np.atleast_1d(figure.subplots(1, len(chosen)))
    styles = style(models)
    for model in reversed(models):  # the best on top
        for cell in _predictions(results, dataset, model):
            for axis, run in zip(axes, chosen.values(), strict=True):
                if run in cell.ids and cell.ok[cell.ids.index(run)]:
                    i = cell.ids.index(run)
                    _track(
                        axis, cell.s0[i], cell.truth[i], summary, label="true", color="black", linestyle="-", fill=True
                    )
                    _track(axis, cell.s0[i], cell.S[i], summary, label=model, **styles[model])
    for axis, (title, run) in zip(axes, chosen.items(), strict=True):
        error = rows[(rows["run"] == run) & (rows["status"] == "ok")].groupby("model")["ed"].mean()
        axis.set_title(title, fontsize=11)
        axis.set_xlabel("east y [m]")
        axis.set_ylabel("north x [m]")
        axis.set_aspect("equal", adjustable="datalim")
        axis.grid(alpha=0.25)
        handles = dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
        if not handles:  # none of the drawn models predicted this run
            continue
        order = ["true", *[m for m in models if m in handles]]
        texts = ["true", *[f"{short_name(m)} (ED {error[m]:.3g} m)" for m in order[1:]]]
        axis.legend(
            [handles[m] for m in order], texts, fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2
        )
    about = f"{plain(dataset)}: tracks over {summary['task']['horizon_s']:g} s"
    figure.suptitle(
        f"{about}; the true ship every quarter, the predicted ones at the end" if len(chosen) > 1 else about,
        fontsize=12,
    )
    return figure


def _track(
    axis: Axes,
    s0: np.ndarray,
    states: np.ndarray,
    summary: dict[str, Any],
    *,
    label: str,
    color: str,
    linestyle: Any,
    fill: bool = False,
) -> None:
    """Draw one line from s0 through the states, with ships; the true track (`fill`) is drawn once per axis."""
    if label == "true" and label in axis.get_legend_handles_labels()[1]:
        return
    path = np.concatenate([s0[None], states])
    axis.plot(
        path[:, Y],
        path[:, X],
        color=color,
        linestyle=linestyle,
        lw=2.6 if fill else 1.8,
        label=label,
        zorder=2 if fill else 3,
    )
    quarters = np.linspace(0, len(path) - 1, 5).round().astype(int)
    for k in quarters if fill else quarters[-1:] if label != "oracle" else []:
        corners = outline(path[k, X], path[k, Y], path[k, PSI], summary["ship_L"], summary["ship_B"])
        axis.fill(
            *corners.T,
            facecolor="0.85" if fill else "none",
            edgecolor=color,
            lw=0.9,
            alpha=0.9,
            zorder=1 if fill else 3,
        )


def _readable_limits(axis: Axes, groups: Sequence[np.ndarray]) -> None:
    """Set axes linear from zero, or logarithmic where the models' medians lie more than a factor of 12 apart."""
    medians = np.array([np.median(g) for g in groups])
    positive = medians[medians > 0]
    if len(positive) and positive.max() > 12 * positive.min():
        axis.set_yscale("log")
        low = max(min(float(np.quantile(g, 0.05)) for g in groups if np.median(g) > 0), 1e-4 * positive.max())
        axis.set_ylim(bottom=low / 1.5)
    else:
        axis.set_ylim(bottom=0)


def boxes(rows: Frame, models: Sequence[str], summary: dict[str, Any]) -> Figure:
    """Box plots of the per-run ED, EDH and cVDM (the paper's fig. 2): quartiles, whiskers at 5 and 95 %, mean as a
    diamond."""
    columns = [c for c in summary["columns"] if c["name"] in ("ed", "edh", "cvdm")]
    figure = new_figure(4.6 * len(columns), 4.6)
    styles = style(models)
    for axis, column in zip(np.atleast_1d(figure.subplots(1, len(columns))), columns, strict=True):
        groups = [
            rows.loc[(rows["model"] == m) & (rows["status"] == "ok"), column["name"]].dropna().to_numpy()
            for m in models
        ]
        shown = [(m, g) for m, g in zip(models, groups, strict=True) if len(g)]
        if not shown:
            continue
        drawn = axis.boxplot(
            [g for _, g in shown], whis=(5, 95), showmeans=True, widths=0.62, patch_artist=True,
            medianprops={"color": "black", "lw": 1.6},
            flierprops={"marker": ".", "ms": 4, "mec": "0.45", "mfc": "0.45"},
            meanprops={"marker": "D", "mfc": "white", "mec": "black", "ms": 5},
        )  # fmt: skip
        for patch, (model, _) in zip(drawn["boxes"], shown, strict=True):
            patch.set(facecolor=styles[model]["color"], alpha=0.75)
        axis.set_xticks(range(1, len(shown) + 1), [short_name(m) for m, _ in shown], rotation=25, ha="right")
        axis.set_ylabel(f"{column['label']} [{column['unit']}]")
        axis.grid(axis="y", alpha=0.25)
        _readable_limits(axis, [g for _, g in shown])
    what = (
        f"error of each run (mean over {summary['task']['horizon_s']:g} s); box quartiles, whiskers 5 to 95 %, "
        "diamond mean"
    )
    figure.suptitle(f"{plain(summary['dataset'])}: {what}", fontsize=11)
    return figure


def against_horizon(results: Results, dataset: str, models: Sequence[str], dt: float) -> Figure:
    """Figure of the position error against time: median over runs, with the band between the quartiles."""
    figure = new_figure(8.6, 5.4)
    axis = figure.subplots()
    styles = style(models)
    ends, last = [], 0.0
    for model in models:
        errors = np.concatenate([ed(true=c.truth[c.ok], pred=c.S[c.ok]) for c in _predictions(results, dataset, model)])
        low, middle, high = np.quantile(errors, [0.25, 0.5, 0.75], axis=0)
        t = dt * np.arange(1, errors.shape[1] + 1)
        axis.plot(t, middle, lw=2, label=f"{short_name(model)} ({middle[-1]:.3g} m at the end)", **styles[model])
        axis.fill_between(t, low, high, color=styles[model]["color"], alpha=0.13, lw=0)
        ends.append(errors[:, -1])
        last = max(last, float(t[-1]))
    _readable_limits(axis, ends)
    axis.set_xlim(0, last)
    axis.set_xlabel("time after the start t [s]")
    axis.set_ylabel("position error ED [m]")
    axis.grid(alpha=0.25, which="both" if axis.get_yscale() == "log" else "major")
    axis.legend(fontsize=9)
    axis.set_title(f"{plain(dataset)}: error against horizon (median and quartiles over runs)", fontsize=11)
    return figure
