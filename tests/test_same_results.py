"""`benchmarks/same_results.py` tells results that differ from results that were made at another time."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "same_results.py"


def compared(old: Path, new: Path) -> tuple[int, str]:
    """Exit status and output of the comparison."""
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(old), str(new)], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout


def test_times_may_differ_and_results_may_not(tmp_path: Path) -> None:
    row = {"verdict": "found", "named": ["current"], "seconds": 3.0, "scores": {"current": 40.0}}
    for folder, change in (("old", {}), ("later", {"seconds": 9.0}), ("other", {"scores": {"current": 41.0}})):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.json").write_text(json.dumps(row | change))
    assert compared(tmp_path / "old", tmp_path / "later") == (0, "1 documents compared, 0 differ\n")
    status, said = compared(tmp_path / "old", tmp_path / "other")
    assert (status, said.splitlines()[0]) == (1, "a.json/scores/current: 40.0 -> 41.0")
    (tmp_path / "other" / "b.json").write_text("{}")
    assert "only in" in compared(tmp_path / "old", tmp_path / "other")[1]
