"""Tables of scores of a leaderboard: the paper's Table III, errors against horizon, of signals and kinds of manoeuvre,
status and cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..bench.results import STATUSES
from ..bench.scoring import BAND
from ..metrics.trial_indices import COLUMNS as TRIAL_COLUMNS
from ..render.table import Table, TableColumn, display_unit, number, significant
from .scores import CEILING, STATISTICS, Scores
from .statistics import interval

TABLE_III = ("ed", "edh", "cvdm")
MU, SIGMA = "\u03bc", "\u03c3"
SYMBOLS = {"mean": MU, "median": "m", "std": SIGMA, "iqr": "IQR"}
_WHOLE_RUN = ("final_displacement", "position_rmse", "heading_error")
_NO_SIGNAL = {*TABLE_III, *_WHOLE_RUN, *(c.name for c in TRIAL_COLUMNS)}

# Seed paper, Table III: mu, m, sigma, IQR on the paper's own 90 trajectories, which are not public.
PAPER = {
    "paper: physics": {
        "ed": (13.52, 10.82, 10.31, 13.10),
        "edh": (18.79, 15.59, 14.52, 17.87),
        "cvdm": (14.23, 13.27, 8.24, 8.83),
    },
    "paper: MLP": {
        "ed": (20.84, 17.10, 12.94, 17.87),
        "edh": (28.49, 22.62, 18.37, 22.86),
        "cvdm": (28.95, 22.99, 20.45, 20.10),
    },
}
PAPER_DATASET = "harbour90"
FEW_RUNS = 10
"""Number of runs below which a page says that intervals and p-values are rough; it changes nothing else."""


def table_iii(scores: Scores) -> Table:
    """Table of mean, median, spread and interquartile range of ED, EDH and cVDM."""
    columns, shares = scores.columns, scores.shares
    metrics = [m for m in TABLE_III if m in columns]
    figures = {m: scores.figures(m, STATISTICS) for m in metrics}
    lines, place = [], 0
    for model in scores.models:
        place += model != CEILING
        scored, expected = shares[model]
        line: dict[str, Any] = {
            "rank": "" if model == CEILING else str(place),
            "model": model,
            "runs": f"{scored}/{expected}",
        }
        own = scores.scored[scores.scored["model"] == model]
        line |= {
            f"_{m}_middle": tuple(own[m].quantile([0.25, 0.75])) for m in metrics
        }  # drawn on the page, in no table
        lines.append(line | {key: value for m in metrics for key, value in figures[m][model].items()})
    notes = [
        f"{', '.join(columns[m]['label'] + ' in ' + columns[m]['unit'] for m in metrics)}: averaged over the "
        "predicted time steps of each run; "
        f"{MU} mean, m median, {SIGMA} standard deviation (n - 1), IQR interquartile range over the runs of a fold; "
        "then the mean over folds (and seeds). Intervals: 95 %, bootstrap over runs."
    ]
    runs = scores.matched.clusters
    if runs < FEW_RUNS:
        notes.append(f"Only {runs} runs: with so few, intervals are rough.")
    if any(scored < expected for scored, expected in shares.values()):
        notes.append(
            "Runs: scored of expected. A model with unscored runs ranks below all complete ones; the reasons stand "
            "below."
        )
    for model in (m for m in scores.matched.comparable if m not in scores.matched.complete):
        notes.append(
            f"`{model}` covers {shares[model][0]} of {shares[model][1]} windows; its means are of those. The table of "
            "pairs compares it with each model on the same windows."
        )
    undefined = int(scores.scored[metrics].isna().any(axis=1).sum())
    if undefined:
        notes.append(f"In {undefined} rows the true ship does not move: cVDM has no scale there and leaves them out.")
    if CEILING in scores.models:
        notes.append("`oracle` is the simulator itself: the ceiling, not ranked.")
    if scores.beside_paper:
        lines += [
            {"model": name, "_reference": True}
            | {f"{m}_{s}": v for m in metrics for s, v in zip(STATISTICS, values[m], strict=True)}
            for name, values in PAPER.items()
        ]
        notes.append(
            "In italics: Table III of the source paper, on its own 90 runs (not public); same metrics, other data."
        )
    head = [TableColumn("#", "rank"), TableColumn("model", "model"), TableColumn("runs", "runs")]
    heads = {
        f"{m}_{s}": f"{columns[m]['label']} {SYMBOLS[s]} [{columns[m]['unit']}]" for m in metrics for s in STATISTICS
    }
    shown = [TableColumn(text, key, number(2), interval=True) for key, text in heads.items()]
    return Table("Errors over the horizon (layout of the paper's Table III)", head + shown, lines, notes)


def claim(scores: Scores) -> Table:
    """Table of the error of `physics` relative to `mlp`, beside the paper's two rows."""
    here: dict[str, Any] = {"where": "here"}
    there: dict[str, Any] = {"where": "paper", "_reference": True}
    for metric in (m for m in TABLE_III if m in scores.rows):
        means = scores.means(metric)
        for i, s in enumerate(STATISTICS):
            nan = float("nan")
            here[f"{metric}_{s}"] = 100.0 * (1.0 - means["physics"].get(s, nan) / means["mlp"].get(s, nan))
            there[f"{metric}_{s}"] = 100.0 * (1.0 - PAPER["paper: physics"][metric][i] / PAPER["paper: MLP"][metric][i])
    keys = [k for k in here if k != "where"]
    header = {
        k: f"{'cVDM' if k.startswith('cvdm') else k.split('_')[0].upper()} {SYMBOLS[k.split('_')[1]]}" for k in keys
    }
    columns = [TableColumn("", "where"), *[TableColumn(header[k], k, number(1)) for k in keys]]
    return Table("`physics` below `mlp`, in percent", columns, [here, there])


