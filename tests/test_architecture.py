"""The house: imports go one way, files and functions stay short, nothing heavy is imported for `--help`."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent / "shipbench"
FILES = sorted(ROOT.rglob("*.py"))

HOUSE: dict[float, dict[str, str]] = {
    0: {
        "errors": "messages for users", "signals": "names, units, signs",
        "ops": ("one formula for numpy, torch and "
                "CasADi"), "steps": "progress",
        "storage": "every file and folder comes into its place in one step", "cache": "folders of the user's cache",
        "matlab_files": "MATLAB files",
    },
    0.3: {"regular_files": "opening files of strangers, with bounds"},
    0.5: {
        "names": "names from outside", "thresholds": "numbers that decide, with their evidence",
         "extras": "optional packages", "kept_code": "what of a cache is trusted",
        "units": "units and signs of files",
    },
    0.6: {"toml_files": "reading TOML"},
    1: {
        "registry": "parts by name, plug-ins", "specs": "`mlp[hidden=64]`", "integrate": "Runge-Kutta",
        "compiled": "formulas as machine code",
        "ship": "the ship file", "arrays": "checks of arrays", "frames": "tables in memory",
        "notebook": "reprs in notebooks", "run_meta": "what is known of a run beside its samples",
        "processes": "pools of processes", "render": "tables, terminal, SVG, HTML pages: one style sheet, one escaping",
    },
    2: {"records": "Run, Dataset, Batch", "physics": "pure formulas"},
    2.5: {"metrics": "one error measure a file"},
    2.7: {"effects": "one cause a file, with the traits by which it is judged"},
    3: {"simulate": "the MMG simulator and ships of the literature"},
    3.2: {"estimation": "the ship's coefficients with priors: forward model, linearisation, evidence, calibration"},
    3.5: {"predictors": "one model a file; `physics_model/`, `networks/` and `fmu_model/` hold what they share"},
    3.7: {"exporting": "fitted physics for other programs, one format a file"},
    4: {"data": "data sets, files, corrections"},
    4.3: {"importing": "logs into data sets"},
    4.5: {"checking": "one fault of measured data a file"},
    4.6: {"replay": "trajectories predicted elsewhere: reading, matching to runs, frames"},
    4.7: {"diagnosis": "what the physics lacks: preparation, selection, actuators, evaluation"},
    4.8: {"contract": "rules of a predictor"},
    5: {"bench": "running a study: task, folds, work, executors, scoring, results"},
    5.1: {"leaderboard": "ranking saved results: scores, comparisons, tables, plots, formats"},
    5.2: {"reports": "pages of studies, data sets and diagnoses",
        "suites": ("hidden causes and planted faults, and "
                   "how often they are found")},
    5.3: {"scores": "results in memory"},
    5.4: {"api": "functions of `import shipbench`"},
    5.5: {"adapters": "data and models for code written for other packages"},
    6: {"cli": "commands"},
    7: {"__init__": "public names", "__main__": "`python -m shipbench`"},
}  # fmt: skip
"""Layer -> its parts, with what each is for. A module imports only from lower layers, or from its own part."""
LAYERS = {part: layer for layer, parts in HOUSE.items() for part in parts}


def layer_table() -> str:
    """The table of CONTRIBUTING.md; `python tests/test_architecture.py` prints it."""
    rows = [
        f"| {layer:g} | " + "; ".join(f"`{part}`: {what}" for part, what in parts.items()) + " |"
        for layer, parts in HOUSE.items()
    ]
    return "\n".join(["| layer | parts |", "|---:|---|", *rows])


def _part(path: Path) -> str:
    relative = path.relative_to(ROOT)
    return relative.parts[0] if len(relative.parts) > 1 else relative.stem


def _imports(path: Path) -> set[str]:
    """First-level parts of shipbench that a module imports, also inside functions."""
    here = ["shipbench", *path.relative_to(ROOT).with_suffix("").parts]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            base = here[: -node.level] if node.level else []
            module = [*base, *(node.module or "").split(".")] if node.level else (node.module or "").split(".")
            module = [m for m in module if m]
            if module[:1] == ["shipbench"]:
                found |= {module[1]} if len(module) > 1 else {alias.name for alias in node.names}
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_module_imports_only_from_lower_layers(path: Path):
    part = _part(path)
    for other in _imports(path) - {part}:
        assert LAYERS[other] < LAYERS[part], f"{path.relative_to(ROOT)} ({part}) imports {other}, which stands no lower"


def _modules(path: Path, known: dict[str, Path]) -> set[str]:
    """Modules of shipbench that a module imports, also inside functions, by their dotted names."""
    here, found = ["shipbench", *path.relative_to(ROOT).with_suffix("").parts], set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            base = ".".join(
                [*(here[: -node.level] if node.level else []), *(node.module.split(".") if node.module else [])]
            )
            found |= {name for name in (base, *(f"{base}.{alias.name}" for alias in node.names)) if name in known}
    return found - {".".join(here)}


def test_no_two_files_import_each_other():
    known = {
        ".".join(["shipbench", *p.relative_to(ROOT).with_suffix("").parts]): p for p in FILES if p.name != "__init__.py"
    }
    order = TopologicalSorter({name: _modules(path, known) for name, path in known.items()})
    try:
        order.prepare()
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' -> '.join(error.args[1])}")


def test_the_table_of_layers_stands_in_contributing():
    text = (ROOT.parent / "CONTRIBUTING.md").read_text("utf-8")
    assert layer_table() in text, "print it with: python tests/test_architecture.py"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_and_functions_stay_readable(path: Path):
    text = path.read_text()
    assert len(text.splitlines()) <= 400
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            assert (node.end_lineno or 0) - node.lineno <= 100, f"{node.name} is too long"


@pytest.mark.parametrize("command", ["--help", "models", "effects", "data list"])
def test_listing_and_help_import_no_heavy_library(command: str):
    code = (
        "import sys; from shipbench.cli.app import app\n"
        f"try: app({command.split()!r})\n"
        "except SystemExit as end: assert not end.code\n"
        "heavy = {'torch', 'casadi', 'matplotlib', 'lightning', 'pandas', 'scipy'} & set(sys.modules); sys.exit(', "
        "'.join(sorted(heavy)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


NETWORKS = {
    f"predictors/{name}.py"
    for name in ("mlp", "lstm", "neural_ode", "networks/training", "networks/stacked", "networks/residual")
}
"""The modules that need the extra `networks`."""


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_only_networks_import_torch(path: Path):
    if str(path.relative_to(ROOT)) in NETWORKS:
        return
    for node in ast.parse(path.read_text()).body:
        names = (
            [a.name for a in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
        assert not {name.split(".")[0] for name in names} & {"torch", "lightning", "torchdiffeq"}


def test_no_two_test_files_share_a_name():
    """pytest would refuse the second of them, and its tests would not run."""
    names = [path.name for path in Path(__file__).parent.rglob("test_*.py")]
    assert len(names) == len(set(names))


if __name__ == "__main__":
    print(layer_table())
