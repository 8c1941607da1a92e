"""Import of logs with a mapping (`import_logs`): a data set's folder and a summary, with memory that does not grow with
the logs."""

from __future__ import annotations

import fnmatch
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import InputError, option
from ..names import shown
from ..ship import Ship
from ..signals import COMMANDS
from ..steps import step
from .blocks import Block
from .cells import Counts
from .channels import all_channels, read_blocks
from .clock import is_absolute
from .fixes import fixes_only
from .mapping import Mapping, Source
from .north import without_interpolated
from .ordering import in_order
from .recordings import onward, parts, read_recordings
from .runs import Piece, on_grid, outliers, shortest_run, windows, without_standing
from .steps import steps_marked
from .stretches import Feed, Stretches
from .summary import Summary
from .thresholds import THRESHOLDS
from .writer import FolderWriter, run_name


@dataclass
class _Log:
    """Recording: its name and a stream for each source; `goes_on` where it continues the one before, after its clock
    was set back."""

    name: str
    files: str
    feeds: dict[str, Iterator[Block]] = field(default_factory=dict)
    goes_on: bool = False


def import_logs(
    logs: Sequence[Path], mapping: Mapping, ship: Ship, out: Path, *, force: bool = False,
    tell: Callable[[str], None] = lambda line: None
) -> Summary:  # fmt: skip
    """Write `out/{trajectories.*, dataset.toml, ship.toml}` from logs.

    With one source every file is a recording of its own. With several, the files of a source follow one another, and
    the sources are merged on time.

    Args:
        logs: files, in the order of time where a source has several.
        mapping: the columns of each channel.
        ship: the vessel's particulars.
        out: folder to write; it appears when everything is done.
        force: replace a data set that is there.
        tell: called with one line on each recording that is done.

    Raises:
        InputError: a fault of the files, the mapping or the folder; nothing is written then.
    """
    met, summary = Counts(), Summary(mapping)
    for path in logs:
        if not path.exists():
            raise InputError(f"cannot read {path}: no such file. Give the path of an existing log.")
    places = [path.resolve() for path in logs]
    if twice := [str(path) for k, path in enumerate(logs) if places[k] in places[:k]]:
        raise InputError(
            f"{twice[0]} is given twice; a run that stands twice would be on both sides of a fold. Give each log once."
        )
    if inside := [str(p) for p in logs if out.resolve() in p.resolve().parents]:
        raise InputError(
            f"{inside[0]} lies in the folder of the data set ({out}). Give another folder with "
            f"{option('--out', 'out=FOLDER')}."
        )
    taken: Counter[str] = Counter()
    with FolderWriter(out, force) as writer:
        for log in _recordings(logs, mapping, met):
            before = len(summary.runs)
            summary.recording(log.goes_on)
            for name, (stretch, alone, piece, zero) in _named(log, mapping, ship, summary):
                run = _free(name, taken)
                writer.add(run, np.round(piece.t - zero, 9), piece.columns)
                summary.doubtful.update(outliers(piece, ship))
                summary.add(run, log.files, piece, None if alone else f"{log.name}_stretch_{stretch:03d}", stretch)
            if len(summary.runs) > before or len(logs) > 1:
                tell(f"{log.name}: {len(summary.runs) - before} run(s)")
        summary.complete(met)
        if not summary.runs:
            raise InputError(summary.no_runs())
        summary.table = writer.finish(summary.description(), ship)
    return summary


def rehearse(logs: Sequence[Path], mapping: Mapping, ship: Ship, rows: int, read: int) -> Summary:
    """Import the first `rows` rows of each recording without writing anything, and read the logs on to row `read`.

    Raises:
        InputError: any error that the import would raise.
    """
    met, summary = Counts(), Summary(mapping)
    for log in _recordings(logs, mapping, met):
        log.feeds = {name: _beginning(blocks, rows) for name, blocks in log.feeds.items()}
        for name, (stretch, _, piece, _) in _named(log, mapping, ship, summary):
            summary.doubtful.update(outliers(piece, ship))
            summary.add(name, log.files, piece, None, stretch)
        if met.rows > read * len(mapping.sources):
            break
    met = Counts()
    for log in _recordings(logs, mapping, met):
        for blocks in log.feeds.values():
            for _ in _beginning(blocks, read):
                pass
        if met.rows > read * len(mapping.sources):
            break
    summary.complete(met)
    if not summary.runs:
        raise InputError(summary.no_runs())
    return summary


def _beginning(blocks: Iterator[Block], rows: int) -> Iterator[Block]:
    """Blocks with the first `rows` rows."""
    for block in blocks:
        yield block.rows(slice(0, rows))
        rows -= len(block.t)
        if rows <= 0:
            return


def _free(name: str, taken: Counter[str]) -> str:
    """Name as given, or with a number where it is taken."""
    candidate = name
    while taken[candidate]:
        taken[name] += 1
        candidate = f"{name}_{taken[name]}"
    taken[candidate] = 1
    return candidate


def _recordings(logs: Sequence[Path], mapping: Mapping, met: Counts) -> Iterator[_Log]:
    if len(mapping.sources) == 1:
        ((source_name, source),) = mapping.sources.items()
        for number, path in enumerate(logs):
            step(f"read {path.name}", number / len(logs), (number + 1) / len(logs))
            for name, blocks in read_recordings(path, source, met):
                for place, part in enumerate(parts(_clean(blocks, source, mapping, str(path), met))):
                    yield _Log(
                        run_name(name if name is not None else _stem(path)),
                        shown(path.name),
                        {source_name: part},
                        place > 0,
                    )
        return
    kinds = {is_absolute(s.time) for s in mapping.sources.values()}
    if len(kinds) > 1:
        told = ", ".join(f"{n} '{s.time.format}'" for n, s in mapping.sources.items())
        raise InputError(
            f"the sources' clocks cannot be merged: {told}. Accepted: time stamps in all of them, or counted "
            "seconds in all of them."
        )
    files = _share_out(logs, mapping.sources)
    feeds = {}
    for name, source in mapping.sources.items():
        where = ", ".join(map(str, files[name]))
        feeds[name] = onward(_clean(_chained(files[name], source, met), source, mapping, where, met), met)
    yield _Log(run_name(mapping.name), ", ".join(shown(p.name) for p in logs), feeds)


