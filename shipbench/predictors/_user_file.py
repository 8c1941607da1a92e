"""A user's model file: import with its folder on the import path, and the list of files of code that belong to it."""

from __future__ import annotations

import ast
import importlib.util
import os
import site
import sys
import sysconfig
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from itertools import islice
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from ..errors import InputError, unknown_name
from ..extras import needed_by
from ..regular_files import read_text

_listens: list[bool] = []
_MOST_FILES = 200
"""Python files of the working folder that are searched for a class."""
_brought: set[str] = set()
"""Modules of users that earlier model files imported: the next file imports its own, changed or of another folder."""


def class_from_file(path: Path, class_name: str) -> Any:
    """Class or function `class_name` of the Python file `path`.

    Raises:
        InputError: there is no such file or class, or it needs an extra of shipbench that is not installed.
    """
    if not path.is_file():
        raise InputError(f"model file {path} does not exist; give path/to/model.py:ClassName.")
    name = f"shipbench_user_{path.stem}"
    found = importlib.util.spec_from_file_location(name, path)
    if found is None or found.loader is None:
        raise InputError(f"model file {path} cannot be imported; it must be a Python file.")
    for old in _brought:
        sys.modules.pop(old, None)
    _brought.clear()
    before = set(sys.modules)
    module = importlib.util.module_from_spec(found)
    sys.modules[name] = module
    with on_import_path(path), needed_by(f"model file {path}"):
        try:
            found.loader.exec_module(module)
        finally:
            _brought.update(n for n in set(sys.modules) - before - {name} if _own_file(sys.modules[n]))
    if not hasattr(module, class_name):
        raise unknown_name(
            f"class or function in {path}",
            class_name,
            [
                k
                for k, v in vars(module).items()
                if isinstance(v, type | FunctionType) and v.__module__ == name and not k.startswith("_")
            ],
        )
    return getattr(module, class_name)


def models_in(path: Path) -> list[str]:
    """Classes of a Python file that have `fit` and `predict`, or `simulate`, and functions of (s0, U, dt); or else all
    its classes. It is read, not imported; none where it is not Python."""
    try:
        body = ast.parse(read_text(path, "Python file")).body
    except (InputError, SyntaxError, ValueError):
        return []
    found = []
    for node in body:
        if isinstance(node, ast.FunctionDef) and [a.arg for a in node.args.args[:3]] == ["s0", "U", "dt"]:
            found.append(node.name)
        if isinstance(node, ast.ClassDef):
            methods = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
            found += [node.name] * ({"fit", "predict"} <= methods or "simulate" in methods)
    return found or [node.name for node in body if isinstance(node, ast.ClassDef)]


def spec_in_file(name: str) -> str:
    """Spec suggested for the name of a file without its class or function, or of one of these without its file; ""
    where there is no such file here."""
    if name.endswith(".py"):
        return " or ".join(f"{name}:{model}" for model in models_in(Path(name)))
    files = islice(Path().glob("*.py"), _MOST_FILES) if name.isidentifier() else ()
    return " or ".join(f"{file}:{name}" for file in sorted(files) if name in models_in(file))


@contextmanager
def on_import_path(file: Path) -> Iterator[None]:
    """Make modules beside the model file importable, as where Python runs the file itself."""
    folder = str(file.resolve().parent)
    sys.path.insert(0, folder)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        if folder in sys.path:  # the model may have changed it
            sys.path.remove(folder)


_watched: list[set[str]] = []
"""Sets that collect the paths of files that are opened for reading, while `files_read` is active."""


def _watch(event: str, args: tuple[Any, ...]) -> None:
    if (
        event == "open"
        and _watched
        and isinstance(args[0], str | bytes | os.PathLike)
        and not set(str(args[1] or "r")) & set("wax+")
    ):
        for paths in list(_watched):
            paths.add(os.path.abspath(os.fsdecode(args[0])))


