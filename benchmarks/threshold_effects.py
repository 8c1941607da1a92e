"""Which thresholds of the data check decide: `python benchmarks/threshold_effects.py [--faults 1] [--clean 9] [ROW]`.

Each number of `shipbench/checking/thresholds.py` is halved and doubled on development sets of `shipbench suite check`:
every planted fault, on the sources in turn, and every ninth clean set. Printed are the sets that look the number up,
the findings that come or go, and the false ones among those that come. A row without a change is a candidate to be
merged or dropped.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import Any
from unittest.mock import patch

from shipbench.checking import base, response, track, track_findings, units, yaw
from shipbench.checking.reading import read_recording
from shipbench.checking.recording import Recording
from shipbench.checking.thresholds import THRESHOLDS
from shipbench.records import Dataset
from shipbench.signals import STATES
from shipbench.suites.checks.clean_sets import base_set, clean_sets, sources_of
from shipbench.suites.checks.faults import FAULTS
from shipbench.suites.checks.outcome import CLEAN_SEEDS, OFFSET
from shipbench.suites.checks.suite import write_planted
from shipbench.thresholds import Threshold

FACTORS = (0.5, 2.0)
SEED = 580 + OFFSET
ROWS = dict(THRESHOLDS.rows)
STEPS = (
    (base, "correct_placeholders"), (base, "correct_north"), (base, "correct_held"), (base, "correct_gross"),
    (units, "_motion"), (units, "rudder_side"), (response, "_search"), (track, "explain"),
    (track_findings, "explain"), (yaw, "_settled"),
)  # fmt: skip
"""Steps of a check that are remembered beside the checks themselves: those that take longest."""
Case = tuple[str, int | None, Recording]
"""Label, number of the fault (None: clean), recording."""


class Rows(dict[str, Threshold]):
    """Rows of the table. `asked`: name -> value, of the numbers that each step under way looked up."""

    def __init__(self, rows: dict[str, Threshold]) -> None:
        super().__init__(rows)
        self.asked: list[dict[str, float]] = [{}]

    def __getitem__(self, name: str) -> Threshold:
        row = super().__getitem__(name)
        self.note({name: row.value})
        return row

    def note(self, values: dict[str, float]) -> None:
        """Add numbers to those that the steps under way looked up."""
        for asked in self.asked:
            asked |= values


def content(value: Any) -> bytes:
    """Digest of an argument of a step."""
    dataset = value.dataset if isinstance(value, Recording) else value
    if isinstance(dataset, Dataset):
        arrays = (a.tobytes() for run in dataset.runs for a in (run.t, run.states, run.inputs))
        return blake2b(b"".join(arrays)).digest()
    return b"" if isinstance(value, list) else str(getattr(value, "cause", value)).encode()


def remembered(step: Callable[..., Any], rows: Rows) -> Callable[..., Any]:
    """A step whose results are kept until a number that it looked up changes."""
    kept: dict[tuple[bytes, ...], list[tuple[dict[str, float], Any]]] = {}

    def call(*args: Any) -> Any:
        results = kept.setdefault(tuple(map(content, args)), [])
        for values, result in results:
            if all(dict.__getitem__(rows, name).value == value for name, value in values.items()):
                rows.note(values)
                return result
        rows.asked.append({})
        result = step(*args)
        results.append((rows.asked.pop(), result))
        return result

    return call


def scaled(row: Threshold, factor: float) -> float:
    """Value times a factor. Counts stay whole, shares below 1, and ratios above it."""
    if isinstance(row.value, int):
        return round(row.value * factor)
    if row.value < 1.0 < row.value * factor:
        return 0.5 * (1.0 + row.value)
    return 1.0 + (row.value - 1.0) * factor if row.unit == "times" else row.value * factor


def expected(number: int | None, kind: str, channels: tuple[str, ...]) -> bool:
    """Whether a fault calls for a finding, or explains it."""
    return number is not None and (FAULTS[number].expects(kind, channels) or kind in FAULTS[number].also)


def effects(case: Case, names: list[str]) -> dict[tuple[str, float], tuple[int, int, str]]:
    """(row, factor) -> findings that change, false ones among those that come, and which; of the rows looked up."""
    label, number, recording = case
    rows = Rows(ROWS)

    def found() -> Counter[tuple[str, tuple[str, ...]]]:
        return Counter((f.kind, f.channels) for f in base.check_recording(recording))

    with ExitStack() as stack:
        stack.enter_context(patch.object(THRESHOLDS, "rows", rows))
        checks = tuple(remembered(check, rows) for check in base._checks())
        stack.enter_context(patch.object(base, "_checks", lambda: checks))
        for module, name in STEPS:
            stack.enter_context(patch.object(module, name, remembered(getattr(module, name), rows)))
        plain = found()
        asked, result = set(rows.asked[0]), {}
        for name, factor in ((n, f) for n in names if n in asked for f in FACTORS):
            rows[name] = replace(ROWS[name], value=scaled(ROWS[name], factor))
            come, gone = (now := found()) - plain, plain - now
            rows[name] = ROWS[name]
            false = sum(n for f, n in come.items() if not expected(number, *f))
            result[name, factor] = (come.total() + gone.total(), false, f"{label}: +{list(come)} -{list(gone)}")
    return result


def cases(every_fault: int, every_clean: int) -> Iterator[Case]:
    """Development sets: planted faults, then clean sets."""
    with tempfile.TemporaryDirectory() as scratch:
        for number in range(0, len(FAULTS), every_fault):
            fault = FAULTS[number]
            source = sources_of(fault.wind)[number % len(sources_of(fault.wind))]
            folder = write_planted(base_set(source, SEED, fault.wind), fault, SEED, Path(scratch) / str(number))
            yield f"{fault.name}, {source}", number, read_recording(str(folder))[0]
    for kind, make in list(clean_sets([SEED + 100 + i for i in range(CLEAN_SEEDS)]))[::every_clean]:
        data = replace(make(), simulation=None)
        yield f"{kind}, {data.name}", None, Recording(data, recorded=frozenset((*STATES, *data.inputs)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", type=int, default=1, help="every how-many-th fault")
    parser.add_argument("--clean", type=int, default=9, help="every how-many-th clean set")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--verbose", action="store_true", help="which findings change")
    parser.add_argument("rows", nargs="*", default=list(ROWS), help="rows of the table (default: all)")
    given = parser.parse_args()
    with ProcessPoolExecutor(given.jobs) as pool:
        every = list(pool.map(partial(effects, names=given.rows), cases(given.faults, given.clean)))
    print(f"{len(every)} development sets. Findings that change, and false ones that come:")
    print(f"{'row':24}{'value':>10}{'asked by':>10}" + "".join(f"{f'times {f:g}':>14}" for f in FACTORS))
    for name in given.rows:
        by_factor = [[e[name, factor] for e in every if (name, factor) in e] for factor in FACTORS]
        cells = [f"{sum(m[0] for m in mine)} ({sum(m[1] for m in mine)})" for mine in by_factor]
        print(f"{name:24}{ROWS[name].value:10g}{len(by_factor[0]):10d}" + "".join(f"{cell:>14}" for cell in cells))
        for factor, mine in zip(FACTORS, by_factor, strict=True):
            for changed, _, which in mine if given.verbose else ():
                if changed:
                    print(f"    times {factor:g}, {which}")


if __name__ == "__main__":
    main()
