"""Page `leaderboards/diagnosis.md` from the rows of the suite, which are kept beside it as `diagnosis.json`."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...render.table import Table, TableColumn, number
from ...storage import write_text
from . import scores as scores

Row = scores.Row


def tables(rows: Sequence[Row]) -> list[Table]:
    """Tables of the page; those without rows are left out."""
    two = number(2)
    figures = scores.figures(rows)
    split = next((i for i, line in enumerate(figures) if not line["target"]), len(figures))
    columns = [
        TableColumn("figure", "figure"), TableColumn("measured", "value", two), TableColumn("95 % from", "low", two),
        TableColumn("to", "high", two),
        TableColumn("n", "n", number(0)), TableColumn("must reach", "target"), TableColumn("reached", "met"),
        TableColumn("how counted", "note"),
    ]  # fmt: skip
    other = [c for c in columns if c.key not in ("target", "met")]
    effects = [
        TableColumn("hidden", "effect"), TableColumn("right, 1x", "right_1"), TableColumn("class, 1x", "class_1"),
        TableColumn("right, 0.3x", "right_0.3"), TableColumn("class, 0.3x", "class_0.3"),
        TableColumn("oracle", "oracle"),
        TableColumn("named instead", "instead"),
        TableColumn("size error", "error", two),
        TableColumn("covered", "covered"), TableColumn("note", "note"),
    ]  # fmt: skip
    methods = [
        TableColumn("method", "method"), TableColumn("right, 1x", "right_1", two),
        TableColumn("right, 0.3x", "right_0.3", two),
        TableColumn("exact pair", "pair", two), TableColumn("alarms, same structure", "none-same", two),
        TableColumn("alarms, other structure", "none-other", two),
    ]  # fmt: skip
    confused = [
        TableColumn("kind", "kind"),
        TableColumn("hidden", "hidden"),
        TableColumn("named first", "named"),
        TableColumn("cases", "count", number(0)),
    ]
    failed = [{"case": r["key"], "reason": r["reason"]} for r in rows if not scores.ok(r)]
    declared = "; ".join(sorted(" = ".join(sorted(pair)) for pair in scores.CLASSES))
    found = [
        Table("Beside the targets", columns, figures[:split],
            ("Intervals are Wilson's. A case that failed counts "
             "as wrong.",)),
        Table("Counted in other ways", other, figures[split:]),
        Table("Two usual methods on the same sets", methods, scores.baseline_lines(rows),
              ("White residuals: output-error fit and score test. Derivative regression: sparse regression of "
               "smoothed derivatives (SINDy).",)),
        Table("Effect by effect", effects, scores.per_effect(rows),
              ("`hull_derivatives` named beside or before the true cause is skipped: every ship's hull differs from "
               "the regressions.",
               f"Declared equal before any result: {declared}.")),
        Table("What was named for what", confused, scores.confusion(rows)),
        Table("Cases that failed", [TableColumn("case", "case"), TableColumn("reason", "reason")], failed),
    ]  # fmt: skip
    return [table for table in found if table.rows]


def shortfalls(rows: Sequence[Row]) -> list[str]:
    """Lines on targets that are not reached, and on those that a small number of cases leaves open."""
    lines = []
    for line in scores.figures(rows):
        if line["met"] == "no":
            lines.append(f"- {line['figure']}: {line['value']:.2f}, must reach {line['target']} (n = {line['n']}).")
        elif line["met"] == "yes" and math.isfinite(line["low"]) and not line["figure"].startswith("seconds"):
            target, sense = scores.TARGETS[line["figure"]]
            bound = line["low"] if sense > 0 else line["high"]
            if sense * (bound - target) < 0:
                lines.append(
                    f"- {line['figure']}: reached, but its 95 % interval ({line['low']:.2f} to {line['high']:.2f}) "
                    "holds values that miss the target."
                )
    return lines


def render(rows: Sequence[Row], about: dict[str, Any]) -> str:
    """Page as text."""
    code, machine = about["code"], about["machine"]
    ships = sorted({r["ship"].rsplit("-", 1)[0] for r in rows if r.get("ship") and "published" not in r["kind"]})
    head = [
        "# Diagnosis: hidden causes, found or not", "",
        (f"{len(rows)} sets of {about['runs']} runs of {about['samples']} samples, with sensor noise and gusts; "
         "ships: variants of"),
        (f"{', '.join(ships)} ({about['which']} ships). A cause is drawn (effect, size, sign, direction, ship) and "
         "hidden in data of the MMG"),
        ("simulator, which differs in structure from the model that is fitted; sets of the kind `none-same` are made "
         "by the fitted model itself,"),
        ("those with `published` by four ships of the literature in their authors' equations (Mariner, a tanker, "
         "S175 and a navy ship with heel)."),
        ("Those four are development ships, too: thresholds were set with them in view (docs/calibration.md), so "
         "their figures are no test."),
        "Any set is drawn again from (seed, kind, index).", "",
        f"- Command: `{about['command']}` (seed {about['seed']}, {about['per_effect']} draws of each effect and size)",
        f"- Code: shipbench {code['shipbench']}, source {code['source']}" + (f", {code['git']}" if code["git"] else ""),
        f"- Machine: {machine['cpus']} CPUs, {machine['platform']}, Python {machine['python']}",
        f"- {about['workers']} diagnoses at a time, one thread each", "",
    ]  # fmt: skip
    short = shortfalls(rows)
    said = (
        "Every target that was measured is reached."
        if any(line["met"] for line in scores.figures(rows))
        else "No target was measured."
    )
    body = [table.markdown() for table in tables(rows)]
    return "\n".join([*head, *body, "## What falls short", "", *(short or [said]), ""])


def write_page(folder: Path, rows: Sequence[Row], about: dict[str, Any]) -> Path:
    """Write `diagnosis.md` and the rows it comes from, `diagnosis.json`; returns the path of the page."""
    left_out = {"signature", "warnings"}
    lean = [
        {k: v for k, v in row.items() if k not in left_out | (set() if row["kind"] == "change" else {"evidence"})}
        for row in rows
    ]
    lines = ",\n".join(json.dumps(row) for row in lean)
    text = f'{{"about": {json.dumps(about)},\n"rows": [\n{lines}\n]}}\n'
    for name, content in (("diagnosis.json", text), ("diagnosis.md", render(lean, about))):
        write_text(folder / name, content)
    return folder / "diagnosis.md"


def read_rows(path: Path) -> tuple[list[Row], dict[str, Any]]:
    """Rows and description of the suite that `write_page` kept."""
    data = json.loads(path.read_text(encoding="utf-8"))
    return data["rows"], data["about"]
