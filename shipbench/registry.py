"""Parts found by file name: `predictors/lstm.py` is the predictor "lstm"; listing imports none of them.

Outside packages add parts through the entry-point group of the registry (for example `shipbench.predictors`). A plug-in
that cannot be used is reported in one line of the log and left out; asked for by its name, it raises an `InputError`
with the reason. A name that two parts claim is given to neither, since it is ambiguous.
"""

from __future__ import annotations

import hashlib
import importlib
import logging
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .errors import InputError, unknown_name
from .extras import needed_by
from .names import brief

_PACKAGE = __name__.rsplit(".", 1)[0]
_log = logging.getLogger(__name__)

_OFFERS = {
    "predictors": ("fit", "predict"),
    "effects": ("parameters", "force", "gear", "measure"),
    "datasets": ("make", "summary", "licence", "cached"),
    "metrics": ("function", "columns", "per_run"),
}
"""Attributes that the object behind an entry point of each group must have; without them other commands would fail
later."""

_problems: dict[tuple[str, str, str], str] = {}
"""Reasons why a plug-in (group, name, value) could not be used: a failed import is not tried again."""
_told: set[str] = set()


@cache
def scanned(group: str) -> tuple[EntryPoint, ...]:
    """Entry points of a group. Reading all installed packages takes about 0.1 s, so it is done once:
    `scanned.cache_clear()` where packages were installed meanwhile."""
    return tuple(entry_points(group=group))


def package_digest(name: str) -> str:
    """SHA-256 (first 12 digits) over the Python files of an importable package or module; "" where it is not
    installed."""
    found = find_spec(name)
    if found is None or found.origin is None:
        return ""
    origin = Path(found.origin)
    package = origin.parent
    files = sorted(package.rglob("*.py")) if found.submodule_search_locations else [origin]
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def _tell(problem: str) -> None:
    """Log one line, once in a process."""
    if problem not in _told:
        _told.add(problem)
        _log.warning("warning: %s", problem)


def _origin(point: EntryPoint) -> str:
    package = f" of package {point.dist.name} {point.dist.version}" if point.dist is not None else ""
    return f"{point.value}{package}"


