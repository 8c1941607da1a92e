"""The house: imports go one way, files and functions stay short, nothing heavy is imported for `--help`."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent / "shipbench"
FILES = sorted(ROOT.rglob("*.py"))

LAYERS = {
    "cache": 0, "kept_code": 0.5, "errors": 0, "ops": 0, "signals": 0, "matlab_files": 0, "steps": 0, "storage": 0, "regular_files": 0.3,
    "names": 0.5, "extras": 0.5, "toml_files": 0.6,
    "registry": 1, "specs": 1, "compiled": 1, "integrate": 1, "ship": 1,
    "arrays": 1, "frames": 1, "render": 1, "notebook": 1, "processes": 1,
    "records": 2, "physics": 2, "metrics": 2.5, "effects": 2.7, "simulate": 3, "predictors": 3.5, "data": 4, "importing": 4.3,
    "checking": 4.5, "diagnosis": 4.7, "contract": 4.8, "bench": 5, "leaderboard": 5.1, "reports": 5.2, "suites": 5.2,
    "scores": 5.3, "api": 5.4, "adapters": 5.5, "cli": 6, "__init__": 7, "__main__": 7,
}  # fmt: skip


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


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_and_functions_stay_readable(path: Path):
    text = path.read_text()
    assert len(text.splitlines()) <= 350
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            assert (node.end_lineno or 0) - node.lineno <= 70, f"{node.name} is too long"


@pytest.mark.parametrize("command", ["--help", "models", "effects", "data list"])
def test_listing_and_help_import_no_heavy_library(command: str):
    code = (
        "import sys; from shipbench.cli.app import app\n"
        f"try: app({command.split()!r})\n"
        "except SystemExit as end: assert not end.code\n"
        "heavy = {'torch', 'casadi', 'matplotlib', 'lightning', 'pandas', 'scipy'} & set(sys.modules); sys.exit(', '.join(sorted(heavy)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


NETWORKS = {f"predictors/{name}.py" for name in ("mlp", "lstm", "neural_ode", "networks/training", "networks/stacked", "networks/residual")}
"""The modules that need the extra `networks`."""


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_only_networks_import_torch(path: Path):
    if str(path.relative_to(ROOT)) in NETWORKS:
        return
    for node in ast.parse(path.read_text()).body:
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        assert not {name.split(".")[0] for name in names} & {"torch", "lightning", "torchdiffeq"}


def test_no_two_test_files_share_a_name():
    """pytest would refuse the second of them, and its tests would not run."""
    names = [path.name for path in Path(__file__).parent.rglob("test_*.py")]
    assert len(names) == len(set(names))
