"""Curves of a data set's models for a page: tracks and time histories as linked plots, and the growth of the errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..bench.submissions import Results
from ..render.linked import switch
from .histories import study_plots
from .pictures import growth
from .series import POINTS, gather


def study_curves(results: Results, dataset: str, models: Sequence[str], points: int = POINTS) -> dict[str, Any]:
    """Values that the macros of `templates/study.html.j2` draw for `models`, from saved predictions.

    `models` (number, name, stroke), `tracks` (linked plots; no runs where nothing is saved), `growth` (title and SVG,
    "" where nothing is saved), `left_out` (lines on omitted parts), `horizon` [s]. At most `points` time steps are
    drawn.
    """
    summary = next(s for s in results.summaries if s["dataset"] == dataset)
    rows = results.rows[results.rows["dataset"] == dataset]
    series = gather(results, dataset, models, points)
    return {
        "models": [switch(i, name) for i, name in enumerate(models)],
        "tracks": study_plots(series, rows, models, summary["ship_L"], summary["ship_B"]),
        "growth": [
            ("Position error ED", growth(series, models, 0, "ED [m]")),
            ("Heading error", growth(series, models, 1, "|heading error| [deg]")),
        ],
        "left_out": series.left_out, "horizon": summary["task"]["horizon_s"],
    }  # fmt: skip