def _clean(blocks: Iterable[Block], source: Source, mapping: Mapping, where: str, met: Counts) -> Iterator[Block]:
    """Rows of a recording in order, without repeated fixes, and marked where its clock was set."""
    channels = tuple(source.channels)
    gap = max((mapping.gap(name) for name in channels if name in ("x", "lat")), default=0.0)
    return steps_marked(fixes_only(in_order(blocks, source, where, met), channels, met), source, gap, met)


def _chained(paths: list[Path], source: Source, met: Counts) -> Iterator[Block]:
    """Blocks of one file after another."""
    for path in paths:
        step(f"read {path.name}", 0.0, 1.0)
        for _, block in read_blocks(path, source, met):
            yield block


def _share_out(logs: Sequence[Path], sources: dict[str, Source]) -> dict[str, list[Path]]:
    """Files of each source, by the patterns of the mapping."""
    files = {name: [p for p in logs if fnmatch.fnmatch(p.name, source.files)] for name, source in sources.items()}
    for name, found in files.items():
        if not found:
            told = ", ".join(p.name for p in logs)
            raise InputError(
                f"no log for the source '{name}' (files = \"{sources[name].files}\"). Given: {told}. Give it, or "
                "correct `files`."
            )
    unused = [p for p in logs if not any(p in found for found in files.values())]
    if unused:
        told = ", ".join(f'{n} "{s.files}"' for n, s in sources.items())
        raise InputError(
            f"{unused[0]} belongs to no source; their files: {told}. Leave it out, or correct `files` in the mapping."
        )
    return files


def _stem(path: Path) -> str:
    name = path.name
    for suffix in (".gz", ".bz2", ".xz"):
        name = name.removesuffix(suffix)
    return Path(name).stem


_Run = tuple[int, bool, Piece, float]
"""Number of the stretch, whether the run is alone in its group, samples, zero of its time."""


def _named(log: _Log, mapping: Mapping, ship: Ship, summary: Summary) -> Iterator[tuple[str, _Run]]:
    """Name and content of each run of a recording; one run alone keeps the recording's name."""
    waiting: tuple[str, _Run] | None = None
    count = 0
    for count, run in enumerate(_runs(log, mapping, ship, summary), start=1):
        if waiting is not None:
            yield waiting
        waiting = (f"{log.name}_{count:03d}", run)
    if waiting is not None:
        yield (log.name if count == 1 else waiting[0], waiting[1])


def _runs(log: _Log, mapping: Mapping, ship: Ship, summary: Summary) -> Iterator[_Run]:
    channels, dt = all_channels(mapping), mapping.dt
    feeds = [Feed(blocks, tuple(mapping.sources[name].channels)) for name, blocks in log.feeds.items()]
    gaps = {name: mapping.gap(name) for name in channels}
    longest = max(math.floor(mapping.split.longest / dt + 1e-6), 1) * dt
    stretches = Stretches(feeds, gaps, frozenset(COMMANDS), longest, dt, THRESHOLDS.count("filter_context") * dt)
    absolute = is_absolute(next(iter(mapping.sources.values())).time)
    number = 0
    for stretch in stretches:
        zero = stretches.start if absolute else 0.0
        number += stretch.part == 0
        alone = mapping.split.window is not None or (stretch.last and stretch.part == 0)
        if stretch.end - stretch.start < dt:
            summary.cut("shorter than dt", stretch.end - stretch.start)
            continue
        _check_step(mapping, stretches.steps)
        series, made_up = without_interpolated(stretch.series)
        summary.interpolated += made_up
        samples = on_grid(replace(stretch, series=series), mapping, ship)
        for moving in _told(without_standing(samples, mapping), len(samples.t), mapping, summary):
            for piece in windows(moving, mapping):
                length = (len(piece.t) - 1) * dt
                if length < shortest_run(mapping) * (1 - 1e-9):
                    summary.cut(f"shorter than {shortest_run(mapping):g} s", length)
                else:
                    yield number, alone, piece, zero
    if math.isnan(stretches.start):
        return
    summary.steps |= stretches.steps
    summary.span(stretches.end - stretches.start, stretches.longest if stretches.longest < longest else None)
    for cut in stretches.cuts:
        if cut.end - cut.start > dt * (1 + 1e-6):
            summary.gap(cut)


def _check_step(mapping: Mapping, steps: dict[str, float]) -> None:
    finest = min(steps, key=lambda name: steps[name])
    most = THRESHOLDS.count("steps_per_sample")
    if mapping.dt < steps[finest] / most:
        raise InputError(
            f"dt = {mapping.dt:g} s is less than 1/{most} of the time between samples of '{finest}', the fastest "
            f"channel ({steps[finest]:g} s). "
            "Accepted: a dt that the log can show. Give a longer one."
        )


def _told(pieces: Iterator[Piece], samples: int, mapping: Mapping, summary: Summary) -> Iterator[Piece]:
    """Pieces, with the time at rest added to the summary."""
    kept = 0
    for piece in pieces:
        kept += len(piece.t)
        yield piece
    if samples > kept:
        summary.cut(f"standing still (below {mapping.split.still_speed:g} m/s)", (samples - kept) * mapping.dt)
