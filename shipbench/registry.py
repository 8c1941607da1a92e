"""Parts found by file name: `predictors/lstm.py` is the predictor "lstm"; listing imports nothing.

Outside packages add parts through the entry-point group of the registry (for example `shipbench.predictors`).
A plug-in that cannot be imported stays listed and raises its own error when it is asked for.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from .errors import InputError, unknown_name

_PACKAGE = __name__.rsplit(".", 1)[0]


@dataclass(frozen=True)
class Registry:
    """The parts of one kind.

    Args:
        kind: word used in messages ("predictor").
        folder: sub-package whose modules are the parts ("predictors").
        attribute: the name that each module defines ("PREDICTOR").
        helpers: modules of the folder that are not parts.
        group: entry-point group `shipbench.<group>` for outside packages; the folder's name unless given.
    """

    kind: str
    folder: str
    attribute: str
    helpers: frozenset[str] = frozenset()
    group: str = ""

    def _files(self) -> dict[str, str]:
        root = Path(__file__).parent / self.folder
        stems = (p.stem for p in sorted(root.glob("*.py")))
        return {s: f"{_PACKAGE}.{self.folder}.{s}" for s in stems if not s.startswith("_") and s not in self.helpers}

    def _entry_points(self) -> dict[str, Any]:
        return {e.name: e for e in entry_points(group=f"shipbench.{self.group or self.folder}")}

    def names(self) -> list[str]:
        """All registered names, sorted, without importing any part.

        Raises:
            InputError: a plug-in package claims a name that shipbench has already.
        """
        files, plugins = self._files(), self._entry_points()
        for name in files.keys() & plugins.keys():
            raise InputError(
                f"{self.kind} '{name}' is defined twice: in shipbench and in the plug-in {plugins[name].value}. Rename the plug-in's entry point."
            )
        return sorted(files.keys() | plugins.keys())

    def get(self, name: str) -> Any:
        """Import the one module behind `name` and return its part.

        Raises:
            InputError: the name is not registered.
        """
        names = self.names()
        if name not in names:
            raise unknown_name(self.kind, name, names)
        files = self._files()
        if name in files:
            return getattr(importlib.import_module(files[name]), self.attribute)
        return self._entry_points()[name].load()
