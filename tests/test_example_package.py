"""The example package as a stranger would use it: installed into a folder of its own, then the README's command, in
fresh processes."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import shipbench

EXAMPLE = Path(__file__).parent.parent / "examples" / "shipbench-example"
README = (EXAMPLE / "README.md").read_text()
INSTALL, RUN = re.search(r"```bash\n(.*?)```", README, re.DOTALL)[1].strip().split("\n")


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    """Runs shipbench with the example package installed: `stranger("check", "nomoto")`."""
    base = tmp_path_factory.mktemp("stranger")
    site, work = base / "site", base / "work"
    shutil.copytree(EXAMPLE, work / "examples" / "shipbench-example")
    options = [
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--disable-pip-version-check",
        "--target",
        str(site),
    ]
    pip = shlex.split(INSTALL)
    subprocess.run([sys.executable, "-m", *pip[:2], *options, *pip[2:]], cwd=work, check=True, capture_output=True)
    paths = [str(site), str(Path(shipbench.__file__).parent.parent)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "SHIPBENCH_CACHE": str(base / "cache")}

    def run(*arguments: str, **more: str) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "shipbench", *arguments]
        return subprocess.run(command, cwd=work, env=environment | more, capture_output=True, text=True, check=False)

    return run


@pytest.mark.long
def test_two_commands_take_it_to_the_leaderboard_with_the_readmes_figures(stranger):
    done = stranger(*shlex.split(RUN)[1:], "--json")
    assert done.returncode == 0, done.stderr
    tables = json.loads(done.stdout)["leaderboards"]["barge_trial"]["tables"]
    found = {row["model"]: row for row in tables[0]["rows"]}
    across = next(
        {row["model"]: row["cross_track"] for row in t["rows"]} for t in tables if "cross_track" in t["columns"]
    )
    printed = re.findall(r"^ \d  (\S+) +12/12 +([\d.]+)", README, re.MULTILINE)
    assert [model for model, _ in printed] == list(found)
    for model, ed in printed:
        assert found[model]["runs"] == "12/12"
        assert found[model]["ed_mean"] == pytest.approx(float(ed), rel=0.05)
        said = re.search(rf"^ {re.escape(model)} +([\d.]+)$", README, re.MULTILINE)[1]
        assert across[model] == pytest.approx(float(said), rel=0.05)


def test_its_model_keeps_the_contract(stranger):
    done = stranger("check", "nomoto", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["broken"] == 0


def test_its_parts_are_listed_with_where_they_come_from(stranger):
    (model,) = [p for p in json.loads(stranger("models", "--json").stdout) if p["name"] == "nomoto"]
    assert model["from"] == "shipbench_example.nomoto:Nomoto"
    assert model["parameters"] == {"by_speed": "True"}
    assert model["unusable"] == ""
    assert [
        p["parameters"][0]["name"]
        for p in json.loads(stranger("effects", "--json").stdout)
        if p["name"] == "barge_alongside"
    ] == ["drag"]
    assert "barge_trial" in [p["name"] for p in json.loads(stranger("data", "list", "--json").stdout)]


def test_a_parameter_of_its_data_set_is_honoured_and_a_wrong_one_refused(stranger):
    assert stranger("data", "make", "barge_trial[drag=0.02]", "--out", "made").returncode == 0
    done = stranger("data", "make", "barge_trial[drig=0.02]", "--out", "made")
    assert done.returncode == 2
    assert "Did you mean 'drag'" in done.stderr


def test_a_broken_package_is_told_of_in_one_line_and_the_others_go_on(stranger, tmp_path):
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    groups = "\n".join(
        f"[shipbench.{g}]\nbroken = broken_package:Part" for g in ("predictors", "effects", "datasets", "metrics")
    )
    (info / "entry_points.txt").write_text(groups)
    (tmp_path / "broken_package.py").write_text("raise RuntimeError('half written')")
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    done = stranger("effects", PYTHONPATH=paths)
    why = (
        "plug-in broken_package:Part of package broken 1.0, cannot be imported: RuntimeError: half written. Mend "
        "it or uninstall it.\n"
    )
    assert (done.returncode, done.stderr) == (0, f"warning: effect 'broken', {why}")
    assert stranger("models", PYTHONPATH=paths).returncode == 0
    done = stranger("check", "hold", PYTHONPATH=paths)
    assert (done.returncode, done.stderr) == (0, "")
    done = stranger("check", "broken", PYTHONPATH=paths)
    assert (done.returncode, done.stderr) == (2, f"error: predictor 'broken', {why}")
