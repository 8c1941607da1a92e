"""Files of `data check`: one page, one document, the lines for dataset.toml, one picture for each finding with evidence
to draw."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...checking.applying import laid
from ...checking.finding import Finding, Picture, toml_line
from ...checking.recording import Recording
from ...errors import InputError
from ...names import file_name
from ...storage import write_text
from .facts import dataset_facts
from .findings_page import check_page

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def check_document(recording: Recording, findings: Sequence[Finding]) -> dict[str, Any]:
    """Facts of the data set, findings, and all lines for dataset.toml together."""
    lines = laid(recording.given, findings)
    return dataset_facts(recording.dataset) | {
        "findings": [f.as_json() for f in findings], "lines": toml_line(lines.changed),
        "contradictions": list(lines.refused),
    }  # fmt: skip


def write_findings(recording: Recording, findings: Sequence[Finding], folder: Path, command: str) -> list[Path]:
    """Write check.html, findings.json, dataset_lines.toml and NN-kind.png; pictures of an earlier check are removed.

    `command` is the command that the page states as its origin. Returns the paths, the page first.

    Raises:
        InputError: the folder cannot be written.
    """
    document = check_document(recording, findings)
    page = check_page(recording, findings, document, command)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("[0-9][0-9]-*.png"):
            old.unlink()
        written = [
            write_text(folder / "check.html", page),
            write_text(folder / "findings.json", json.dumps(document, indent=1, default=str) + "\n"),
        ]
        written.append(write_text(folder / "dataset_lines.toml", document["lines"] + "\n"))
        for number, finding in enumerate(findings, 1):
            if finding.picture is not None:
                written.append(
                    _draw(finding.picture, folder / f"{number:02d}-{file_name(finding.kind.replace(' ', '_'))}.png")
                )
    except OSError as error:
        raise InputError(f"cannot write to {folder}: {error.strerror}. Give a folder that can be written.") from None
    return written


def _draw(picture: Picture, path: Path) -> Path:
    from ...leaderboard.plots import new_figure, plain, save

    figure = new_figure(8.0, 4.5)
    axes = figure.add_subplot()
    for i, curve in enumerate(picture.curves):
        axes.plot(
            curve.x,
            curve.y,
            curve.style,
            color=_COLOURS[i % len(_COLOURS)],
            label=plain(curve.label),
            markersize=4,
            linewidth=1.2,
        )
    axes.set(title=plain(picture.title), xlabel=picture.xlabel, ylabel=picture.ylabel)
    axes.grid(alpha=0.3)
    axes.legend()
    return save(figure, path)
