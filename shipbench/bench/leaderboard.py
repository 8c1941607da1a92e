"""The leaderboard of a data set, rendered from saved rows only."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from .results import PROTOCOL, STATUSES, Frame, Results
from .tables import Table, TableColumn, display_unit, number, significant

TABLE_III = ("ed", "edh", "cvdm")
STATISTICS = ("mean", "median", "std", "iqr")
MU, SIGMA = "\u03bc", "\u03c3"
SYMBOLS = {"mean": MU, "median": "m", "std": SIGMA, "iqr": "IQR"}
CEILING = "oracle"
_WHOLE_RUN = ("final_displacement", "position_rmse", "heading_error")

# Seed paper, Table III: mu, m, sigma, IQR on the paper's own 90 trajectories, which are not public.
PAPER = {
    "paper: physics": {"ed": (13.52, 10.82, 10.31, 13.10), "edh": (18.79, 15.59, 14.52, 17.87), "cvdm": (14.23, 13.27, 8.24, 8.83)},
    "paper: MLP": {"ed": (20.84, 17.10, 12.94, 17.87), "edh": (28.49, 22.62, 18.37, 22.86), "cvdm": (28.95, 22.99, 20.45, 20.10)},
}
PAPER_DATASET = "harbour90"


@dataclass(frozen=True, eq=False)
class Board:
    """Tables of one data set, best model first; `ranking` holds the model specs in that order."""

    dataset: str
    ranking: list[str]
    tables: list[Table]
    head: list[str]
    """Lines on where the figures come from."""

    def markdown(self, command: str, plots: Sequence[str] = ()) -> str:
        """The whole page; `command` is what rendered it, `plots` are image paths relative to it."""
        lines = [f"# Leaderboard: {self.dataset}", "", *[f"- {line}" for line in self.head], f"- Rendered by `{command}`.", ""]
        tables = [table.markdown() for table in self.tables]
        images = [f"![{Path(p).stem.replace('-', ' ')}]({p})\n" for p in plots]
        return "\n".join(["\n".join(lines), *tables[:1], *images, *tables[1:]])

    def as_json(self) -> dict[str, Any]:
        """Everything as plain data."""
        return {"dataset": self.dataset, "ranking": self.ranking, "about": self.head, "tables": [t.as_json() for t in self.tables]}


def build_board(results: Results, dataset: str) -> Board:
    """The leaderboard of `dataset`.

    Raises:
        InputError: the rows are of different protocols, data (fingerprints) or tasks, which are never ranked together.
    """
    rows = results.rows[results.rows["dataset"] == dataset]
    summaries = [s for s in results.summaries if s["dataset"] == dataset]
    _refuse_mixtures(rows, summaries, dataset)
    columns = {c["name"]: c for s in summaries for c in s["columns"]}
    models = _rank(rows)
    tables = [_table_iii(rows, models, columns, dataset)]
    if dataset == PAPER_DATASET and {"physics", "mlp"} <= set(models):
        tables.append(_claim(rows))
    tables += [_horizon_table(rows, models, columns), _signal_table(rows, models, columns)]
    if rows["kind"].nunique() > 1:
        tables.append(_kind_table(rows, models, columns))
    tables.append(_status_table(rows, models))
    return Board(dataset, models, tables, _head(rows, summaries))


def _refuse_mixtures(rows: Frame, summaries: list[dict[str, Any]], dataset: str) -> None:
    for column, what in (("protocol", "protocol versions"), ("fingerprint", "data (fingerprints)"), ("task", "tasks")):
        found = sorted(rows[column].unique().tolist())
        if len(found) > 1:
            models = {value: sorted(rows.loc[rows[column] == value, "model"].unique()) for value in found}
            listed = "; ".join(f"{value}: {', '.join(names)}" for value, names in models.items())
            raise InputError(
                f"data set '{dataset}': the rows are of different {what}, which are never ranked together ({listed}). "
                "Give result folders of one kind, or run the models again."
            )
    if summaries and summaries[0]["protocol"] != PROTOCOL:
        raise InputError(
            f"data set '{dataset}': the rows are of protocol {summaries[0]['protocol']}, this version ranks protocol {PROTOCOL}; "
            "run the models again."
        )


def _shares(rows: Frame) -> dict[str, tuple[int, int]]:
    """Model -> (scored rows, expected rows): every window that any model was given, times the model's seeds."""
    windows = len(rows[["fold", "run"]].drop_duplicates())
    return {
        str(model): (int((part["status"] == "ok").sum()), max(len(part), windows * part["seed"].nunique()))
        for model, part in rows.groupby("model", sort=False)
    }