def reason(error: BaseException) -> str:
    """Text of an exception in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]


@cache
def _stems(folder: str) -> tuple[str, ...]:
    """Names of the modules in a folder of the package, sorted."""
    return tuple(sorted(p.stem for p in (Path(__file__).parent / folder).glob("*.py")))


@dataclass(frozen=True)
class Registry:
    """Parts of one kind.

    Args:
        kind: word used in messages ("predictor").
        folder: sub-package whose modules are the parts ("predictors").
        attribute: the name that each module defines ("PREDICTOR").
        helpers: modules of the folder that are not parts.
        group: entry-point group `shipbench.<group>` for outside packages; the folder's name unless given.
        lazy: a plug-in is imported only when it is asked for by name. Else listing imports the plug-ins (never
            shipbench's own parts), so that commands over all parts have only those that work.
    """

    kind: str
    folder: str
    attribute: str
    helpers: frozenset[str] = frozenset()
    group: str = ""
    lazy: bool = False

    def __repr__(self) -> str:
        """Names, of plug-ins too; nothing is imported for it."""
        return brief(f"<Registry of {self.kind}s: {', '.join(sorted({*self._files(), *self.plugins()}))}>")

    def _files(self) -> dict[str, str]:
        stems = _stems(self.folder)
        return {s: f"{_PACKAGE}.{self.folder}.{s}" for s in stems if not s.startswith("_") and s not in self.helpers}

    def plugins(self) -> dict[str, list[EntryPoint]]:
        """Entry points by name; more than one where packages claim the same name."""
        found: dict[str, dict[str, EntryPoint]] = {}
        for point in scanned(f"shipbench.{self.group or self.folder}"):
            found.setdefault(point.name, {})[point.value] = point
        return {name: list(points.values()) for name, points in found.items()}

    def built_in(self) -> list[str]:
        """Names of shipbench's own parts, sorted."""
        return sorted(self._files())

    def names(self) -> list[str]:
        """Names of all usable parts, sorted; shipbench's own parts are not imported for it."""
        files, usable = self._files(), []
        for name, points in self.plugins().items():
            problem = self._clash(name, points) or ("" if self.lazy else self._load(points[0])[1])
            if problem:
                _tell(problem)
            elif name not in files:
                usable.append(name)
        return sorted([*files, *usable])

    def __contains__(self, name: str) -> bool:
        """Whether a part of that name is registered, usable or not."""
        return name in self._files() or name in self.plugins()

    def get(self, name: str) -> Any:
        """Import the one module behind `name` and return its part.

        Raises:
            InputError: the name is not registered, claimed twice, needs a package that is not installed, or its plug-in
                cannot be used.
        """
        files, plugins = self._files(), self.plugins()
        if name not in files and name not in plugins:
            raise unknown_name(self.kind, name, self.names())
        points = plugins.get(name, [])
        if clash := self._clash(name, points):
            raise InputError(clash)
        if name in files:
            with needed_by(f"'{name}'"):
                module = importlib.import_module(files[name])
            return getattr(module, self.attribute)
        part, problem = self._load(points[0])
        if problem:
            raise InputError(problem)
        return part

    def package(self, name: str) -> str:
        """Importable package (or module) that adds `name`; "" for a part of shipbench's own.

        Raises:
            InputError: the plug-in cannot be used.
        """
        if name in self._files() or name not in self.plugins():
            return ""
        self.get(name)
        parts = self.plugins()[name][0].module.split(".")
        above = (".".join(parts[:depth]) for depth in range(1, len(parts)))
        return next(
            (p for p in above if (found := find_spec(p)) and found.origin), ".".join(parts)
        )  # folders of several packages have no origin

    def digest(self, name: str) -> str:
        """Digest of a plug-in's version: its package's Python files, and the list of all installed files with their
        hashes.

        "" for a part of shipbench's own, whose version is that of shipbench.

        Raises:
            InputError: the plug-in cannot be used.
        """
        package = self.package(name)
        if not package:
            return ""
        dist = self.plugins()[name][0].dist
        listed = (dist.read_text("RECORD") if dist is not None else "") or ""
        return hashlib.sha256((package_digest(package) + listed).encode()).hexdigest()[:12]

    def _clash(self, name: str, points: list[EntryPoint]) -> str:
        """Message on a name that two parts claim, or ""."""
        claims = [
            *(["shipbench itself"] if name in self._files() else []),
            *(f"the plug-in {_origin(p)}" for p in points),
        ]
        if len(claims) < 2:
            return ""
        return (
            f"{self.kind} '{name}' is defined twice: in {' and in '.join(claims)}. Rename the plug-in's entry "
            "point, or uninstall its package."
        )

    def _load(self, point: EntryPoint) -> tuple[Any, str]:
        """Part behind an entry point, or None and the reason why it cannot be used."""
        key = (point.group, point.name, point.value)
        if key in _problems:
            return None, _problems[key]
        part, wrong = None, ""
        try:
            part = point.load()
        except (
            Exception,
            SystemExit,
        ) as error:  # a stranger's module may raise anything, and must not take the command down
            wrong = f"cannot be imported: {reason(error)}"
        else:
            missing = [a for a in _OFFERS.get(self.group or self.folder, ()) if not hasattr(part, a)]
            called = getattr(part, "name", None) or point.name
            if missing:
                wrong = f"is no {self.kind}: it has no {', '.join(missing)}"
            elif called != point.name:
                wrong = f"calls itself '{called}'; its entry point and its name must agree"
        if wrong:
            _problems[key] = f"{self.kind} '{point.name}', plug-in {_origin(point)}, {wrong}. Mend it or uninstall it."
            return None, _problems[key]
        return part, ""
