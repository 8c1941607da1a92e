"""Common base of all HTML pages: one style, one header, one way of escaping, one content security policy, plots without
a network.

A page is a jinja2 template of its own that begins with `{% extends "base.html.j2" %}` and fills the blocks `nav` and
`content`; `render_page` renders it. `macros.html.j2` holds the tables that are sorted with a click. `render/linked.py`
describes the plots.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

_HERE = Path(__file__).resolve().parent
_TEMPLATES = _HERE / "templates"
_PLOTLY = "vendor/plotly-basic.min.js"
"""Plotly's basic bundle as published on npm (`plotly.js-basic-dist-min`); its first lines hold the version, its licence
lies beside it."""


@dataclass(frozen=True)
class Tile:
    """Figure at the top of a page: `value` with its unit under `label`, and a short `note`."""

    label: str
    value: str
    note: str = ""


def render_page(
    template: str,
    *,
    title: str,
    dataset: str,
    command: str,
    lead: str = "",
    tiles: Sequence[Tile] = (),
    plots: bool = False,
    images: bool = False,
    style: str = "",
    folder: Path = _TEMPLATES,
    **context: Any,
) -> str:
    """The HTML of a page. Every value in `context` is escaped by the template.

    Args:
        template: name of a file of `render/templates`.
        title: heading of the page.
        dataset: name of the data set or data sets.
        command: the command that made the page.
        lead: the result in one or two sentences, above the tiles.
        tiles: figures at the top.
        plots: whether the page holds linked plots (see `render/linked.py`); adds Plotly, 1.2 MB.
        images: whether it holds pictures as `data:`.
        style: rules of this page alone, behind those of the common style sheet.
        folder: where the template lies.
        context: what else the template uses; `shipbench` (version) is set.
    """  # fmt: skip
    from importlib.metadata import version

    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader([folder, _TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(ticks=_ticks, short=short_name, embedded=embedded, parts=_parts)
    styles = _read("page.css") + style
    scripts = [
        *([_read(_PLOTLY)] if plots else []),
        _read("tables.js"),
        _read("copy.js"),
        *([_read("linked.js")] if plots else []),
    ]
    return environment.get_template(template).render(
        title=title, dataset=dataset, command=command, lead=lead, tiles=tiles, style=styles, scripts=scripts,
        plots=plots,
        policy=content_policy(styles, scripts, images=images, plots=plots),
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        shipbench=version("shipbench"), plotly=plotly_version() if plots else "", **context,
    )  # fmt: skip


def plotly_version() -> str:
    """Version of the Plotly file in the package, from its first lines."""
    found = re.search(r"plotly\.js \(basic - minified\) v([\d.]+)", _read(_PLOTLY)[:300])
    assert found is not None
    return found[1]


def embedded(data: Any) -> Any:
    """JSON for a `<script type="application/json">`, without `</script>`, `<!--`, or numbers that JSON does not
    have."""
    from markupsafe import Markup

    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029"))


def short_name(model: str) -> str:
    """Last part of a model name that contains a file path: `folder/m.py:Mine` is `m.py:Mine`."""
    return Path(model).name if "/" in model else model


def _parts(name: Any) -> Any:
    """Escaped text that may break at the signs that join the parts of a model's name."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"(?<=[+,])(?=\S)|(?<=\S)(?=\[)", "<wbr>", str(escape(name))))


def _ticks(text: Any) -> Any:
    """Escaped text with `words in backticks` as code."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def _read(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def content_policy(
    style: str,
    script: str | Sequence[str] = "",
    *,
    images: bool = False,
    style_attributes: bool = False,
    plots: bool = False,
) -> str:
    """The content security policy of a page: it fetches nothing and runs nothing but this style and script.

    Args:
        style: the content of the page's style element, known by its digest.
        script: the contents of its script elements, likewise; "" for a page without.
        images: whether it holds pictures (`data:`).
        style_attributes: whether its drawings have attributes `style`, which cannot fetch anything.
        plots: whether it draws with Plotly, which adds an empty style element, fills it by script and sets attributes
            `style`.
    """
    rules = ["default-src 'none'", "base-uri 'none'", "form-action 'none'"]
    if style_attributes or plots:
        rules += [f"style-src-elem {_digests([style, ''] if plots else [style])}", "style-src-attr 'unsafe-inline'"]
    else:
        rules.append(f"style-src {_digests([style])}")
    scripts = [script] if isinstance(script, str) else script
    rules += [f"script-src {_digests(scripts)}"] if any(scripts) else []
    rules += ["img-src data:"] if images else []
    return "; ".join(rules)


def _digests(contents: Sequence[str]) -> str:
    """Digests of the contents, by which a browser knows what it may use."""
    return " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}'" for content in contents
    )