def _fold_means(rows: Frame, column: str) -> Frame:
    """By model: statistics over the runs of a fold, then their mean over folds and seeds (sigma: n - 1; IQR: linear quantiles)."""
    ok = rows[rows["status"] == "ok"]
    if ok.empty:  # nothing to take quartiles of; every model keeps its row, without figures
        return ok.set_index("model").reindex(columns=list(STATISTICS))
    scored = ok.groupby(["model", "fold", "seed"])[column]
    quartiles = scored.quantile([0.25, 0.75]).unstack()
    statistics = scored.agg(["mean", "median", "std"])
    statistics["iqr"] = quartiles[0.75] - quartiles[0.25]
    return statistics.groupby("model").mean()


def _value(statistics: Frame, model: str, statistic: str, factor: float = 1.0) -> float:
    return float(statistics.loc[model, statistic]) * factor if model in statistics.index else float("nan")


def _rank(rows: Frame) -> list[str]:
    """Models by mean ED; those with a run that is not scored come after all that have none."""
    shares, means = _shares(rows), _fold_means(rows, "ed")

    def order(model: str) -> tuple[bool, bool, float, str]:
        scored, expected = shares[model]
        return scored == 0, scored < expected, _value(means, model, "mean") if scored else 0.0, model

    return sorted(shares, key=order)


def _runs_text(share: tuple[int, int]) -> str:
    return f"{share[0]}/{share[1]}"


def _table_iii(rows: Frame, models: list[str], columns: dict[str, Any], dataset: str) -> Table:
    metrics = [m for m in TABLE_III if m in columns]
    statistics = {m: _fold_means(rows, m) for m in metrics}
    shares = _shares(rows)
    lines, place = [], 0
    for model in models:
        place += model != CEILING
        line: dict[str, Any] = {"rank": "" if model == CEILING else str(place), "model": model, "runs": _runs_text(shares[model])}
        lines.append(line | {f"{m}_{s}": _value(statistics[m], model, s) for m in metrics for s in STATISTICS})
    notes = [
        f"{', '.join(columns[m]['label'] + ' in ' + columns[m]['unit'] for m in metrics)}: per run the mean over the predicted knots; "
        f"{MU} mean, m median, {SIGMA} standard deviation (n - 1), IQR interquartile range over the runs of a fold; "
        "then the mean over folds (and seeds)."
    ]
    if any(scored < expected for scored, expected in shares.values()):
        notes.append("Runs: scored of expected. A model with unscored runs ranks below all complete ones; the reasons stand below.")
    undefined = int(rows.loc[rows["status"] == "ok", metrics].isna().any(axis=1).sum())
    if undefined:
        notes.append(f"In {undefined} rows the true ship does not move: cVDM has no scale there and leaves them out.")
    if CEILING in models:
        notes.append("`oracle` is the simulator itself: the ceiling, not ranked.")
    if dataset == PAPER_DATASET:
        lines += [
            {"model": name, "_reference": True} | {f"{m}_{s}": v for m in metrics for s, v in zip(STATISTICS, values[m], strict=True)}
            for name, values in PAPER.items()
        ]
        notes.append("In italics: Table III of the source paper, on its own 90 runs (not public); same metrics, other data.")
    head = [TableColumn("#", "rank"), TableColumn("model", "model"), TableColumn("runs", "runs")]
    figures = [TableColumn(f"{columns[m]['label']} {SYMBOLS[s]}", f"{m}_{s}", number(2)) for m in metrics for s in STATISTICS]
    return Table("Errors over the horizon (layout of the paper's Table III)", head + figures, lines, notes)


