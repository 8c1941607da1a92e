"""Writes the tables of models, data sets, metrics, checks, trials, extras and the citation into their pages when the
site is built.

A comment such as `<!-- models -->` on a page is replaced. Every word comes from the registries, pyproject.toml or
CITATION.cff.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from commands_hook import one_line

ROOT = Path(__file__).parents[1]


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Called by mkdocs for every page."""
    return re.sub(
        r"<!-- (\w+) -->", lambda found: "\n".join(WRITERS[found[1]]()) if found[1] in WRITERS else found[0], markdown
    )


def _prose(words: str | None) -> str:
    """Words of the program as one line of Markdown in which `*`, `_` and `|` outside of code are themselves."""
    parts = re.split(r"(`[^`]*`)", " ".join((words or "").split()))
    return "".join(part if i % 2 else re.sub(r"([*_|<])", r"\\\1", part) for i, part in enumerate(parts))


def _first(words: str | None) -> str:
    return (words or "").split("\n\n")[0]


def _extras() -> Iterator[str]:
    import tomlkit

    from shipbench.extras import EXTRAS

    declared: Any = tomlkit.parse((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    packages: dict[str, list[str]] = {}
    for distribution, extra in EXTRAS.values():
        packages.setdefault(extra, []).append(distribution)
    yield "| extra | for | packages |\n|---|---|---|"
    for extra, names in packages.items():
        purpose = declared.item(extra).trivia.comment.lstrip("# ")
        yield f"| `{extra}` | {one_line(purpose)} | {', '.join(names)} |"


def _models() -> Iterator[str]:
    from shipbench.extras import EXTRAS
    from shipbench.predictors.registered import PREDICTORS
    from shipbench.reports.listing import explain_part, read_part

    for name in PREDICTORS.built_in():
        summary, parameters, needs = read_part(ROOT / "shipbench" / "predictors" / f"{name}.py", PREDICTORS.attribute)
        about, meanings = explain_part(PREDICTORS, name)
        yield f"## `{name}`\n\n{_prose(summary)}\n"
        if parameters:
            yield "| option | default | unit | meaning |\n|---|---|---|---|"
            for key, default in parameters.items():
                meaning = meanings.get(key, "")
                unit = re.search(r"\[([^\]]+)\]", meaning)
                yield (
                    f"| `{key}` | {f'`{default}`' if default else 'must be given'} | {unit[1] if unit else '-'} | "
                    f"{one_line(meaning)} |"
                )
            yield ""
        extras = sorted({EXTRAS[need][1] for need in needs})
        yield f"Needs: {' and '.join(f'the extra `{extra}`' for extra in extras) or 'nothing beyond the core'}.\n"
        yield from (f"{_prose(text)}\n" for text in about if text.startswith("Source: "))


def _datasets() -> Iterator[str]:
    from shipbench.data.base import DATASETS, load_dataset

    parts = [DATASETS.get(name) for name in DATASETS.built_in()]
    yield "| data set | what it is | ship | runs | licence |\n|---|---|---|---|---|"
    for part in parts:
        if part.public is None:
            made = load_dataset(part.name)
            ship, runs = made.ship, f"{len(made)} at {made.dt:g} s"
        else:
            ship, runs = inspect.getmodule(part.make).SHIP, f"{len(part.public.checksums)} files"  # type: ignore[union-attr]
        yield f"| `{part.name}` | {one_line(part.summary)} | {ship.name}, {ship.L:g} m | {runs} | {part.licence} |"
    for public in (part.public for part in parts if part.public is not None):
        yield f"\n## `{public.name}`\n"
        yield f"{_prose(public.terms)}\n\nLicence: {public.licence}.\n\nPlease cite:\n"
        yield from (f"- {_prose(paper)}" for paper in public.citation)


def _metrics() -> Iterator[str]:
    from shipbench.metrics.base import METRICS

    for name in METRICS.built_in():
        metric = METRICS.get(name)
        yield f"## `{name}`\n\n{_prose(_first(inspect.getdoc(inspect.getmodule(metric.function))))}\n"
        yield "| column | label | unit | value of a run | formula |\n|---|---|---|---|---|"
        formula = one_line(
            re.sub(r",? \(batch[^)]*\)", "", _first(inspect.getdoc(metric.function)))
        )  # shapes are for programmers
        per_run = "mean over time steps" if metric.per_knot else "one value"
        for number, column in enumerate(metric.columns):
            yield (
                f"| `{column.name}` | {column.label} | {column.unit} | {per_run} | "
                f"{'the same' if number else formula} |"
            )
        yield ""


def _checks() -> Iterator[str]:
    from shipbench.checking import base
    from shipbench.suites.checks.faults import FAULTS

    gross = [inspect.getmodule(part) for name, part in vars(base).items() if name.startswith("mend_")]
    checks = [importlib.import_module(f"shipbench.checking.{name}") for name in base.CHECKS.built_in()]
    yield "| check | what it looks for |\n|---|---|"
    for module in [inspect.getmodule(base.read_recording), *gross, *checks]:
        yield f"| `{module.__name__.rsplit('.', 1)[-1]}` | {one_line(_first(inspect.getdoc(module)))} |"  # type: ignore[union-attr]
    kinds: dict[str, list[str]] = {}
    for fault in FAULTS:
        for kind in dict.fromkeys(kind for kind, _ in fault.kinds):
            kinds.setdefault(kind, []).append(f"{fault.name} ({fault.size})" if fault.size else fault.name)
    yield "\n## Findings\n\n| finding | planted faults that cause it |\n|---|---|"
    yield from (f"| {one_line(kind)} | {one_line('; '.join(kinds[kind]))} |" for kind in sorted(kinds, key=str.lower))


def _trials() -> Iterator[str]:
    from shipbench.effects.base import EFFECTS, FAMILIES

    effects = [EFFECTS.get(name) for name in EFFECTS.built_in()]
    for family in FAMILIES:
        yield f"### {family.capitalize()}\n\n| cause | trial that separates it | must be measured |\n|---|---|---|"
        for effect in (e for e in effects if e.family == family):
            measured = ", ".join(f"`{channel}`" for channel in effect.channels) or "-"
            yield f"| [`{effect.name}`](effects.md#{effect.name}) | {one_line(effect.separate)} | {measured} |"
        yield ""


def _citation() -> Iterator[str]:
    import yaml

    about = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    yield f"{_prose(about['message'])}\n"
    for kind, key, entry in [
        ("software", about["title"], about),
        *((r["type"], f"source{i}", r) for i, r in enumerate(about["references"], 1)),
    ]:
        fields = {"title": entry["title"], "author": " and ".join(f"{{{a['name']}}}" for a in entry["authors"])}
        fields |= {name: entry[name] for name in ("version", "license", "year", "doi") if name in entry}
        lines = ",\n".join(f"  {name} = {{{value}}}" for name, value in fields.items())
        yield (
            f"{_prose(entry.get('abstract', entry.get('notes', '')))}\n\n```bibtex\n@{kind}{{{key},\n{lines}\n}}\n```\n"
        )


WRITERS: dict[str, Callable[[], Iterator[str]]] = {
    "extras": _extras, "models": _models, "datasets": _datasets, "metrics": _metrics, "checks": _checks,
    "trials": _trials, "citation": _citation,
}  # fmt: skip
"""What each comment stands for."""