def _mean_table(title: str, scores: Scores, chosen: list[dict[str, str]], notes: Sequence[str] = ()) -> Table:
    """Table of the mean over folds of the fold means of the `chosen` columns, in the units of display."""
    units = {c["name"]: display_unit(c["unit"]) for c in chosen}
    figures = {c["name"]: scores.figures(c["name"], factor=units[c["name"]][1]) for c in chosen}
    lines: list[dict[str, Any]] = []
    for model in scores.models:
        renamed = {
            key.replace(f"{name}_mean", name, 1): value
            for name in figures
            for key, value in figures[name][model].items()
        }
        lines.append({"model": model} | renamed)
    shown = [
        TableColumn(f"{c['label']} [{units[c['name']][0]}]", c["name"], significant(3), interval=True) for c in chosen
    ]
    return Table(title, [TableColumn("model", "model"), *shown], lines, notes)


def horizon_table(scores: Scores) -> Table:
    """Table of the position error at fixed times, at the end, over the run; heading error."""
    at_times = [c for n, c in scores.columns.items() if n.startswith("ed_at_")]
    chosen = at_times + [scores.columns[n] for n in _WHOLE_RUN if n in scores.columns]
    note = (
        "Mean over runs and folds. `ED at t` is the position error at that time; heading error is the mean of "
        "|dpsi| over the run."
    )
    return _mean_table("Error against horizon", scores, chosen, [note])


def signal_table(scores: Scores) -> Table:
    """Table of all other columns: the error of each signal in its own unit."""
    rest = [c for n, c in scores.columns.items() if n not in _NO_SIGNAL and not n.startswith(("ed_at_", BAND))]
    note = "Mean over runs and folds of the root mean square over the run, each in its own unit."
    return _mean_table("Error of each signal", scores, rest, [note])


def band_table(scores: Scores) -> Table | None:
    """Table of the 90 % bands: share of the measurements inside at fixed times [%], mean width, mean interval score;
    None where no study asked for bands."""
    chosen = [c for n, c in scores.columns.items() if n.startswith(BAND)]
    if not chosen:
        return None
    note = (
        "Mean over runs and folds. Inside: share of the measurements in the band, wanted 90 %; position counts north "
        "and east apart. Interval score: width of the band plus 20 times the distance of a measurement outside it; "
        "the smaller the better."
    )
    notes = [note]
    without = scores.scored.groupby("model")[chosen[-1]["name"]].count().eq(0)
    if without.any():
        notes.append("A dash: no band. The reason is `no_band` in summary.json, if the study asked for bands.")
    return _mean_table("90 % bands", scores, chosen, notes)