def _claim(rows: Frame) -> Table:
    """How far `physics` lies below `mlp`, beside the paper's two rows."""
    here: dict[str, Any] = {"where": "here"}
    there: dict[str, Any] = {"where": "paper", "_reference": True}
    for metric in (m for m in TABLE_III if m in rows):
        means = _fold_means(rows, metric)
        for i, s in enumerate(STATISTICS):
            here[f"{metric}_{s}"] = 100.0 * (1.0 - _value(means, "physics", s) / _value(means, "mlp", s))
            there[f"{metric}_{s}"] = 100.0 * (1.0 - PAPER["paper: physics"][metric][i] / PAPER["paper: MLP"][metric][i])
    keys = [k for k in here if k != "where"]
    header = {k: f"{'cVDM' if k.startswith('cvdm') else k.split('_')[0].upper()} {SYMBOLS[k.split('_')[1]]}" for k in keys}
    columns = [TableColumn("", "where"), *[TableColumn(header[k], k, number(1)) for k in keys]]
    return Table("`physics` below `mlp`, in percent", columns, [here, there])


def _mean_table(title: str, rows: Frame, models: list[str], chosen: list[dict[str, Any]], notes: Sequence[str] = ()) -> Table:
    """Mean over folds of the fold means of the `chosen` columns, in units that people read."""
    means = {c["name"]: _fold_means(rows, c["name"]) for c in chosen}
    units = {c["name"]: display_unit(c["unit"]) for c in chosen}
    lines = [{"model": m} | {n: _value(means[n], m, "mean", units[n][1]) for n in means} for m in models]
    figures = [TableColumn(f"{c['label']} [{units[c['name']][0]}]", c["name"], significant(3)) for c in chosen]
    return Table(title, [TableColumn("model", "model"), *figures], lines, notes)


def _horizon_table(rows: Frame, models: list[str], columns: dict[str, Any]) -> Table:
    at_times = [c for n, c in columns.items() if n.startswith("ed_at_")]
    chosen = at_times + [columns[n] for n in _WHOLE_RUN if n in columns]
    note = "Mean over runs and folds. `ED at t` is the position error at that time; heading error is the mean of |dpsi| over the run."
    return _mean_table("Error against horizon", rows, models, chosen, [note])


def _signal_table(rows: Frame, models: list[str], columns: dict[str, Any]) -> Table:
    rest = [c for n, c in columns.items() if n not in (*TABLE_III, *_WHOLE_RUN) and not n.startswith("ed_at_")]
    note = "Mean over runs and folds of the root mean square over the run, each in its own unit."
    return _mean_table("Error of each signal", rows, models, rest, [note])


def _kind_table(rows: Frame, models: list[str], columns: dict[str, Any]) -> Table:
    """Mean over the windows of each kind of manoeuvre."""
    metric = columns.get("position_rmse", columns["ed"])
    scored = rows[rows["status"] == "ok"]
    means = scored.groupby(["model", "kind"])[metric["name"]].mean()
    counts = rows.drop_duplicates(["fold", "run"])["kind"].value_counts()
    kinds = sorted(counts.index)
    lines = [{"model": m} | {k: float(means.get((m, k), float("nan"))) for k in kinds} for m in models]
    figures = [TableColumn(f"{k or 'other'} ({counts[k]})", k, significant(3)) for k in kinds]
    title = f"{metric['label'][0].upper()}{metric['label'][1:]} by kind of manoeuvre [{metric['unit']}]"
    note = "Mean over all scored windows of the kind (their number in brackets)."
    return Table(title, [TableColumn("model", "model"), *figures], lines, [note])


