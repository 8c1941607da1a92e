"""Suite of the data check (`shipbench suite check`): plant faults into clean simulated sets, check them, apply the
proposed lines; count false findings on clean sets."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import tomli_w

from ...bench.progress import Progress, Silent
from ...checking.applying import write_lines
from ...checking.base import check_dataset, check_path
from ...checking.finding import Finding
from ...data.files import read_dataset
from ...errors import InputError
from ...records import Dataset
from ...render.table import Table
from .clean_sets import base_set, clean_sets, sources_of
from .faults import FAULTS, Fault
from .outcome import CLEAN_SEEDS, OFFSET, Outcome
from .page import result_tables, write_page
from .planting import planting


def write_planted(dataset: Dataset, fault: Fault | None, seed: int, folder: Path) -> Path:
    """Write the data set's folder with the fault in it (None: clean)."""
    p = planting(dataset, seed)
    if fault is not None:
        fault.plant(p)
    folder.mkdir(parents=True, exist_ok=True)
    if p.table["u"].dtype == object:  # parquet holds no mixture of text and numbers
        p.table.to_csv(folder / "trajectories.csv", index=False)
    else:
        p.table.to_parquet(folder / "trajectories.parquet", index=False)
    (folder / "dataset.toml").write_text(tomli_w.dumps(p.toml), encoding="utf-8")
    (folder / "ship.toml").write_text(dataset.ship.to_toml(), encoding="utf-8")
    return folder


def apply_lines(folder: Path, findings: Sequence[Finding]) -> None:
    """Merge the lines of findings into a folder's dataset.toml."""
    write_lines(folder, findings)


def run_case(fault: Fault, source: str, seed: int, folder: Path) -> Outcome:
    """Plant one fault, check, apply the lines of expected findings, load strictly and check again."""
    write_planted(base_set(source, seed, fault.wind), fault, seed, folder)
    _, findings = check_path(str(folder))
    right = [f for f in findings if fault.expects(f.kind, f.channels)]
    others = tuple(f.kind for f in findings if f not in right and f.kind not in fault.also)
    healed: bool | None = None
    after: tuple[str, ...] = ()
    if any(f.line for f in right):
        apply_lines(folder, [f for f in findings if f in right or f.kind in fault.also])
        try:
            read_dataset(folder)
            after = tuple(f.kind for f in check_path(str(folder))[1] if f.severity != "note" and f.kind not in others)
            healed = not after
        except InputError as error:
            healed, after = False, (str(error),)
    return Outcome(fault.name, source, seed, bool(right), others, healed, after)


def suite_command(
    *, seeds: int = 1, first: int = 580, development: bool = False, out: Path = Path("leaderboards"),
    progress: Progress | None = None,
    command: str = "shipbench suite check",
) -> tuple[Path, list[Table]]:  # fmt: skip
    """Run everything and write check.md; development draws other seeds and writes check-development.md.

    Raises:
        InputError: no seeds.
    """
    if seeds < 1:
        raise InputError(f"--seeds {seeds}; accepted: a whole number from 1.")
    progress, start = progress or Silent(), first + (OFFSET if development else 0)
    jobs = [(fault, source, start + i) for fault in FAULTS for source in sources_of(fault.wind) for i in range(seeds)]
    clean = list(clean_sets([start + 100 + i for i in range(CLEAN_SEEDS * seeds)]))
    progress.start(len(jobs) + len(clean))
    outcomes, false = [], []
    with tempfile.TemporaryDirectory() as scratch:
        for number, (fault, source, seed) in enumerate(jobs):
            outcome = run_case(fault, source, seed, Path(scratch) / str(number))
            outcomes.append(outcome)
            said = "ok: found" if outcome.found and outcome.healed is not False and not outcome.others else f"{outcome}"
            progress.done(f"{fault.name}, {source}, {seed}", said)
    for kind, make in clean:
        dataset = make()
        found = tuple(f.kind for f in check_dataset(replace(dataset, simulation=None)))
        false.append((kind, found))
        progress.done(f"clean: {kind}, {dataset.source or dataset.name}", ", ".join(found) or "ok: nothing")
    progress.finish()
    tables = result_tables(outcomes, false)
    seeds_text = (
        f"seeds {start} to {start + seeds - 1} (planted), {start + 100} to {start + 99 + CLEAN_SEEDS * seeds} (clean)"
    )
    return write_page(out / f"check{'-development' * development}.md", tables, command, seeds_text), tables
