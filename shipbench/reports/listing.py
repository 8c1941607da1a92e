"""Self-description of parts, read from their source without importing it (so that a list never loads torch or
casadi)."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..extras import not_installed
from ..registry import Registry


def describe_parts(registry: Registry) -> list[dict[str, Any]]:
    """Description of each registered part: name, one line on it, parameters with their defaults as written, origin, and
    the reason why it cannot be used here ("" where it can).

    Reasons are a missing optional package, or a plug-in (only these are imported) that fails to import.
    """
    parts = []
    for name in registry.names():
        path, entry = _place(registry, name)
        summary, parameters, needs = read_part(path, registry.attribute, entry) if path else ("", {}, ())
        unusable = not_installed(needs) if entry is None else _problem(registry, name)
        parts.append(
            {
                "name": name,
                "summary": summary,
                "parameters": parameters,
                "from": entry or "shipbench",
                "unusable": unusable,
            }
        )
    return parts


def _place(registry: Registry, name: str) -> tuple[Path | None, str | None]:
    """File of a part (None where it cannot be found), and the entry point of a plug-in."""
    if name in registry.built_in():
        return Path(__file__).resolve().parent.parent / registry.folder / f"{name}.py", None
    entry = registry.plugins()[name][0].value
    return _source(entry), entry


def explain_part(registry: Registry, name: str) -> tuple[list[str], dict[str, str]]:
    """Paragraphs of the docstrings of a part's module and class, without the first line; the text on each parameter."""
    path, entry = _place(registry, name)
    try:
        tree = ast.parse(path.read_text(encoding="utf-8")) if path else ast.parse("")
    except (OSError, SyntaxError, UnicodeDecodeError):
        return [], {}
    bound = (
        entry.partition(":")[2]
        if entry
        else next((_bound_name(n) for n in tree.body if _binds(n, registry.attribute)), "")
    )
    own = next((ast.get_docstring(n) or "" for n in tree.body if isinstance(n, ast.ClassDef) and n.name == bound), "")
    words, _, arguments = own.partition("Args:\n")
    meanings: dict[str, str] = {}
    for keys, text in re.findall(r"^    (\w[\w, ]*): (.*(?:\n {5,}.*)*)", arguments.split("\n\n")[0], re.MULTILINE):
        meanings |= {key: " ".join(text.split()) for key in keys.replace(" ", "").split(",")}
    paragraphs = [*(ast.get_docstring(tree) or "").split("\n\n")[1:], *words.split("\n\n")]
    return [" ".join(text.split()) for text in paragraphs if text.strip()], meanings


def _problem(registry: Registry, name: str) -> str:
    try:
        registry.get(name)
    except InputError as error:
        return str(error)
    return ""


def describe_effects() -> list[dict[str, Any]]:
    """Description of each effect: family, one line on it, source and parameters at 130 m."""
    from ..effects.base import EFFECTS

    parts = []
    for name in EFFECTS.names():
        effect = EFFECTS.get(name)
        parameters = [
            {"name": p.name, "unit": p.unit, "typical": p.typical, "low": p.low, "high": p.high}
            for p in effect.parameters
        ]
        parts.append({
            "name": name, "family": effect.family, "summary": effect.summary, "source": effect.source,
            "per_run": effect.per_run,
            "parameters": parameters,
        })  # fmt: skip
    return parts


def _source(entry: str) -> Path | None:
    """File of an entry point's module, or None where it cannot be found."""
    try:
        found = importlib.util.find_spec(entry.partition(":")[0])
    except Exception:  # finding a module imports the package around it, and a stranger's package may raise anything
        return None
    return Path(found.origin) if found and found.origin and found.origin.endswith(".py") else None


def read_part(path: Path, attribute: str, entry: str | None = None) -> tuple[str, dict[str, str], tuple[str, ...]]:
    """First paragraph of the module's docstring; the fields (name -> default as written) of the class bound to
    `attribute`; the packages it needs.

    `entry` ("module:Class") names the class of a plug-in instead.
    """
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, UnicodeDecodeError):
        return "(its source cannot be read)", {}, ()
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    summary = " ".join((ast.get_docstring(tree) or "").split("\n\n")[0].split())
    bound = entry.partition(":")[2] if entry else next((_bound_name(n) for n in tree.body if _binds(n, attribute)), "")
    return (
        (summary, _fields(classes[bound], classes), _needs(classes[bound])) if bound in classes else (summary, {}, ())
    )


def _needs(node: ast.ClassDef) -> tuple[str, ...]:
    """Literal value of the class variable `needs` of a predictor."""
    values = [
        n.value for n in node.body if isinstance(n, ast.AnnAssign) and n.value and ast.unparse(n.target) == "needs"
    ]
    return ast.literal_eval(values[0]) if values else ()


def _binds(node: ast.stmt, attribute: str) -> bool:
    return isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == attribute for t in node.targets)


def _bound_name(node: ast.stmt) -> str:
    return node.value.id if isinstance(node, ast.Assign) and isinstance(node.value, ast.Name) else ""


def _fields(node: ast.ClassDef, classes: dict[str, ast.ClassDef]) -> dict[str, str]:
    """Annotated fields of a dataclass and of its bases in the same file; class variables and private names are no
    parameters."""
    found: dict[str, str] = {}
    for base in node.bases:
        if isinstance(base, ast.Name) and base.id in classes:
            found |= _fields(classes[base.id], classes)
    for item in node.body:
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name) and not item.target.id.startswith("_"):
            default = _default(item.value)
            if "ClassVar" not in ast.unparse(item.annotation) and "init=False" not in default:
                found[item.target.id] = default
    return found


def _default(value: ast.expr | None) -> str:
    """Default of a field as written; `{}` for `field(default_factory=dict)`, "" where there is none."""
    text = ast.unparse(value) if value else ""
    return {"field(default_factory=dict)": "{}", "field(default_factory=list)": "[]"}.get(text, text)
