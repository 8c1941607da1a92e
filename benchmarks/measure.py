"""What every script of this folder shares: machine, versions, two sides timed in turn, medians and their ratio.

    options = measure.options(__doc__)
    measure.header(options, "shipmmg", "scipy")
    measure.compare("batch of rollouts", ours=Side("simulator.rollout(s0, U, 1.0)", ours),
    peer=Side("simulate_mmg_3dof(...)", peer), given=options)

The sides run in turn (ours, peer, ours, peer ...), so that whatever else the machine does falls on both; the first call
of each is not counted unless `warm=False`. A ratio is the median of the ratios of neighbouring runs; beside it stand
the smallest and the largest of them.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Any

import psutil

ALWAYS = ("shipbench", "numpy", "scipy", "casadi", "torch")


@dataclass(frozen=True)
class Options:
    """What the command line asked for: interleaved runs of both sides, a small case for a test of the script itself, a
    file for the figures, and some of the cases (none: all)."""

    runs: int
    quick: bool
    json: Path | None
    only: tuple[str, ...] = ()


@dataclass(frozen=True)
class Side:
    """One of two sides: its call as a user would write it, and the function that makes it; `calls` is how many a run of
    `call` makes."""

    command: str
    call: Callable[[], Any]
    calls: int = 1


@dataclass(frozen=True)
class Comparison:
    """Seconds of one call of each side (medians) and peer over ours: median, smallest and largest ratio of neighbouring
    runs."""

    title: str
    ours_command: str
    peer_command: str
    ours_s: float
    peer_s: float
    ratio: float
    ratio_min: float
    ratio_max: float
    runs: int
    target: float | None


def options(doc: str | None, runs: int = 5, cases: Sequence[str] = ()) -> Options:
    """`--runs N`, `--quick`, `--json FILE`, and `--only CASE ...` where there are `cases`; `doc` is the script's
    docstring, shown by `--help`."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=runs, help=f"interleaved runs of both sides (default {runs})")
    parser.add_argument(
        "--quick",
        action="store_true",
        help="a small case, to see that the script runs and both sides agree; its times say nothing",
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="append machine and figures to FILE, one JSON document a line"
    )
    if cases:
        parser.add_argument(
            "--only", nargs="+", choices=cases, default=[], metavar="CASE", help=f"some of: {'; '.join(cases)}"
        )
    given = parser.parse_args()
    return Options(
        1 if given.quick else max(1, given.runs), given.quick, given.json, tuple(given.only) if cases else ()
    )


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, memory, load of the last minute, Python, platform."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        models = [
            line.partition(":")[2].strip() for line in info.read_text().splitlines() if line.startswith("model name")
        ]
        name = models[0] if models else name
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "cpu": name,
        "cores": cores,
        "memory_GB": round(psutil.virtual_memory().total / 1e9, 1),
        "load": round(os.getloadavg()[0], 2),
        "threads": os.environ.get("OMP_NUM_THREADS", "default"),
        "python": platform.python_version(),
        "platform": platform.system(),
    }


def versions(*packages: str) -> dict[str, str]:
    """Versions of shipbench, what it computes with, and `packages`, read without importing them."""

    def of(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return "not installed"

    return {name: of(name) for name in (*ALWAYS, *packages)}


def header(given: Options, *packages: str) -> None:
    """Print the script's command, the machine and the versions."""
    print("$ python " + " ".join([f"benchmarks/{Path(sys.argv[0]).name}", *sys.argv[1:]]))
    print("machine: " + ", ".join(f"{k} {v}" for k, v in machine().items()))
    print("versions: " + ", ".join(f"{k} {v}" for k, v in versions(*packages).items()))
    if given.quick:
        print("quick: a small case; its times say nothing")


def seconds(call: Callable[[], Any]) -> float:
    """Wall time of one call."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def compare(
    title: str, ours: Side, peer: Side, given: Options, *, target: float | None = None, warm: bool = True
) -> Comparison:
    """Time both sides in turn, `given.runs` times, print what came out, and append it to `given.json`.

    Args:
        title: what is compared.
        ours, peer: the two sides.
        given: the script's options.
        target: ratio that is to be reached, if any.
        warm: call each side once before the clock starts.
    """
    if warm:
        ours.call()
        peer.call()
    pairs = [(seconds(ours.call) / ours.calls, seconds(peer.call) / peer.calls) for _ in range(given.runs)]
    ratios = [b / a for a, b in pairs]
    found = Comparison(
        title, ours.command, peer.command, median(a for a, _ in pairs), median(b for _, b in pairs),
        median(ratios), min(ratios), max(ratios), given.runs, target,
    )  # fmt: skip
    print(f"{title}  (median of {found.runs} interleaved runs)")
    print(f"  ours  {found.ours_s:12.6f} s  {found.ours_command}")
    print(f"  peer  {found.peer_s:12.6f} s  {found.peer_command}")
    aim = (
        ""
        if target is None or given.quick
        else f"; target {target:g}: {'reached' if found.ratio >= target else 'NOT reached'}"
    )
    print(f"  ratio {found.ratio:10.2f}    ({found.ratio_min:.2f} .. {found.ratio_max:.2f}){aim}")
    record(given, asdict(found))
    return found


def record(given: Options, figures: dict[str, Any]) -> None:
    """Append the script's name, machine, versions and `figures` to `given.json`, if one was asked for."""
    if given.json is not None:
        line = {
            "script": Path(sys.argv[0]).name,
            "quick": given.quick,
            "machine": machine(),
            "versions": versions(),
            **figures,
        }
        with given.json.open("a") as file:
            file.write(json.dumps(line) + "\n")


def agree(what: str, difference: float, accepted: float, unit: str = "") -> None:
    """Print that both sides agree, or stop the script.

    Raises:
        SystemExit: they do not; the ratio of two different results would mean nothing.
    """
    if not difference <= accepted:
        raise SystemExit(
            f"the sides do not agree in {what}: they differ by {difference:.3g} {unit}, accepted: {accepted:.3g} "
            f"{unit}."
        )
    print(f"agree: {what} within {difference:.3g} {unit} (accepted {accepted:.3g})")
