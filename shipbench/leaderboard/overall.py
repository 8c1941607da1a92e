"""Comparison over all data sets of a study: mean rank, win rate, skill, and a critical-difference diagram where there
are enough data sets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..extras import not_installed
from ..render.html import Tile, short_name
from ..render.table import Table, TableColumn, number
from .board import Board
from .scores import FLOOR, Scores
from .statistics import interval

NAME = "over-data-sets"
ALPHA = 0.05


def data_sets_needed(models: int) -> int:
    """Fewest data sets with which a paired rank test can find a significant difference between any two of `models` at 5
    % after Bonferroni or Holm.

    Wilcoxon's signed-rank test on n data sets has no two-sided p below 2 / 2^n; of k (k - 1) / 2 pairs the first must
    stay below 0.05 / pairs.
    """
    pairs = models * (models - 1) // 2
    return math.ceil(math.log2(2 * pairs / ALPHA))


@dataclass(frozen=True, eq=False)
class Overall:
    """Page over all data sets, and the data of its diagram: ED (data sets, models)."""

    board: Board
    models: list[str]
    errors: np.ndarray

    @property
    def can_draw(self) -> bool:
        """Whether there are enough data sets for the diagram, and the library that draws it."""
        return len(self.errors) >= data_sets_needed(len(self.models)) and not not_installed(["scikit_posthocs"])

    def draw(self, folder: Path) -> Path:
        """Draw the critical-difference diagram: mean ranks; a bar joins models without a significant difference
        (Wilcoxon's p after Holm).

        Source: Demsar (2006), J. Mach. Learn. Res. 7; pairwise tests instead of Nemenyi's: Benavoli et al. (2016), J.
        Mach. Learn. Res. 17.
        """
        from .plots import new_figure, save
        from .plots import short_name as in_legend

        ranks = dict(zip([in_legend(m) for m in self.models], _ranks(self.errors).mean(axis=0), strict=True))
        figure = new_figure(8.0, 1.2 + 0.35 * len(self.models))
        _diagram(ranks, self.p_values(), figure.subplots())
        return save(figure, folder / "critical-difference.png")

    def p_values(self) -> Any:
        """p-value of every two models over data sets, Wilcoxon's signed-rank test after Holm; a DataFrame by short
        name."""
        import scikit_posthocs as posthocs

        from .plots import short_name as in_legend

        found = posthocs.posthoc_wilcoxon(list(self.errors.T), p_adjust="holm")
        found.index = found.columns = [in_legend(m) for m in self.models]
        return found


def _diagram(ranks: dict[str, float], p_values: Any, axis: Any) -> None:
    import scikit_posthocs as posthocs

    posthocs.critical_difference_diagram(
        ranks,
        p_values,
        ax=axis,
        alpha=ALPHA,
        label_fmt_left="{label} ({rank:.2f})  ",
        label_fmt_right="  {label} ({rank:.2f})",
    )
    axis.set_title("Mean rank over data sets (1 is best); joined: no significant difference at 5 %", fontsize=11)


def _ranks(errors: np.ndarray) -> np.ndarray:
    from scipy.stats import rankdata

    return rankdata(errors, axis=-1)


def over_data_sets(sets: Sequence[Scores]) -> Overall | None:
    """Page over several data sets, for the ranked models that have every score on all of them; None for one data set or
    one such model."""
    if len(sets) < 2:
        return None
    models = [m for m in sets[0].ranked if all(m in s.matched.complete for s in sets)]
    if len(models) < 2:
        return None
    errors = np.array([[s.matched.mean(m) for m in models] for s in sets])
    order = np.argsort(_ranks(errors).mean(axis=0), kind="stable")
    models, errors = [models[i] for i in order], errors[:, order]
    asked = sets[0].asked_baseline or FLOOR
    baseline = asked if asked in models and (errors[:, models.index(asked)] > 0).all() else None
    table = _table(sets, models, errors, baseline)
    board = Board(
        NAME, models, [table], _head(sets, models), lead=_lead(table, len(sets)), tiles=_tiles(table, len(sets))
    )
    return Overall(replace(board, tables=[_with_diagram(table, Overall(board, models, errors))]), models, errors)


def _table(sets: Sequence[Scores], models: list[str], errors: np.ndarray, baseline: str | None) -> Table:
    drawn = np.stack(
        [s.matched.means(models) for s in sets]
    )  # (data sets, resamples, models); runs are drawn in each data set apart
    runs = min(s.matched.clusters for s in sets)
    ranks = _ranks(drawn).mean(axis=0)
    lines: list[dict[str, Any]] = []
    for j, model in enumerate(models):
        others = [m for m in models if m != model]
        wins = [s.matched.wins(model, others) for s in sets]
        won = np.mean(
            [
                s.boot.means(s.matched.codes, w[:, None], s.matched.weights[:, None])[:, 0]
                for s, w in zip(sets, wins, strict=True)
            ],
            axis=0,
        )
        line: dict[str, Any] = {"model": model, "rank": float(_ranks(errors).mean(axis=0)[j])}
        line["wins"] = 100.0 * float(
            np.mean([np.average(w, weights=s.matched.weights) for s, w in zip(sets, wins, strict=True)])
        )
        figures = {"rank": ranks[:, j], "wins": 100.0 * won}
        if baseline:
            b = models.index(baseline)
            with np.errstate(divide="ignore"):
                line["skill"] = 100.0 * (1.0 - float(np.exp(np.mean(np.log(errors[:, j] / errors[:, b])))))
                figures["skill"] = 100.0 * (1.0 - np.exp(np.mean(np.log(drawn[:, :, j] / drawn[:, :, b]), axis=0)))
        for key, values in figures.items():
            line |= dict(zip((f"{key}_low", f"{key}_high"), interval(values, runs), strict=True))
        lines.append(line)
    columns = [TableColumn("model", "model"), TableColumn("mean rank", "rank", number(2), interval=True)]
    columns.append(TableColumn("win rate [%]", "wins", number(1), interval=True))
    notes = [
        (
            "Every data set counts the same. Intervals: 95 %, bootstrap over the runs of each data set; for these data "
            "sets, not for others."
        )
    ]
    if baseline:
        columns.append(TableColumn(f"skill against `{baseline}` [%]", "skill", number(1), interval=True))
        notes.append(f"Skill: 100 (1 - geometric mean of ED / ED of `{baseline}`).")
    return Table("Over all data sets", columns, lines, notes)


def _lead(table: Table, count: int) -> str:
    """Sentence on the model of best mean rank and the next one."""
    first, second = table.rows[:2]
    return (
        f"'{first['model']}' has the best mean rank over {count} data sets: {_rank(first)}. '{second['model']}' is "
        f"second: {_rank(second)}. "
        "Rank 1 is the least position error."
    )


def _tiles(table: Table, count: int) -> list[Tile]:
    places = zip(("First", "Second"), table.rows, strict=False)
    found = [Tile(label, short_name(row["model"]), f"mean rank {_rank(row)}") for label, row in places]
    return [
        *found,
        Tile("Data sets", str(count), "each counts the same"),
        Tile("Models", str(len(table.rows)), "scored on all of them"),
    ]


def _rank(row: dict[str, Any]) -> str:
    low, high = row["rank_low"], row["rank_high"]
    return f"{row['rank']:.2f}" + (f" (95 %: {low:.2f} to {high:.2f})" if np.isfinite([low, high]).all() else "")


def _with_diagram(table: Table, overall: Overall) -> Table:
    """Table with a note on the diagram."""
    count, needed = len(overall.errors), data_sets_needed(len(overall.models))
    if count < needed:
        note = (
            f"No critical-difference diagram: {len(overall.models)} models need at least {needed} data sets before "
            "a paired rank test can tell any "
            f"two apart at 5 % (Wilcoxon, Holm); there are {count}. Within a data set the paired comparison over "
            "runs answers."
        )
    elif not overall.can_draw:
        note = f"The critical-difference diagram {not_installed(['scikit_posthocs'])}."
    else:
        note = "Critical-difference diagram: Wilcoxon's signed-rank test over data sets, p after Holm."
    return Table(table.title, table.columns, table.rows, [*table.notes, note])


def _head(sets: Sequence[Scores], models: list[str]) -> list[str]:
    left_out = sorted({m for s in sets for m in s.ranked} - set(models))
    lines = [f"{len(sets)} data sets: {', '.join(s.dataset for s in sets)}."]
    if left_out:
        lines.append(
            f"Left out, since they lack a score on one of the data sets: {', '.join(f'`{m}`' for m in left_out)}."
        )
    return lines