def _status_table(rows: Frame, models: list[str]) -> Table:
    lines, notes = [], []
    for model in models:
        part = rows[rows["model"] == model]
        counts = part["status"].value_counts()
        cells = part.drop_duplicates(["fold", "seed"])
        done = cells[cells["status"].isin(["ok", "diverged"])]
        shared = int(cells["fit_shared_by"].max())
        times = {"fit_s": float(done["fit_s"].mean()), "predict_ms": 1e3 * float(done["predict_s"].mean())}
        lines.append({"model": model, "shared": str(shared) if shared > 1 else "", **times, **{s: int(counts.get(s, 0)) for s in STATUSES}})
        for (status, reason), same in part[part["status"] != "ok"].groupby(["status", "reason"], sort=False):
            first = same.iloc[0]
            notes.append(f"`{model}` {status} in {len(same)} rows (fold {first['fold']}, run {first['run']}): {reason}.")
    folded = [*notes[:20], f"... and {len(notes) - 20} more reasons (in the rows)."] if len(notes) > 20 else notes
    columns = [TableColumn("model", "model"), *[TableColumn(s, s, str) for s in STATUSES]]
    columns += [
        TableColumn("fit [s]", "fit_s", significant(3)), TableColumn("fitted together", "shared"),
        TableColumn("predict [ms]", "predict_ms", significant(3)),
    ]  # fmt: skip
    about = "Fit: seconds per fold and seed; fits that ran together share their time equally. Predict: per rollout, in one batch."
    return Table("Status and time", columns, lines, [about, *folded])


def _code_text(code: dict[str, str]) -> str:
    return f"shipbench {code['shipbench']} (source {code['source']}{', git ' + code['git'] if code['git'] else ''})"


def _head(rows: Frame, summaries: list[dict[str, Any]]) -> list[str]:
    """Lines that identify the experiment."""
    first = summaries[0]
    task, scored, runs = first["task"], len(rows[["fold", "run"]].drop_duplicates()), rows["parent"].nunique()
    windows = f"{scored} runs" if scored == runs else f"{scored} windows (from {runs} runs)"
    split = "published split" if task["split"] == "published" else f"{rows['fold'].nunique()} folds by run"
    seeds = ", ".join(str(s) for s in sorted(rows["seed"].unique()))
    codes = dict.fromkeys(_code_text(s["code"]) for s in summaries)
    machines = dict.fromkeys("{cpus} CPUs, Python {python}, torch {torch}".format(**s["machine"]) for s in summaries)
    commands = dict.fromkeys(s["command"] for s in summaries if s["command"])
    notes = dict.fromkeys(note for s in summaries for note in s["notes"])
    history = f", {task['history_s']:g} s of history" if task["history_s"] else ""
    return [
        f"{windows} of {task['horizon_s']:g} s{history}, {split}, seed(s) {seeds}; "
        f"ship {first['ship']} (L = {first['ship_L']:g} m), dt = {first['dt']:g} s.",
        f"Data fingerprint `{first['fingerprint']}`, task `{first['task_key']}`, protocol {first['protocol']}.",
        f"Made {max(s['finished'] for s in summaries)[:10]} with {'; '.join(codes)} on {'; '.join(machines)}.",
        *[f"Made by `{command}`." for command in commands],
        f"Source: {first['source'] or 'not stated'}; licence: {first['licence'] or 'not stated'}.",
        *[f"Note: {note.rstrip('.')}." for note in notes],
    ]


def write_boards(results: Results, out: str | Path, command: str, *, plots: bool = True) -> list[tuple[Board, Path]]:
    """Render every data set of `results` into `out/<dataset>.md`, with its plots beside it in `out/<dataset>/`.

    Raises:
        InputError: as `build_board`; nothing is written then.
    """
    out = Path(out)
    boards = [build_board(results, name) for name in dict.fromkeys(s["dataset"] for s in results.summaries)]
    written = []
    for board in boards:
        images: list[str] = []
        if plots:
            from .plots import draw_all

            images = [p.relative_to(out).as_posix() for p in draw_all(results, board.dataset, board.ranking, out / board.dataset)]
        out.mkdir(parents=True, exist_ok=True)
        part = out / f".{board.dataset}.{os.getpid()}.tmp"
        part.write_text(board.markdown(command, images), encoding="utf-8")
        os.replace(part, out / f"{board.dataset}.md")
        written.append((board, out / f"{board.dataset}.md"))
    return written
