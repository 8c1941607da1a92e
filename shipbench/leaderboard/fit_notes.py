"""Notes on fitted physics that does not fit its own training runs, in words for the terminal, the tables and the
page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..predictors.physics_model.fit_report import FitReport

MARK = "†"


def fit_notes(summaries: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], str]:
    """Note by data set and model on the worst of its fits that do not fit their runs; none where all do."""
    fits: dict[tuple[str, str], list[tuple[FitReport, int]]] = {}
    for summary in summaries:
        if (report := _report(summary)) is not None:
            fits.setdefault((str(summary["dataset"]), str(summary["model"])), []).append((report, summary["fold"]))
    notes = {}
    for key, found in fits.items():
        bad = [(report, fold) for report, fold in found if not report.fits]
        if bad:
            report, fold = max(bad, key=lambda pair: pair[0].error / max(pair[0].hold, 1e-9))
            where = (
                f" In {len(bad)} of {len(found)} fits; the figures are those of fold {fold}." if len(found) > 1 else ""
            )
            notes[key] = report.note + where
    return notes


def _report(summary: Mapping[str, Any]) -> FitReport | None:
    """Fit report in a summary; None where there is none, or where it is malformed."""
    try:
        return FitReport.from_dict(summary["fit_report"])
    except (KeyError, TypeError, ValueError, AttributeError):
        return None
