"""The notebooks of docs/notebooks: they run, show little text, are short, and are committed without outputs."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from shipbench.contract.base import BROKEN
from shipbench.contract.check import check_model

nbformat = pytest.importorskip("nbformat", reason="nbclient is not installed (extra `docs`)")
ROOT = Path(__file__).parent.parent
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
MOST_CELLS, MOST_TEXT = 14, 1000
PARAMETRIZED = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)


@pytest.fixture(scope="module")
def hook():
    spec = importlib.util.spec_from_file_location("notebooks_hook", ROOT / "docs" / "notebooks_hook.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["own-simulation", "pytorch-model", "sea-trial"]


@PARAMETRIZED
def test_a_notebook_is_short_and_committed_without_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert len(notebook.cells) <= MOST_CELLS
    assert notebook.cells[0].source.startswith("# ")
    assert "do not rank models" in notebook.cells[0].source
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None


@pytest.mark.long
@PARAMETRIZED
def test_a_notebook_runs_and_its_outputs_are_short(path, hook):
    notebook = hook.executed(path, again=True)
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert outputs
    for output in outputs:
        assert output.output_type != "error", output
        if output.output_type == "stream":
            assert "Warning" not in output.text
            assert output.name == "stderr" or len(output.text) <= MOST_TEXT
        else:
            assert len(output.data["text/plain"]) <= MOST_TEXT


def test_a_cell_that_fails_stops_the_site(tmp_path, hook):
    path = tmp_path / "wrong.ipynb"
    nbformat.write(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1 / 0")]), path)
    with pytest.raises(Exception, match="ZeroDivisionError"):
        hook.executed(path)


def test_an_executed_notebook_is_kept_until_its_text_changes(tmp_path, hook, monkeypatch):
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "time.ipynb"

    def shown(code: str) -> str:
        nbformat.write(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code, id="time")]), path)
        return hook.to_markdown(hook.executed(path))

    first = shown("import time\nprint('<', time.time_ns())")
    assert '<pre class="output">&lt; ' in first
    assert shown("import time\nprint('<', time.time_ns())") == first
    assert shown("import time\nprint('<', time.time_ns() )").split("output")[1] != first.split("output")[1]


@pytest.mark.long
@pytest.mark.parametrize(("stem", "name"), [("pytorch-model", "MyNet"), ("own-simulation", "MySimulation")])
def test_a_model_of_a_notebook_keeps_the_contract(stem, name, tmp_path):
    notebook = nbformat.read(ROOT / "docs" / "notebooks" / f"{stem}.ipynb", as_version=4)
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    last = next(i for i, source in enumerate(code) if f"class {name}" in source)
    (tmp_path / "my_model.py").write_text("\n\n".join(code[: last + 1]))
    assert check_model(f"{tmp_path / 'my_model.py'}:{name}").of(BROKEN) == []
