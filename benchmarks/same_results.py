"""Compares the results of two versions of the code: `python benchmarks/same_results.py OLD NEW`.

OLD and NEW are folders with the rows of `suite diagnosis` or `suite check` (one JSON file a row), folders of studies
(`summary.json`), or JSON files. Times, versions and paths are left out. Exit status 1 where anything else differs.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

IGNORED = frozenset(
    {
        "seconds",
        "signature",
        "warnings",
        "source",
        "git",
        "machine",
        "code",
        "command",
        "created",
        "fit_s",
        "predict_s",
        "memory_mb",
    }
)
"""Fields that say when, where and by which code a row was made, or how fast."""


def differences(old: Any, new: Any, place: str = "") -> list[str]:
    """Places at which two documents differ, with both values."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [*old, *(key for key in new if key not in old)]
        missing = object()
        return [
            d
            for key in keys
            if key not in IGNORED
            for d in differences(old.get(key, missing), new.get(key, missing), f"{place}/{key}")
        ]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [d for i, (a, b) in enumerate(zip(old, new, strict=True)) for d in differences(a, b, f"{place}/{i}")]
    return [] if old == new else [f"{place}: {_shown(old)} -> {_shown(new)}"]


def _shown(value: Any) -> str:
    return "missing" if type(value) is object else json.dumps(value)


def main(old: Path, new: Path) -> int:
    """Print every difference and a summary; 1 where there is one."""
    if old.is_file():
        pairs = {old.name: (old, new)}
    else:
        names = sorted({p.relative_to(folder).as_posix() for folder in (old, new) for p in folder.rglob("*.json")})
        pairs = {name: (old / name, new / name) for name in names}
    different = compared = 0
    for name, (one, other) in pairs.items():
        if not (one.is_file() and other.is_file()):
            print(f"{name}: only in {old if one.is_file() else new}")
            different += 1
            continue
        compared += 1
        found = differences(json.loads(one.read_text(encoding="utf-8")), json.loads(other.read_text(encoding="utf-8")))
        different += bool(found)
        print("\n".join(f"{name}{line}" for line in found), end="\n" if found else "")
    print(f"{compared} documents compared, {different} differ")
    return int(different > 0)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(
            f"two folders or files are needed, {len(sys.argv) - 1} given: python benchmarks/same_results.py OLD NEW"
        )
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
