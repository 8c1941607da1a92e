"""Additions to the scores on a page: fitted equations of the models, diagnoses of the same data."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, ValidationError

from ...bench.results import Cell
from ...bench.submissions import Results
from ...errors import InputError
from ...names import file_name, shown
from ...regular_files import read_bytes, read_json

_PARAMETER = re.compile(r"^\s+(\w+)\s+=\s+([-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?)\s+(\S.*)$", re.IGNORECASE)
_LONGEST = 20_000
"""Most characters of one model's own description on the page."""


@dataclass(frozen=True)
class Fits:
    """Fitted models of one spec: their descriptions by fold and seed, and the numbers in them (name, median, least,
    greatest, meaning)."""

    model: str
    texts: list[tuple[str, str]]
    numbers: list[tuple[str, float, float, float, str]]


def fitted(results: Results, dataset: str, models: Sequence[str]) -> list[Fits]:
    """Descriptions that the models of `dataset` give of themselves (`equations.txt` beside their predictions); models
    without one are left out."""
    found: dict[str, list[tuple[str, str]]] = {}
    for summary, source in zip(results.summaries, results.sources, strict=True):
        if summary["dataset"] != dataset:
            continue
        path = source / Cell(dataset, summary["model"], summary["fold"], summary["seed"]).folder / "equations.txt"
        try:
            text = read_bytes(path).decode("utf-8", errors="replace")
        except InputError:
            continue  # most models have no equations
        cut = (
            text
            if len(text) <= _LONGEST
            else f"{text[:_LONGEST]}\n... cut here; the whole text is in {path.name} of the result folder"
        )
        found.setdefault(summary["model"], []).append((f"fold {summary['fold']}, seed {summary['seed']}", cut))
    return [
        Fits(model, found[model], _numbers([text for _, text in found[model]])) for model in models if model in found
    ]


def _numbers(texts: Sequence[str]) -> list[tuple[str, float, float, float, str]]:
    """Lines `name = number what`, compared over the texts; a name that stands in several lines is distinguished by its
    place."""
    values: dict[tuple[str, int], list[float]] = {}
    what: dict[tuple[str, int], str] = {}
    for text in texts:
        seen: dict[str, int] = {}
        for line in text.splitlines():
            if (match := _PARAMETER.match(line)) is not None:
                name = match[1]
                seen[name] = seen.get(name, 0) + 1
                values.setdefault((name, seen[name]), []).append(float(match[2]))
                what.setdefault((name, seen[name]), " ".join(match[3].split()))
    return [(name, sorted(v)[len(v) // 2], min(v), max(v), what[name, place]) for (name, place), v in values.items()]


@dataclass(frozen=True)
class Diagnosed:
    """Diagnosis: its verdict in words, the causes (effect, sizes, gain), the model it proposes, the link to its page
    ("" if there is none)."""

    dataset: str
    verdict: str
    causes: list[tuple[str, str, str]]
    extended_model: str
    link: str
    warning: str


def diagnoses(results: Results, dataset: str, given: Sequence[Path], page: Path) -> list[Diagnosed]:
    """Diagnoses of `dataset`: in the folders `given`, and in the usual places beside the result folders; links are
    relative to `page`.

    Raises:
        InputError: a given folder holds no diagnosis.
    """
    fingerprint = next(s["fingerprint"] for s in results.summaries if s["dataset"] == dataset)
    found = {}
    for folder in dict.fromkeys(results.sources):
        up = folder.resolve().parent
        for near in (
            folder,
            folder / "diagnosis",
            *(root / "diagnoses" / file_name(Path(dataset).name) for root in (up, up.parent)),
        ):
            if (near / "diagnosis.json").exists():
                try:
                    found[near.resolve()] = _told(near, _read(near), fingerprint, page)
                except InputError as error:  # it was not asked for: said on the page, and no reason to write none
                    found[near.resolve()] = Diagnosed(
                        dataset, "A diagnosis lies beside the results.", [], "", "", str(error)
                    )
    for folder in given:
        found[folder.resolve()] = _told(folder, _read(folder), fingerprint, page)
    return [d for d in found.values() if d.dataset == dataset]


def check_given(given: Sequence[Path], datasets: Sequence[str]) -> None:
    """Refuse a diagnosis of a data set that the page does not show.

    Raises:
        InputError: the page shows no such data set, or the folder holds no diagnosis.
    """
    for folder in given:
        if (name := _read(folder).dataset) not in datasets:
            raise InputError(
                f"--diagnosis {folder} is of data set '{shown(name)[:80]}'; these results are of "
                f"{', '.join(datasets)}. Leave it out."
            )


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, extra="ignore", frozen=True)


class _Size(_Part):
    value: float | None = None
    unit: str = ""
    ci95: list[float | None] | None = None


class _Gain(_Part):
    metric: str = "error"
    relative: float | None = None


class _Cause(_Part):
    effect: str = ""
    parameters: dict[str, _Size] | None = None
    gain: _Gain | None = None


class _Document(_Part):
    """Keys of diagnosis.json that the page uses."""

    dataset: str
    verdict: str
    causes: list[_Cause]
    extended_model: str | None
    fingerprint: str


def _read(folder: Path) -> _Document:
    path, give = folder / "diagnosis.json", "Give a folder that `shipbench diagnose --out` wrote."
    try:
        return _Document.model_validate(read_json(path))
    except InputError as error:
        raise InputError(f"{folder} holds no diagnosis that can be read: {error}") from None
    except ValidationError as error:
        if missing := [".".join(map(str, e["loc"])) for e in error.errors() if e["type"] == "missing"]:
            raise InputError(f"{path} lacks {', '.join(missing)}. {give}") from None
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or "the document"
        accepted = first["msg"].removeprefix("Input should be ")
        raise InputError(f"{path}: {key} = {shown(repr(first['input']))[:60]}; accepted: {accepted}. {give}") from None


_VERDICTS = {"found": "Causes are named.", "none": "No cause is named: nothing is missing that these runs could show.",
             "unknown": "The model lacks something that is not in the library."}  # fmt: skip


def _told(place: Path, document: _Document, fingerprint: str, page: Path) -> Diagnosed:
    pages = [name for name in ("report.html", "diagnosis.html") if (place / name).is_file()]
    link = quote(Path(os.path.relpath(place / pages[0], page.resolve().parent)).as_posix()) if pages else ""
    same = document.fingerprint == fingerprint
    warning = (
        ""
        if same
        else f"It is of other data than these scores (fingerprint {document.fingerprint}, here {fingerprint})."
    )
    causes = [(c.effect, _sizes(c.parameters or {}), _gain(c.gain)) for c in document.causes]
    verdict = _VERDICTS.get(document.verdict, document.verdict)
    return Diagnosed(
        document.dataset, verdict, causes, document.extended_model or "", f"./{link}" if link else "", warning
    )


def _sizes(parameters: dict[str, _Size]) -> str:
    return "; ".join(
        f"{name} {_figure(p.value)} {p.unit} {_interval(p.ci95)}".strip() for name, p in parameters.items()
    )


def _interval(ends: list[float | None] | None) -> str:
    return f"[{_figure(ends[0])}, {_figure(ends[1])}]" if ends is not None and len(ends) == 2 else ""


def _gain(gain: _Gain | None) -> str:
    return (
        "not measured"
        if gain is None or gain.relative is None
        else f"{gain.metric} {-100 * gain.relative:+.0f} % on held-out runs"
    )


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
