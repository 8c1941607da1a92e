"""Tables on the certainty of a leaderboard: skill, win rate, paired tests, seeds; slices by regime; indices of standard
manoeuvres."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..bench.regimes import slices
from ..metrics.base import Column
from ..metrics.trial_indices import COLUMNS as TRIAL_COLUMNS
from ..metrics.trial_indices import NAMES as TRIAL_NAMES
from ..render.table import Table, TableColumn, display_unit, number, significant
from ..storage import Frame
from .scores import CEILING, Scores
from .statistics import RESAMPLES
from .tables import FEW_RUNS, SIGMA, group_lines


def p_text(value: Any) -> str:
    """Text of a p-value; a dash where there is none."""
    if value is None or not np.isfinite(value):
        return "-"
    return "<0.001" if value < 0.001 else f"{value:.3f}"


def comparison_table(scores: Scores) -> Table:
    """Table of ED, skill against the baseline, win rate, and significance of the difference to the next better
    model."""
    matched, baseline = scores.matched, scores.baseline
    ranked = scores.ranked
    holm = {frozenset((p.first, p.second)): p.p_holm for p in scores.pairs}
    errors = scores.figures("ed")
    several_seeds = scores.rows.groupby("model")["seed"].nunique().max() > 1
    lines = []
    for model in scores.models:
        line: dict[str, Any] = {"model": model, **errors[model]}
        if baseline:
            line |= dict(
                zip(
                    ("skill", "skill_low", "skill_high"),
                    (100.0 * x for x in matched.skill(model, baseline)),
                    strict=True,
                )
            )
        if model != CEILING:
            others = [m for m in ranked if m != model]
            if others:
                line |= dict(
                    zip(
                        ("wins", "wins_low", "wins_high"),
                        (100.0 * x for x in matched.win_rate(model, others)),
                        strict=True,
                    )
                )
            place = ranked.index(model)
            if place:
                line["p_above"] = holm.get(frozenset((model, ranked[place - 1])), float("nan"))
        seeds = list(scores.values("ed", model).values())
        line |= {"seeds": int(scores.rows.loc[scores.rows["model"] == model, "seed"].nunique())}
        line["seed_spread"] = float(np.std(seeds, ddof=1)) if len(seeds) > 1 else float("nan")
        lines.append(line)
    columns = [TableColumn("model", "model"), TableColumn("ED [m]", "ed_mean", number(2), interval=True)]
    notes = []
    if baseline:
        columns.append(TableColumn(f"skill against `{baseline}` [%]", "skill", number(1), interval=True))
        notes.append(f"Skill: 100 (1 - ED / ED of `{baseline}`); above 0 is better than it.")
    else:
        notes.append("No skill: no rows of the baseline `hold`; name another with --baseline.")
    if len(ranked) > 1:
        columns += [
            TableColumn("win rate [%]", "wins", number(1), interval=True),
            TableColumn("p, next better", "p_above", p_text),
        ]
        notes.append(
            "Win rate: how often the model has the lower ED of a run, over runs and other ranked models; a run "
            "without a score is lost. A window that a model does not cover is left out."
        )
        notes.append("p, next better: of the paired test against the model one rank above, as in the table of pairs.")
    if several_seeds:
        columns += [
            TableColumn("seeds", "seeds", str),
            TableColumn(f"ED {SIGMA} over seeds [m]", "seed_spread", number(2)),
        ]
        notes.append(
            f"{SIGMA} over seeds: standard deviation (n - 1) of the model's ED from seed to seed; intervals are "
            "over runs, seeds averaged in a run."
        )
    return Table("Ranking, skill and win rate", columns, lines, notes)


def pair_table(scores: Scores) -> Table:
    """Table of every two ranked models on the same runs."""
    matched = scores.matched
    lines: list[dict[str, Any]] = []
    for pair in scores.pairs:
        share = f"{pair.better}/{pair.windows}"
        line = {
            "first": pair.first,
            "second": pair.second,
            "difference": pair.difference,
            "better": share,
            "p": pair.p,
            "p_holm": pair.p_holm,
        }
        lines.append(line | {"difference_low": pair.low, "difference_high": pair.high})
    columns = [
        TableColumn("model", "first"), TableColumn("against", "second"),
        TableColumn("ED difference [m]", "difference", number(2), interval=True),
        TableColumn("better in", "better"), TableColumn("p", "p", p_text), TableColumn("p, Holm", "p_holm", p_text),
    ]  # fmt: skip
    runs = scores.matched.clusters
    notes = [
        f"Mean ED of the first less that of the second on the same windows, seeds averaged; bootstrap-t over {runs} "
        f"runs ({RESAMPLES} resamples, "
        "windows of one run drawn together), p after Holm over all pairs.",
    ]
    if runs < FEW_RUNS:
        notes.append(f"Only {runs} runs: with so few, intervals and p are rough.")
    for model in (m for m in scores.ranked if m in matched.comparable and m not in matched.complete):
        scored, expected = scores.shares[model]
        notes.append(f"`{model}` is compared on the {scored} of {expected} windows that it covers.")
    left_out = [m for m in scores.ranked if m not in matched.comparable]
    if left_out:
        names = ", ".join(f"`{m}`" for m in left_out)
        notes.append(f"Not tested: {names}; leaving out the runs where a model has no score would favour it.")
    return Table("Paired comparison", columns, lines, notes)


def slice_table(scores: Scores) -> Table | None:
    """Table of every model's ED in slices of the true ship's motion, or None where the rows do not state it."""
    windows = scores.windows
    if windows is None or windows.empty:
        return None
    keys = list(zip(scores.rows["fold"], scores.rows["run"], strict=True))
    at = {key: i for i, key in enumerate(zip(windows["fold"], windows["run"], strict=True))}
    if not set(keys) <= at.keys():
        return None
    place = np.array([at[key] for key in keys])
    found = [s for s in slices(windows) if s.members.any()]
    if not found:
        return None
    names = {f"s{i}": s for i, s in enumerate(found)}
    lines = group_lines(scores, "ed", {name: s.members[place] for name, s in names.items()})
    by_slice: list[dict[str, Any]] = []
    for name, s in names.items():
        runs = scores.rows["cluster"][s.members[place]].nunique()
        line: dict[str, Any] = {
            "slice": s.label,
            "windows": f"{s.members.sum()}" if runs == s.members.sum() else f"{s.members.sum()} ({runs})",
        }
        for i, model in enumerate(lines):
            line |= {f"m{i}{end}": model.get(f"{name}{end}", float("nan")) for end in ("", "_low", "_high")}
        by_slice.append(line)
    few = any("(" in line["windows"] for line in by_slice)
    columns = [
        TableColumn("windows in which the true ship", "slice"),
        TableColumn("number (runs)" if few else "number", "windows"),
    ]
    columns += [TableColumn(model, f"m{i}", significant(3), interval=True) for i, model in enumerate(scores.models)]
    notes = [
        "ED [m], mean over the windows. Speed, drift angle (weighted with speed) and |rudder| are means over the "
        "window, cut into thirds of them; "
        "astern: astern shaft speed is commanded; thrusters: one has a command."
    ]
    return Table("Regime slices", columns, by_slice, notes)


def trial_table(scores: Scores) -> Table | None:
    """Errors of the IMO/ITTC indices where windows are standard manoeuvres, or None."""
    windows = scores.windows
    columns = {
        name: column for name, column in zip(TRIAL_NAMES, TRIAL_COLUMNS, strict=True) if column.name in scores.rows
    }
    if windows is None or not columns:
        return None
    lines = [line for name, column in columns.items() for line in _trial_lines(scores, windows, name, column)]
    if not lines:
        return None
    shown = [TableColumn("index", "index"), TableColumn("model", "model"), TableColumn("windows", "windows", str)]
    shown += [TableColumn("reached", "reached", str), TableColumn("true mean", "true", significant(3))]
    shown += [
        TableColumn("mean absolute error", "error", significant(3)),
        TableColumn("mean error", "bias", significant(3)),
    ]
    notes = [
        "Predicted less true, over windows that are a turn or a zig-zag (the rudder leaves a straight course for "
        "one angle and stays, or goes to "
        "and fro), under the recorded commands: a model's overshoot is counted from its own heading when the true "
        "rudder was reversed.",
        (
            "Reached: windows in which the model gets there too (turns 90 or 180 degrees, comes back from the "
            "overshoot); the errors are of those."
        ),
    ]
    return Table("Indices of standard manoeuvres (IMO, ITTC)", shown, lines, notes)


def _trial_lines(scores: Scores, windows: Frame, name: str, column: Column) -> list[dict[str, Any]]:
    """Lines of the table, one for each model; none where no window has the index."""
    there = windows[windows[name].notna()]
    shown, factor = display_unit(column.unit)
    keys = set(zip(there["fold"], there["run"], strict=True))
    lines = []
    for model in scores.models if len(there) else []:
        part = scores.rows[scores.rows["model"] == model]
        mine = part[[key in keys for key in zip(part["fold"], part["run"], strict=True)]]
        errors = factor * mine[column.name].dropna()
        line: dict[str, Any] = {
            "index": f"{column.label} [{shown}]",
            "model": model,
            "windows": len(mine),
            "reached": len(errors),
        }
        lines.append(
            line
            | {
                "true": factor * float(there[name].mean()),
                "error": float(errors.abs().mean()),
                "bias": float(errors.mean()),
            }
        )
    return lines