def kind_table(scores: Scores) -> Table:
    """Table of the mean over the windows of each kind of manoeuvre."""
    metric = scores.columns.get("position_rmse", scores.columns["ed"])
    counts = scores.rows.drop_duplicates(["fold", "run"])["kind"].value_counts()
    kinds = sorted(counts.index)
    members = {kind: scores.rows["kind"] == kind for kind in kinds}
    lines = group_lines(scores, metric["name"], members)
    shown = [TableColumn(f"{k or 'other'} ({counts[k]})", k, significant(3), interval=True) for k in kinds]
    title = f"{metric['label'][0].upper()}{metric['label'][1:]} by kind of manoeuvre [{metric['unit']}]"
    notes = ["Mean over all scored windows of the kind (their number in brackets)."]
    runs = scores.rows.groupby("kind")["cluster"].nunique()
    single = [f"'{kind or 'other'}'" for kind in kinds if runs[kind] == 1]
    if single:
        notes.append(f"No interval for {', '.join(single)}: all windows are of one run.")
    return Table(title, [TableColumn("model", "model"), *shown], lines, notes)


def group_lines(scores: Scores, column: str, members: dict[str, Any]) -> list[dict[str, Any]]:
    """Mean of `column` by model over the rows of each group (name -> mask of the rows), with intervals over runs."""
    lines = []
    models, scored = scores.rows["model"].to_numpy(), (scores.rows["status"] == "ok").to_numpy()
    values, codes = scores.rows[column].to_numpy(float), scores.boot.codes(scores.rows["cluster"].tolist())
    for model in scores.models:
        line: dict[str, Any] = {"model": model}
        own = scored & (models == model)
        for name, chosen in members.items():
            at = np.flatnonzero(own & np.asarray(chosen))
            if not len(at):
                continue
            drawn = scores.boot.means(codes[at], values[at, None], values[at, None] * 0 + 1.0)[:, 0]
            low, high = interval(drawn, len(np.unique(codes[at])))
            line |= {name: float(np.nanmean(values[at])), f"{name}_low": low, f"{name}_high": high}
        lines.append(line)
    return lines


def status_table(scores: Scores, parameters: dict[str, float]) -> Table:
    """Table of statuses with their reasons, and the cost of a model: time of a fit and of a rollout [s], number of
    fitted parameters (`parameters`)."""
    lines, notes = [], []
    for model in scores.models:
        part = scores.rows[scores.rows["model"] == model]
        counts = part["status"].value_counts()
        cells = part.drop_duplicates(["fold", "seed"])
        done = cells[cells["status"].isin(["ok", "diverged"])]
        shared = int(cells["fit_shared_by"].max())
        cost = {
            "fit_s": float(done["fit_s"].mean()),
            "predict_ms": 1e3 * float(done["predict_s"].mean()),
            "parameters": parameters.get(model),
        }
        lines.append(
            {
                "model": model,
                "shared": str(shared) if shared > 1 else "",
                **cost,
                **{s: int(counts.get(s, 0)) for s in STATUSES},
            }
        )
        for (status, reason), same in part[part["status"] != "ok"].groupby(["status", "reason"], sort=False):
            first = same.iloc[0]
            notes.append(
                f"`{model}` {status} in {len(same)} rows (fold {first['fold']}, run {first['run']}): {reason}."
            )
    folded = [*notes[:20], f"... and {len(notes) - 20} more reasons (in the rows)."] if len(notes) > 20 else notes
    columns = [TableColumn("model", "model"), *[TableColumn(s, s, str) for s in STATUSES]]
    columns += [
        TableColumn("fit [s]", "fit_s", significant(3)), TableColumn("fitted together", "shared"),
        TableColumn("predict [ms]", "predict_ms", significant(3)),
    ]  # fmt: skip
    about = (
        "Fit: seconds per fold and seed; fits that ran together share their time equally. Predict: per rollout, "
        "in one batch."
    )
    if parameters:
        columns.append(TableColumn("parameters", "parameters", number(0)))
        about += " Parameters: numbers that a fit sets, scales of inputs and outputs not counted."
    return Table("Status and cost", columns, lines, [about, *folded])
