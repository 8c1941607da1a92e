"""Data card on disk, and its page: identifiability gaps, coverage, the runs as linked plots, all tables."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from ...errors import InputError
from ...records import Dataset, Run
from ...render.escaping import markdown_text
from ...render.html import Tile, render_page
from ...render.table import table_cells
from ...storage import put
from ..recorded import RUNS, recorded_plots
from .card import Card
from .coverage import Coverage, coverage, png
from .coverage_svg import HEIGHT, STYLE, WIDTH, svg
from .facts import fact_lines


def card_page(card: Card, dataset: Dataset, covered: Sequence[Coverage], command: str) -> str:
    """HTML of a card; it needs no network and no other file."""
    drawn = [(c.title, c.caption, *svg(c, dataset.dt)) for c in covered]
    gaps, *others = card.page()
    shown = _chosen(dataset.runs)
    plots = recorded_plots(
        dataset, {run.id: [run] for run in shown}, {run.id: kind for run in shown if (kind := run.kind)}
    )
    which = (
        f"{len(shown)} of {len(dataset)} runs"
        + (", from every kind of manoeuvre" if len(shown) < len(dataset) else "")
        + "."
    )
    return render_page(
        "data_card.html.j2", title=f"Data card: {card.name}", dataset=card.name, command=command, lead=card.lead(),
        tiles=_tiles(card, dataset), plots=True, style=STYLE, gaps=table_cells(gaps), covered=drawn,
        size=f"{WIDTH:g} {HEIGHT:g}",
        tables=[table_cells(t) for t in others], tracks=plots, which=which, facts=fact_lines(card.facts),
    )  # fmt: skip


def _chosen(runs: Sequence[Run]) -> list[Run]:
    """Runs to draw, RUNS at most, of each kind of manoeuvre in turn the next one; in the order of the data set."""
    kinds: dict[str, list[int]] = {}
    for i, run in enumerate(runs):
        kinds.setdefault(run.kind, []).append(i)
    turns = [i for turn in zip_longest(*kinds.values()) for i in turn if i is not None]
    return [runs[i] for i in sorted(turns[:RUNS])]


def _tiles(card: Card, dataset: Dataset) -> list[Tile]:
    missing, ship = len(card.tables["cannot_identify"].rows), dataset.ship
    samples, kinds = sum(len(run) for run in dataset.runs), len({run.kind for run in dataset.runs if run.kind})
    times = sorted((len(run) - 1) * dataset.dt for run in dataset.runs)
    length = f"{times[0]:g} s" if times[0] == times[-1] else f"{times[0]:g} to {times[-1]:g} s"
    return [
        Tile("Cannot be identified", str(missing),
            "causes, each with the trial that would add it" if missing else "no cause that is looked for"),
        Tile("Runs", str(len(dataset)),
            f"{kinds} kind{'s' * (kinds != 1)} of manoeuvre" if kinds else "kinds of manoeuvre not given"),
        Tile("Samples", str(samples), f"of {len(dataset.inputs)} inputs and 10 states"),
        Tile("Duration", f"{sum(times) / 3600.0:.3g} h", f"runs of {length}"),
        Tile("Time step dt", f"{dataset.dt:g} s", f"{1.0 / dataset.dt:.3g} Hz"),
        Tile("Ship", ship.name, f"L = {ship.L:g} m, B = {ship.B:g} m, T = {ship.T:g} m"),
    ]  # fmt: skip


def write_card(card: Card, dataset: Dataset, out: Path, command: str) -> list[Path]:
    """Write `card.md` with its pictures, and `card.html`, which holds everything in one file; returns the two pages.

    `command` is the command that made them, as the page states it.

    Raises:
        InputError: the folder cannot be written.
    """
    covered = coverage(dataset)
    files = {f"{c.name}.png": png(c, dataset.dt) for c in covered}
    files |= {
        "card.md": markdown(card, covered).encode(),
        "card.html": card_page(card, dataset, covered, command).encode(errors="replace"),
    }
    part = None
    try:
        out.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=".card-", dir=out))
        for name, content in files.items():
            (part / name).write_bytes(content)
        for name in files:  # the pages come last, when their pictures are there
            put(part / name, out / name)
    except OSError as error:
        raise InputError(
            f"cannot write the data card to {out}: {error.strerror}. Give a folder that can be written with --out."
        ) from None
    finally:
        if part is not None:
            shutil.rmtree(part, ignore_errors=True)
    return [out / "card.md", out / "card.html"]


def markdown(card: Card, covered: Sequence[Coverage]) -> str:
    """Card as Markdown; pictures are files beside it."""
    parts = [
        f"# Data card: {markdown_text(card.name)}\n",
        "\n".join(f"- {key}: {markdown_text(line)}" for key, line in fact_lines(card.facts)) + "\n",
    ]
    coverage = "## Coverage\n\n" + "\n\n".join(f"![{p.title}]({p.name}.png)\n\n{p.caption}" for p in covered) + "\n"
    texts = [t.markdown() for t in card.page()]
    return "\n".join([*parts, texts[0], coverage, *texts[1:]])
