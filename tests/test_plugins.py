"""Parts of outside packages: found by their entry points; a broken one or a name clash never takes another command
down."""

from __future__ import annotations

import json
import logging
import sys
from importlib.metadata import EntryPoint

import pytest
from typer.testing import CliRunner

from shipbench import registry
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.cli.app import app
from shipbench.data.base import DATASETS, _cache_key, load_dataset
from shipbench.data.files import write_dataset
from shipbench.effects.base import EFFECTS
from shipbench.errors import InputError
from shipbench.metrics.base import METRICS
from shipbench.predictors.base import PREDICTORS, make_predictor, parse_spec
from shipbench.reports.listing import describe_parts

GOOD = """
import numpy as np

class Mine:
    name = "mine"
    def fit(self, train, valid=None, *, seed=0): return self
    def predict(self, s0, U, history=None): return np.repeat(s0[:, None], U.shape[1], axis=1)
"""


@pytest.fixture
def installed(monkeypatch, tmp_path):
    """`installed("group", name="module:object")`: as if a package had registered these; `stranger` is a module with the
    model `Mine`."""
    points: list[EntryPoint] = []
    (tmp_path / "stranger.py").write_text(GOOD)
    for module in ("stranger", "tank", "raises", "leaves", "kit"):  # of an earlier test's folder
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(registry, "scanned", lambda group: [p for p in points if p.group == group])
    monkeypatch.setattr(registry, "_problems", {})
    monkeypatch.setattr(registry, "_told", set())

    def add(group: str, **named: str) -> None:
        points.extend(EntryPoint(name, value, f"shipbench.{group}") for name, value in named.items())

    return add


def shipbench(*arguments: str):
    return CliRunner().invoke(app, [*arguments])


def test_a_model_of_an_installed_package_is_found_by_its_entry_point(installed):
    installed("predictors", mine="stranger:Mine")
    assert "mine" in PREDICTORS.names()
    assert make_predictor(parse_spec("mine")).name == "mine"


def test_data_sets_of_packages_use_the_group_of_the_contract(installed, tmp_path):
    (tmp_path / "tank.py").write_text(
        "from dataclasses import replace\nfrom shipbench.data.harbour90 import DATASET\n"
        "D = replace(DATASET, name='tank')"
    )
    installed("datasets", tank="tank:D")
    assert "tank" in DATASETS.names()
    assert "tank" in shipbench("data", "list").stdout


@pytest.mark.parametrize("parts", [PREDICTORS, EFFECTS, DATASETS, METRICS], ids=lambda r: r.kind)
@pytest.mark.parametrize("value", ["no_such_package:Thing", "raises:Thing", "leaves:Thing", "stranger:np"])
def test_a_plug_in_that_cannot_be_used_is_told_of_once_and_says_why_when_asked_for(
    installed, parts, value, tmp_path, caplog
):
    (tmp_path / "raises.py").write_text("raise RuntimeError('two\\nlines')")
    (tmp_path / "leaves.py").write_text("import sys\nsys.exit('bye')")
    installed(parts.group or parts.folder, broken=value)
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            assert set(parts.names()) - set(parts.built_in()) <= ({"broken"} if parts.lazy else set())
    lines = [r.getMessage() for r in caplog.records]
    assert len(lines) == (0 if parts.lazy else 1), "a predictor is imported only when it is asked for"
    assert all(f"{parts.kind} 'broken', plug-in {value}" in line and "\n" not in line for line in lines)
    with pytest.raises(InputError, match=rf"{parts.kind} 'broken'.*(cannot be imported|is no {parts.kind}).*uninstall"):
        parts.get("broken")


def test_listings_go_on_without_a_broken_plug_in(installed):
    for group in ("predictors", "effects", "datasets", "metrics"):
        installed(group, broken="no_such_package:Thing")
    for command, known in (("models", "hold"), ("effects", "current"), ("data list", "harbour90")):
        result = shipbench(*command.split())
        assert result.exit_code == 0, result.output
        assert known in result.stdout
    assert "NOT USABLE HERE: predictor 'broken'" in shipbench("models").stdout


def test_a_broken_plug_in_asked_for_is_one_message_and_exit_code_two(installed, tmp_path):
    for group in ("predictors", "effects", "datasets"):
        installed(group, broken="no_such_package:Thing")
    for arguments in (["-m", "broken"], ["-m", "physics+broken"], ["-m", "hold", "-d", "broken"]):
        result = shipbench("run", *arguments, "--out", str(tmp_path / "out"))
        assert (result.exit_code, result.output.count("\n")) == (2, 1), result.output
        assert "cannot be imported: ModuleNotFoundError: No module named 'no_such_package'" in result.output


