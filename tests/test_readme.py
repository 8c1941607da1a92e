"""The README's code runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from shipbench.bench.task import load_tasks
from shipbench.contract.base import BROKEN
from shipbench.contract.check import check_model
from shipbench.effects.base import EFFECTS
from shipbench.predictors.base import make_predictor, parse_spec

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def test_the_ten_lines_run(capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path))
    scope: dict = {}
    exec(compile(BLOCKS[0], "README.md", "exec"), scope)
    assert scope["S"].shape == (18, 120, 10)
    assert "p10" in capsys.readouterr().out


def test_the_model_of_ones_own_runs_from_its_file(tmp_path, harbour):
    path = tmp_path / "my_model.py"
    path.write_text(BLOCKS[1])
    model = make_predictor(parse_spec(f"{path}:Drift")).fit(harbour)
    batch = harbour.batch()
    assert np.isfinite(model.predict(batch.s0, batch.U)).all()
    assert check_model(f"{path}:Drift").of(BROKEN) == []


@pytest.mark.parametrize("config", sorted(set(re.findall(r"--config (\S+\.toml)", README))))
def test_every_config_that_is_named_exists_and_is_valid(config):
    assert load_tasks(ROOT / config, {})


def test_the_library_has_more_causes_than_the_readme_states():
    (stated,) = re.findall(r"causes out of more than (\d+)", README)
    assert len(EFFECTS.built_in()) > int(stated)


def test_ci_runs_the_readmes_test_command():
    block = re.search(r"<!-- test command -->\n```bash\n(.*?)```\n<!-- end -->", README, re.DOTALL)
    assert block is not None
    assert "-m pytest" in block[1]
    assert "<!-- test command -->" in (ROOT / ".ci" / "run").read_text()
