"""Start of the command line: `shipbench --help` and the lists, each in a fresh process, beside a bare interpreter.

    python benchmarks/startup.py [--runs N] [--quick] [--json FILE]

Target: `--help` and `models` under 0.4 s. Checked: every command succeeds and imports neither torch nor casadi.
"""

from __future__ import annotations

import resource
import subprocess
import sys
from statistics import median

import measure

COMMANDS = ("--help", "models", "effects", "data list")
TARGET_S = 0.4
_MODULES = "from shipbench.cli.app import app\ntry: app(sys.argv[1:])\nexcept SystemExit as end: assert not end.code"
_HEAVY = "{'torch', 'casadi', 'lightning', 'pandas', 'scipy', 'matplotlib'} & set(sys.modules)"


def run(*arguments: str) -> None:
    """One fresh interpreter."""
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)


def processor_seconds() -> float:
    """Of all children so far: a busy machine stretches the wall time of a start, hardly this."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Time every command in turn with `python -c pass`."""
    given = measure.options(__doc__, runs=9)
    measure.header(given, "typer")
    for command in COMMANDS:
        words = command.split()
        run("-c", f"import sys\n{_MODULES}\nassert not {_HEAVY}, {_HEAVY}", *words)
        pairs, before = [], processor_seconds()
        for _ in range(given.runs):
            pairs.append(
                (
                    measure.seconds(lambda words=words: run("-m", "shipbench", *words)),
                    measure.seconds(lambda: run("-c", "pass")),
                )
            )
        used = (processor_seconds() - before) / given.runs
        ours, bare = median(a for a, _ in pairs), median(b for _, b in pairs)
        aim = (
            f"target {TARGET_S:g} s: {'reached' if ours < TARGET_S else 'NOT reached'}"
            if command in COMMANDS[:2] and not given.quick
            else ""
        )
        smallest, largest = min(a for a, _ in pairs), max(a for a, _ in pairs)
        print(
            f"shipbench {command:10s} {ours:6.3f} s ({smallest:.3f} .. {largest:.3f})   python -c pass {bare:6.3f} "
            f"s   {aim}"
        )
        print(f"{'':20s} {used:6.3f} s of processor time for both")
        measure.record(
            given,
            {
                "title": f"shipbench {command}",
                "ours_s": ours,
                "peer_s": bare,
                "processor_s": used,
                "target_s": TARGET_S,
            },
        )
    print("agree: no command imports torch, casadi, lightning, pandas, scipy or matplotlib")


if __name__ == "__main__":
    main()