@contextmanager
def files_read(*below: Path) -> Iterator[dict[str, Path]]:
    """Files that are opened in Python while the context lasts, by name relative to the first folder of `below` that
    holds them, filled at its end.

    Code is left out (`code_of`), and so are files written meanwhile. Files that a library opens in its own machine code
    are not detected.
    """
    if not _listens:
        sys.addaudithook(_watch)  # there is no way to take it away again
        _listens.append(True)
    found, paths, began = dict[str, Path](), set[str](), time.time_ns()
    _watched.append(paths)
    try:
        yield found
    finally:
        _watched.remove(paths)
        for file in map(Path, sorted(paths)):
            root = next((root for root in below if file.is_relative_to(root)), None)
            if (
                root is not None
                and file.suffix not in (".py", ".pyc")
                and file.is_file()
                and file.stat().st_mtime_ns < began
                and _outside(file)
            ):
                found[file.relative_to(root).as_posix()] = file


def code_of(path: Path) -> dict[str, bytes]:
    """Content of the model file and of all user code that it imports, by name relative to its import folder.

    Call it after `class_from_file`, in a process that imported no other user's code. A package counts with all its
    Python files. Modules that functions import by name later are found in the source.
    """
    files = {path.name: path}
    for name, module in list(sys.modules.items()):
        if (file := _own_file(module)) is not None and not name.startswith("shipbench_user_"):
            files |= _whole(file, name.split("."))
    roots = [path.resolve().parent, *(Path(p) for p in sys.path if p and _outside(Path(p)))]
    waiting = [path, *files.values()]
    while waiting:
        for name in _imported_in(waiting.pop()):
            if (file := _beside(name, roots)) is not None:
                more = {key: found for key, found in _whole(file, [name]).items() if key not in files}
                files |= more
                waiting += more.values()
    return {name: file.read_bytes() for name, file in sorted(files.items())}


def _whole(file: Path, name: list[str]) -> dict[str, Path]:
    """Files of the top-level module or package behind the module `name` at `file`, by name relative to its root."""
    depth = len(name) - (file.stem != "__init__")
    if depth == 0 or file.parts[-depth - 1 : -1] != tuple(
        name[:depth]
    ):  # a module of one file, or one that is not where its name says
        return {file.name: file}
    top = file.parents[depth - 1]
    return {p.relative_to(top.parent).as_posix(): p for p in [*top.rglob("*.py"), file]}


def _beside(name: str, roots: list[Path]) -> Path | None:
    """User's file that `import name` finds below `roots`, or None."""
    for root in roots:
        for file in (root / name / "__init__.py", root / f"{name}.py"):
            if file.is_file() and _outside(file):
                return file
    return None


def _imported_in(file: Path) -> set[str]:
    """First parts of the names that a Python file imports, also inside functions; none where it is not Python."""
    try:
        nodes = list(ast.walk(ast.parse(file.read_bytes())))
    except (SyntaxError, ValueError):
        return set()
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [str(node.module) for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    return {name.partition(".")[0] for name in names}


def _own_file(module: ModuleType) -> Path | None:
    """File of a module that is neither Python's, nor an installed package's, nor shipbench's own; else None."""
    file = getattr(module, "__file__", None)
    return Path(file) if isinstance(file, str) and Path(file).is_file() and _outside(Path(file)) else None


def _outside(path: Path) -> bool:
    """Whether a path lies outside the environment: Python's library, installed packages, shipbench."""
    return not any(
        path.absolute().is_relative_to(root) or path.resolve().is_relative_to(root) for root in _environment()
    )


@cache
def _environment() -> tuple[Path, ...]:
    paths = sysconfig.get_paths()
    roots = {paths[key] for key in ("stdlib", "platstdlib", "purelib", "platlib")}
    roots |= {*site.getsitepackages(), site.getusersitepackages(), str(Path(__file__).parent.parent)}
    return tuple(p for root in roots for p in {Path(root).absolute(), Path(root).resolve()})