def test_a_package_that_takes_a_name_of_ours_is_refused_and_harms_no_other_name(installed, caplog):
    installed("predictors", lstm="stranger:Mine")
    assert set(PREDICTORS.names()) == set(PREDICTORS.built_in())
    assert "'lstm' is defined twice: in shipbench itself and in the plug-in stranger:Mine" in caplog.text
    with pytest.raises(InputError, match=r"'lstm' is defined twice.*stranger:Mine.*Rename"):
        PREDICTORS.get("lstm")
    assert PREDICTORS.get("hold").name == "hold"


def test_two_packages_that_take_one_name_are_both_named(installed):
    installed("metrics", mine="stranger:a")
    installed("metrics", mine="other:b")
    with pytest.raises(InputError, match=r"in the plug-in stranger:a and in the plug-in other:b"):
        METRICS.get("mine")
    assert "mine" not in METRICS.names()


def test_a_plug_in_that_calls_itself_otherwise_is_refused(installed):
    installed("datasets", tank="shipbench.data.harbour90:DATASET")  # its cache would be that of harbour90
    with pytest.raises(InputError, match="calls itself 'harbour90'"):
        load_dataset("tank")


@pytest.mark.long
def test_a_changed_plug_in_is_another_model_for_resume(installed, toy, tmp_path):
    installed("predictors", mine="stranger:Mine")
    about = tmp_path / "stranger-1.0.dist-info"  # the model runs in a process of its own, which reads what is installed
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[shipbench.predictors]\nmine = stranger:Mine\n")
    write_dataset(toy(runs=4), tmp_path / "toy")
    task = make_task({"dataset": str(tmp_path / "toy"), "models": ["mine", "hold"], "folds": 2, "horizon_s": 20.0})

    def kept() -> set[str]:
        """The models whose cells another run would keep."""
        run_tasks([task], tmp_path / "out")
        return {name for name in keys if _keys(tmp_path / "out", name) == keys[name]}

    run_tasks([task], tmp_path / "out")
    keys = {name: _keys(tmp_path / "out", name) for name in ("mine", "hold")}
    assert kept() == {"mine", "hold"}
    (tmp_path / "stranger.py").write_text(GOOD + "# changed")
    assert kept() == {"hold"}


def _keys(out, model: str) -> list[str]:
    """What `--resume` compares."""
    return [json.loads(p.read_text())["key"] for p in sorted(out.glob(f"cells/*/{model}/*/summary.json"))]


def test_a_changed_helper_beside_the_plug_ins_module_is_another_version_too(installed, tmp_path):
    package = tmp_path / "kit" / "models"
    package.mkdir(parents=True)
    (package.parent / "__init__.py").touch()
    (package / "mine.py").write_text(GOOD)
    (package.parent / "helper.py").write_text("x = 1")
    installed("predictors", mine="kit.models.mine:Mine")
    before = PREDICTORS.digest("mine")
    assert (PREDICTORS.package("mine"), PREDICTORS.package("hold")) == ("kit", "")
    (package.parent / "helper.py").write_text("x = 2")
    assert PREDICTORS.digest("mine") != before != PREDICTORS.digest("hold") == ""


def test_installed_packages_are_gone_through_once_in_a_process(monkeypatch):
    asked = []
    monkeypatch.setattr(registry, "entry_points", lambda group: asked.append(group) or [])
    registry.scanned.cache_clear()
    for _ in range(3):
        METRICS.get("ed")
        METRICS.names()
    registry.scanned.cache_clear()
    assert asked == ["shipbench.metrics"]


def test_a_changed_plug_in_is_another_data_set_for_the_cache(installed, tmp_path):
    source = (
        "from dataclasses import replace\nfrom shipbench.data.harbour90 import DATASET\n"
        "D = replace(DATASET, name='tank')"
    )
    (tmp_path / "tank.py").write_text(source)
    installed("datasets", tank="tank:D")
    before = _cache_key(DATASETS.get("tank"), {})
    (tmp_path / "tank.py").write_text(source + "# changed")
    assert _cache_key(DATASETS.get("tank"), {}) != before
    assert _cache_key(DATASETS.get("harbour90"), {}) == "harbour90-v1"  # ours keep the names that they had


def test_a_model_whose_optional_package_is_missing_is_listed_as_not_installed(monkeypatch):
    monkeypatch.setitem(sys.modules, "pysindy", None)
    unusable = {part["name"]: part["unusable"] for part in describe_parts(PREDICTORS)}
    assert unusable["pysindy"] == "needs pysindy, which is not installed. Install it: pip install 'shipbench[pysindy]'"
    assert unusable["hold"] == ""
