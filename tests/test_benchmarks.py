"""The scripts of benchmarks/: they run and both sides agree (fits and trainings: `pytest -m long`). Their times are
never tested.

Those without a peer (growth, stacking, memory) take half a minute each even in their quick mode, and are left to
whoever measures.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SCRIPTS = {
    "rollouts_shipmmg": ("shipmmg",), "fit_scipy": (), "diagnosis_refits": (), "startup": (), "paper_study": (),
    "mlp_training": (),
    "neural_ode_training": (), "many_runs": (), "fmu_calibration": ("fmpy",),
}  # fmt: skip
LONG = ("fmu_calibration", "fit_scipy", "paper_study", "mlp_training", "neural_ode_training")


@pytest.mark.long
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long) if name in LONG else name for name in SCRIPTS]
)
def test_a_script_runs_and_its_sides_agree(name: str, tmp_path: Path):
    if missing := [package for package in SCRIPTS[name] if importlib.util.find_spec(package) is None]:
        pytest.skip(f"{missing[0]} is not installed")
    figures = tmp_path / "figures.jsonl"
    command = [sys.executable, f"benchmarks/{name}.py", "--quick", "--json", str(figures)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("$ python benchmarks/")
    assert {"machine", "versions"} <= json.loads(figures.read_text().splitlines()[0]).keys()
