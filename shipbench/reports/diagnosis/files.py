"""Diagnosis on disk: diagnosis.json, summary.txt and a self-contained page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ...diagnosis.result import Diagnosis
from ...storage import write_text
from .page import diagnosis_page
from .text import in_words, summary_lines


def write_diagnosis(d: Diagnosis, folder: Path) -> list[Path]:
    """Write diagnosis.json, summary.txt and report.html into `folder` (made if missing), each atomically; returns the
    paths."""
    content = json.dumps(document(d), indent=1, allow_nan=False)
    return [
        write_text(folder / "diagnosis.json", content + "\n"),
        write_text(folder / "summary.txt", "\n".join(summary_lines(d)) + "\n"),
        write_report(d, folder / "report.html"),
    ]


def document(d: Diagnosis) -> dict[str, Any]:
    """Content of diagnosis.json: `Diagnosis.document`, and every cause in words."""
    content = d.document()
    for c, cause in zip(d.causes, content["causes"], strict=True):
        cause["in_words"] = in_words(c)
    return content


def write_report(d: Diagnosis, path: Path) -> Path:
    """Write the page alone; returns `path`."""
    return write_text(path, diagnosis_page(d))
