"""The page of a data card: what cannot be identified, coverage, the runs as linked plots, all tables."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

from ..records import Dataset, Run
from ..render.html import Tile, render_page
from .data_card_plots import Coverage
from .data_card_svg import HEIGHT, STYLE, WIDTH, svg
from .dataset_facts import fact_lines
from .recorded import RUNS, recorded_plots
from .tables import table_cells

if TYPE_CHECKING:
    from .data_card import Card

_TEMPLATES = Path(__file__).with_name("templates")


def card_page(card: Card, dataset: Dataset, covered: Sequence[Coverage], command: str) -> str:
    """The HTML of a card; it needs no network and no other file."""
    drawn = [(c.title, c.caption, *svg(c, dataset.dt)) for c in covered]
    gaps, *others = card.page()
    shown = _chosen(dataset.runs)
    plots = recorded_plots(dataset, {run.id: [run] for run in shown}, {run.id: kind for run in shown if (kind := _kind(run))})
    which = f"{len(shown)} of {len(dataset)} runs" + (", from every kind of manoeuvre" if len(shown) < len(dataset) else "") + "."
    return render_page(
        _TEMPLATES, "data_card.html.j2", title=f"Data card: {card.name}", dataset=card.name, command=command, lead=card.lead(),
        tiles=_tiles(card, dataset), plots=True, style=STYLE, gaps=table_cells(gaps), covered=drawn, size=f"{WIDTH:g} {HEIGHT:g}",
        tables=[table_cells(t) for t in others], tracks=plots, which=which, facts=fact_lines(card.facts),
    )  # fmt: skip


def _kind(run: Run) -> str:
    return str(run.meta.get("manoeuvre", ""))


def _chosen(runs: Sequence[Run]) -> list[Run]:
    """RUNS of the runs at most, of each kind of manoeuvre in turn the next one; in the order of the data set."""
    kinds: dict[str, list[int]] = {}
    for i, run in enumerate(runs):
        kinds.setdefault(_kind(run), []).append(i)
    turns = [i for turn in zip_longest(*kinds.values()) for i in turn if i is not None]
    return [runs[i] for i in sorted(turns[:RUNS])]


def _tiles(card: Card, dataset: Dataset) -> list[Tile]:
    missing, ship = len(card.tables["cannot_identify"].rows), dataset.ship
    samples, kinds = sum(len(run) for run in dataset.runs), len({_kind(run) for run in dataset.runs if _kind(run)})
    times = sorted((len(run) - 1) * dataset.dt for run in dataset.runs)
    length = f"{times[0]:g} s" if times[0] == times[-1] else f"{times[0]:g} to {times[-1]:g} s"
    return [
        Tile("Cannot be identified", str(missing), "causes, each with the trial that would add it" if missing else "no cause that is looked for"),
        Tile("Runs", str(len(dataset)), f"{kinds} kind{'s' * (kinds != 1)} of manoeuvre" if kinds else "kinds of manoeuvre not given"),
        Tile("Samples", str(samples), f"of {len(dataset.inputs)} inputs and 10 states"),
        Tile("Duration", f"{sum(times) / 3600.0:.3g} h", f"runs of {length}"),
        Tile("Time step dt", f"{dataset.dt:g} s", f"{1.0 / dataset.dt:.3g} Hz"),
        Tile("Ship", ship.name, f"L = {ship.L:g} m, B = {ship.B:g} m, T = {ship.T:g} m"),
    ]  # fmt: skip
