"""Data card: content, noise, coverage and identifiability of a data set; as tables, Markdown and one HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...data.coverage import NEEDED, Gap, gaps, unit_time
from ...data.noise import channel_noise
from ...data.sensitivity import COLLINEAR, LEAST_EFFECT, Identifiability, identifiability
from ...records import Dataset
from ...render.table import Table, TableColumn, display_unit, number, significant
from ...signals import UNITS
from ...steps import step
from .facts import dataset_facts, describe_tables

_NOISE = (
    "Noise: standard deviation of the white part (least of the differences of order 2 to 6, by their "
    "median absolute deviation). The "
    "estimate is some 5 % too small. Drifts, biases and filtered noise are not in it; real gusts are. "
    "Step: resolution of the record."
)
_EFFECT_SIZE = (
    "Effect size: change of the runs by a typical amplitude, relative to the error of constant velocities. Below "
    f"{100 * LEAST_EFFECT:g} % it is too small. "
    "Explained by others: share of the squared change that the other causes can explain together. Above "
    f"{100 * COLLINEAR:.0f} % (a variance inflation factor of 10) "
    "the cause cannot be identified, whatever the size of the data set. Of a current or wind the least "
    "identifiable direction counts."
)


_GAPS = "cannot_identify"


@dataclass(frozen=True)
class Card:
    """Contents of the card: facts by name, tables by key in the order of a terminal, most important last; a page begins
    with the gaps."""

    name: str
    facts: dict[str, Any]
    tables: dict[str, Table]

    def lead(self) -> str:
        """Summary in two sentences: content of the data set, and the share of causes that cannot be identified."""
        missing = len(self.tables[_GAPS].rows)
        what = (
            f"{missing} of the causes considered cannot be identified with it."
            if missing
            else "No cause is known that it cannot identify."
        )
        runs, samples = str(self.facts["runs"]).split(" in ", 1)
        return f"{self.name}: {runs} run{'s' * (runs != '1')} in {samples}. {what}"

    def brief(self) -> list[Table]:
        """Short tables for a terminal: durations, and the trials that would close the gaps."""
        gaps = self.tables[_GAPS]
        kept = [column for column in gaps.columns if column.key != "because"]
        return [self.tables["durations"], *([replace(gaps, columns=kept, notes=())] if gaps.rows else [])]

    def page(self) -> list[Table]:
        """Tables in the order of a page."""
        return [self.tables[_GAPS], *(table for key, table in self.tables.items() if key != _GAPS)]

    def document(self) -> dict[str, Any]:
        """Card as JSON."""
        return {
            "dataset": self.name,
            "facts": self.facts,
            **{key: table.as_json() for key, table in self.tables.items()},
        }


def make_card(dataset: Dataset) -> Card:
    """Statistics, durations, noise, gaps and sensitivities of a data set."""
    step("statistics", 0.0, 0.1)
    statistics = dict(zip(("statistics", "table_ii", "against_the_paper"), describe_tables(dataset), strict=False))
    step("identifiability of causes", 0.1, 0.9)
    causes, how = identifiability(dataset)
    step("noise and coverage", 0.9, 1.0)
    tables = {
        **statistics, "durations": _durations(dataset), "noise": _noise(dataset),
        "identifiability": _identifiable(causes, how),
        _GAPS: _gap_table(gaps(dataset) + _confounded(causes), dataset),
    }  # fmt: skip
    return Card(dataset.name, dataset_facts(dataset), tables)


def _gap_table(found: Sequence[Gap], dataset: Dataset) -> Table:
    columns = [
        TableColumn("cannot be identified", "subject"),
        TableColumn("because", "because"),
        TableColumn("trial that would close the gap", "manoeuvre"),
    ]
    rows = [{"subject": g.subject, "because": g.because, "manoeuvre": g.manoeuvre} for g in found]
    unit = unit_time(dataset.ship.L)
    notes = [
        (
            f"Times are judged in ship lengths: one takes {unit:.3g} s at a Froude number of 0.1 (10 sqrt(L/g)), "
            f"{NEEDED:g} of them are needed."
        ),
        (
            "Other causes may still be weakly determined: fits print intervals, and `shipbench diagnose` prints "
            "detection limits."
        ),
    ]
    return Table(
        "What these data cannot identify",
        columns,
        rows,
        notes if rows else ["No gap was found.", *notes],
    )


def _confounded(causes: Sequence[Identifiability]) -> list[Gap]:
    """Causes that are confounded with others; two that are confounded with each other make one line."""
    found, done = [], set()
    twins = {t.subject: t.closest for t in causes if t.cosine**2 > COLLINEAR}
    for t in causes:
        if t.explained <= COLLINEAR or t.subject in done:
            continue
        alone = t.subject in twins
        if twins.get(t.closest) == t.subject:
            done.add(t.closest)
        who = (
            f"{t.closest} alone explains {100 * t.cosine**2:.1f} %"
            if alone
            else f"most collinear: {t.closest} (cosine {t.cosine:.2f})"
        )
        because = (
            f"other causes can explain {100 * t.explained:.1f} % of its effect on the runs, "
            f"{100 * COLLINEAR:.0f} % is the limit; {who}"
        )
        found.append(
            Gap(f"{t.subject} apart from {t.closest if alone else 'the other causes together'}", because, t.manoeuvre)
        )
    return found


def _durations(dataset: Dataset) -> Table:
    """Table of runs, samples and times of every kind of manoeuvre."""
    kinds: dict[str, list[float]] = {}
    for run in dataset.runs:
        kinds.setdefault(run.kind or "not given", []).append((len(run) - 1) * dataset.dt)
    groups = [*kinds.items(), *([("all", [x for times in kinds.values() for x in times])] if len(kinds) > 1 else [])]
    rows = [
        {
            "kind": kind,
            "runs": len(times),
            "least": min(times),
            "median": float(np.median(times)),
            "most": max(times),
            "sum": sum(times) / 3600.0,
        }
        for kind, times in groups
    ]
    columns = [
        TableColumn("manoeuvre", "kind"), TableColumn("runs", "runs", number(0)),
        TableColumn("shortest [s]", "least", significant(3)),
        TableColumn("median [s]", "median", significant(3)), TableColumn("longest [s]", "most", significant(3)),
        TableColumn("together [h]", "sum", significant(3)),
    ]  # fmt: skip
    return Table("Durations", columns, rows, [f"One sample every {dataset.dt:g} s ({1.0 / dataset.dt:g} Hz)."])


def _noise(dataset: Dataset) -> Table:
    rows = []
    for c in channel_noise(dataset):
        unit, factor = display_unit(UNITS[c.channel])
        rows.append({
            "channel": c.channel, "unit": unit, "noise": factor * c.noise, "greatest": factor * c.greatest,
            "run": c.run, "step": factor * c.step,
            "repeated": 100.0 * c.repeated,
        })  # fmt: skip
    columns = [
        TableColumn("channel", "channel"), TableColumn("unit", "unit"),
        TableColumn("noise, median run", "noise", significant(2)),
        TableColumn("noisiest run", "greatest", significant(2)), TableColumn("which", "run"),
        TableColumn("step", "step", significant(3)),
        TableColumn("repeated samples [%]", "repeated", number(1)),
    ]  # fmt: skip
    return Table("Noise of the channels", columns, rows, [_NOISE])


def _identifiable(causes: Sequence[Identifiability], how: str) -> Table:
    rows = []
    for t in causes:
        detectable = t.effect_size > LEAST_EFFECT
        verdict = "too small" if not detectable else "no" if t.explained > COLLINEAR else "yes"
        rows.append({
            "subject": t.subject, "effect_size": 100 * t.effect_size,
            "explained": 100 * t.explained if detectable else None, "closest": t.closest,
            "cosine": t.cosine if detectable else None, "verdict": verdict,
        })  # fmt: skip
    columns = [
        TableColumn("cause", "subject"), TableColumn("effect size [%]", "effect_size", significant(2)),
        TableColumn("explained by others [%]", "explained", number(1)),
        TableColumn("most collinear", "closest"), TableColumn("cosine", "cosine", number(2)),
        TableColumn("identifiable", "verdict"),
    ]  # fmt: skip
    return Table("Identifiability of causes", columns, rows, [f"Method: {how}", *([_EFFECT_SIZE] if rows else [])])
