"""Content of a data set: its facts in lines, its statistics in tables."""

from __future__ import annotations

from typing import Any

from ...leaderboard.tables import PAPER_DATASET
from ...records import Dataset
from ...render.table import Table, TableColumn, number, significant
from ...ship import complete


def dataset_facts(dataset: Dataset) -> dict[str, Any]:
    """Facts on a data set, for a person who checks a loader or a folder."""
    samples = [len(r) for r in dataset.runs]
    lengths = " to ".join(dict.fromkeys(f"{(n - 1) * dataset.dt:g}" for n in (min(samples), max(samples))))

    def counts(key: str) -> str:
        known = [getattr(r.meta, key) for r in dataset.runs]
        values = [value for value in known if value is not None]
        return ", ".join(f"{v} {values.count(v)}" for v in dict.fromkeys(values)) or "not given"

    groups = {r.group for r in dataset.runs}
    return {
        "name": dataset.name,
        "ship": f"{dataset.ship.name}, L = {dataset.ship.L:g} m, B = {dataset.ship.B:g} m, T = {dataset.ship.T:g} m",
        "runs": (
            f"{len(dataset)} in {len(groups)} group{'s' * (len(groups) != 1)}, {sum(samples)} samples at "
            f"{dataset.dt:g} s, {lengths} s long"
        ),
        "inputs": ", ".join(dataset.inputs),
        "actuators": dataset.actuators,
        "manoeuvres": counts("manoeuvre"),
        "split": counts("split"),
        "simulated": dataset.simulation or "no",
        "source": dataset.source or "not stated",
        "licence": dataset.licence or "not stated",
        "fingerprint": dataset.fingerprint,
        "note": [*dataset.notes, *(f"ship: {note}" for note in complete(dataset.ship).notes)] or ["none"],
    }


def fact_lines(facts: dict[str, Any]) -> list[tuple[str, str]]:
    """Name and text of each fact; a list becomes one line for each entry."""
    return [
        (key, str(line)) for key, value in facts.items() for line in (value if isinstance(value, list) else [value])
    ]


ROUNDING = "The paper prints r with two decimals: its 0.01 rad/s stands for anything from 0.005 to 0.015."


def describe_tables(dataset: Dataset) -> list[Table]:
    """Tables of the statistics of every signal; for the harbour sets, which imitate the paper's data, also its Table II
    and the differences."""
    from ...data.describe import STATISTICS, actuator_use, compare_with_paper, statistics, table_ii

    def rows(frame: Any) -> list[dict[str, Any]]:
        return [{"signal": name, **row} for name, row in frame.to_dict(orient="index").items()]

    layout = [
        TableColumn("signal", "signal"),
        TableColumn("unit", "unit"),
        *[TableColumn(s, s, significant(4)) for s in STATISTICS],
    ]
    used = ", ".join(f"{name} {100 * share:.1f} %" for name, share in actuator_use(dataset).items())
    tables = [
        Table(
            f"{dataset.name}: all samples",
            layout,
            rows(statistics(dataset)),
            [f"Share of samples with a command other than zero: {used}."],
        )
    ]
    if dataset.name.startswith(PAPER_DATASET):
        compared = [TableColumn("signal", "signal"), TableColumn("", "statistic"), TableColumn("unit", "unit")]
        compared += [TableColumn("here", "ours", significant(3)), TableColumn("paper", "paper", significant(3))]
        compared += [TableColumn("difference / paper's std", "plain difference / paper std", number(2))]
        compared += [TableColumn("beyond the rounding of the print", "difference / paper std", number(2))]
        tables.append(Table("The paper's Table II", layout, rows(table_ii())))
        tables.append(
            Table("Here against the paper", compared, compare_with_paper(dataset).to_dict(orient="records"), [ROUNDING])
        )
    return tables
