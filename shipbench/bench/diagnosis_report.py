"""A diagnosis on disk: diagnosis.json, summary.txt and a self-contained page."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from ..diagnosis.result import Diagnosis
from .diagnosis_html import diagnosis_page
from .diagnosis_text import in_words, summary_lines


def write_diagnosis(d: Diagnosis, folder: Path) -> list[Path]:
    """Write diagnosis.json, summary.txt and report.html into `folder` (made if missing), each atomically; returns the paths."""
    content = json.dumps(document(d), indent=1, allow_nan=False)
    return [
        _write(folder / "diagnosis.json", content + "\n"),
        _write(folder / "summary.txt", "\n".join(summary_lines(d)) + "\n"),
        write_report(d, folder / "report.html"),
    ]


def document(d: Diagnosis) -> dict[str, Any]:
    """What diagnosis.json holds: `Diagnosis.document`, and every cause in words."""
    content = d.document()
    for c, cause in zip(d.causes, content["causes"], strict=True):
        cause["in_words"] = in_words(c)
    return content


def write_report(d: Diagnosis, path: Path) -> Path:
    """Write the page alone; returns `path`."""
    return _write(path, diagnosis_page(d))


def _write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    # names of runs may hold lone surrogates from badly decoded files
    temporary.write_text(text, encoding="utf-8", errors="replace")
    os.replace(temporary, path)
    return path
