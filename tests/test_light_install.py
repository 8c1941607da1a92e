"""The core without the extra `networks`: everything but the networks works, and these say the one command."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from shipbench.data.files import write_dataset
from shipbench.extras import EXTRAS
from shipbench.predictors.base import PREDICTORS

ROOT = Path(__file__).parent.parent
NETWORKS = ("lightning", "torch", "torchdiffeq")
WITHOUT = f"""import sys
from importlib.machinery import PathFinder
found = PathFinder.find_spec
def without(name, path=None, target=None):
    return None if name.partition(".")[0] in {NETWORKS} else found(name, path, target)
PathFinder.find_spec = without
"""


def without_networks(code: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", WITHOUT + code], capture_output=True, text=True, check=False, cwd=cwd)


def command(*words: str) -> str:
    return f"from shipbench.cli.app import main; sys.argv = ['shipbench', *{words!r}]; main()"


@pytest.fixture
def folder(toy, tmp_path):
    write_dataset(toy(runs=4), tmp_path / "toy")
    return tmp_path


def test_the_core_fits_scores_checks_and_draws(folder):
    done = without_networks(
        "import shipbench as sb\n"
        "data = sb.load_dataset('toy')\n"
        "scores = sb.benchmark(['physics', 'hold'], data, horizon=20, folds=2)\n"
        "scores.report('report.html'); sb.check_data(data)\n"
        "assert not set(scores.table()['ED'].isna()) - {False}, scores.table()\n",
        folder,
    )
    assert done.returncode == 0, done.stderr
    assert (folder / "report.html").stat().st_size > 10_000


@pytest.mark.parametrize("name", ["mlp", "lstm", "neural_ode", "neural_ode+current"])
def test_a_network_is_refused_before_the_study_with_the_one_command(folder, name):
    done = without_networks(
        command("run", "-d", "toy", "-m", "hold", "-m", name, "--horizon", "20", "-o", "out"), folder
    )
    assert done.returncode == 2
    assert re.search(
        r"needs torch\w*, which is not installed\.\s+Install it: pip install\s+'shipbench\[networks\]'",
        done.stderr + done.stdout,
    )
    assert "Traceback" not in done.stderr
    assert not (folder / "out").exists()


def test_models_marks_the_networks_and_no_other(folder):
    done = without_networks(
        "from shipbench.reports.listing import describe_parts; from shipbench.errors import InputError\n"
        "from shipbench.predictors.base import PREDICTORS\n"
        "for part in describe_parts(PREDICTORS):\n"
        "    try: PREDICTORS.get(part['name']); refused = ''\n"
        "    except InputError as error: refused = str(error)\n"
        "    assert bool(refused) == bool(part['unusable']), (part['name'], refused)\n"
        "    print(part['name'], bool(refused))\n",
        folder,
    )
    assert done.returncode == 0, done.stderr
    marked = {line.split()[0] for line in done.stdout.splitlines() if line.endswith("True")}
    assert marked == {"lstm", "mlp", "neural_ode"}


def test_every_extra_of_the_table_brings_its_package():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for distribution, extra in EXTRAS.values():
        assert any(re.match(rf"{re.escape(distribution)}\b", requirement) for requirement in extras[extra]), (
            distribution
        )


def test_the_core_does_not_depend_on_an_extra():
    core = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    names = {re.match(r"[\w-]+", requirement).group() for requirement in core}
    assert not names & {distribution for distribution, _ in EXTRAS.values()}


def test_what_a_predictor_needs_is_in_the_table():
    for name in PREDICTORS.built_in():
        tree = ast.parse((ROOT / "shipbench" / "predictors" / f"{name}.py").read_text())
        needs = [
            n.value
            for n in ast.walk(tree)
            if isinstance(n, ast.AnnAssign) and getattr(n.target, "id", "") == "needs" and n.value
        ]
        for value in needs:
            assert set(ast.literal_eval(value)) <= set(EXTRAS)
