"""Page of `shipbench suite check`: found and corrected faults, and the false findings on clean sets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ...bench.provenance import code_version
from ...render.table import Table, TableColumn, number
from ...storage import write_text
from ..diagnosis.scores import wilson
from .faults import FAULTS
from .outcome import Outcome


def _counts(kinds: Iterable[str]) -> str:
    return ", ".join(f"{kind} {n}" for kind, n in Counter(kinds).most_common()) or "none"


def _interval(hits: int, total: int) -> tuple[float, float]:
    low, high = wilson(hits, total)
    return max(low, 0.0), high  # rounding may leave -0.000


def result_tables(outcomes: Sequence[Outcome], clean: Sequence[tuple[str, tuple[str, ...]]]) -> list[Table]:
    """Planted faults, the same by source, and clean sets (kind, kinds of findings)."""
    return [_by_fault(outcomes), _by_source(outcomes), _false(clean)]


def _figures(mine: Sequence[Outcome]) -> dict[str, Any]:
    hits, healed = sum(o.found for o in mine), [o.healed for o in mine if o.healed is not None]
    low, high = _interval(hits, len(mine))
    return {
        "found": f"{hits} of {len(mine)}", "low": low, "high": high,
        "healed": f"{sum(healed)} of {len(healed)}" if healed else "no line",
        "others": _counts(kind for o in mine for kind in o.others),
    }  # fmt: skip


_FIGURES = (
    TableColumn("found", "found"), TableColumn("95 % from", "low", number(2)), TableColumn("to", "high", number(2)),
    TableColumn("corrected by its line", "healed"), TableColumn("other findings", "others"),
)  # fmt: skip


def _by_fault(outcomes: Sequence[Outcome]) -> Table:
    rows = []
    for fault in FAULTS:
        mine = [o for o in outcomes if o.fault == fault.name]
        if mine:
            rows.append({"fault": fault.name, "size": fault.size, **_figures(mine)})
    hits, extra = sum(o.found for o in outcomes), sum(bool(o.others) for o in outcomes)
    low, high = _interval(hits, len(outcomes))
    notes = [
        f"Found {hits} of {len(outcomes)} ({hits / len(outcomes):.1%}; {low:.1%} to {high:.1%}). "
        f"Sets with an unexpected finding: {extra} ({extra / len(outcomes):.1%}). "
        "Corrected: with its lines in dataset.toml the set loads and a second check has no finding."
    ]
    return Table(
        "Planted faults", [TableColumn("fault", "fault"), TableColumn("size at 130 m", "size"), *_FIGURES], rows, notes
    )


def _by_source(outcomes: Sequence[Outcome]) -> Table:
    rows = [
        {"source": source, **_figures([o for o in outcomes if o.source == source])}
        for source in dict.fromkeys(o.source for o in outcomes)
    ]
    return Table("The same by data set", [TableColumn("clean set", "source"), *_FIGURES], rows)


def _false(clean: Sequence[tuple[str, tuple[str, ...]]]) -> Table:
    rows = []
    for kind in [*dict.fromkeys(k for k, _ in clean), "all"]:
        mine = [found for k, found in clean if kind in (k, "all")]
        wrong = sum(bool(found) for found in mine)
        low, high = _interval(wrong, len(mine))
        which = _counts(c for found in mine for c in found)
        rows.append(
            {
                "kind": kind,
                "sets": len(mine),
                "wrong": wrong,
                "share": 100.0 * wrong / len(mine),
                "low": low,
                "high": high,
                "which": which,
            }
        )
    columns = [
        TableColumn("clean sets", "kind"), TableColumn("sets", "sets", number(0)),
        TableColumn("with a finding", "wrong", number(0)),
        TableColumn("%", "share", number(1)), TableColumn("share: 95 % from", "low", number(3)),
        TableColumn("to", "high", number(3)),
        TableColumn("findings", "which"),
    ]  # fmt: skip
    return Table("False findings", columns, rows)


def write_page(path: Path, tables: Sequence[Table], command: str, seeds: str) -> Path:
    """Replace the page atomically."""
    code = code_version()
    head = [
        "# Data check: planted faults, found or not", "",
        ("Faults are planted into clean sets, in the files as a user would hand them in: sea trials of three MMG "
         "ships of 130, 230 and 7 m"),
        ("(24 runs of 120 samples, sensor noise, gusts), sea trials of drawn hulls of the fitted model (eq. (2), "
         "another structure), and 90 port"),
        ("manoeuvres. `shipbench data check` must find each and propose a line of dataset.toml that corrects it. Clean "
         "sets must give no finding at all,"),
        ("notes included. Thresholds were set on the seeds of `--development` (from 7500); what 500 to 560 taught is "
         "in the code."), "",
        f"- Command: `{command}`, {seeds}",
        f"- Code: shipbench {code['shipbench']}, source {code['source']}", "",
    ]  # fmt: skip
    return write_text(path, "\n".join([*head, *(table.markdown() for table in tables)]))
