"""Runs the notebooks of docs/notebooks when the site is built and shows them with their outputs; an executed notebook
is kept in the cache."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.structure.files import File, Files

from shipbench.cache import make_private
from shipbench.registry import package_digest

_TIMEOUT_S = 600


class NotebookFile(File):
    """A notebook that becomes a page."""

    def is_documentation_page(self) -> bool:
        return True


def on_files(files: Files, config: Any) -> Files:
    """Called by mkdocs with all files: notebooks become pages."""
    for file in [f for f in files if f.src_uri.endswith(".ipynb")]:
        files.remove(file)
        files.append(NotebookFile(file.src_uri, file.src_dir, file.dest_dir, file.use_directory_urls))
    return files


def on_page_read_source(page: Any, config: Any) -> str | None:
    """Called by mkdocs for the text of a page: that of a notebook is made from its cells and outputs."""
    if not isinstance(page.file, NotebookFile):
        return None
    path = Path(page.file.abs_src_path)
    title, text = to_markdown(executed(path)).split("\n\n", 1)
    return f'{title}\n\n<a href="{path.name}" download>Download this notebook</a>\n\n{text}'


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Called by mkdocs for a finished page: the notebook itself lies beside it, to download."""
    if isinstance(page.file, NotebookFile):
        beside = Path(page.file.abs_dest_path).parent / Path(page.file.src_uri).name
        beside.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(page.file.abs_src_path, beside)
    return output


def executed(path: Path, again: bool = False) -> Any:
    """The notebook with its outputs, run in an empty folder; one that the cache has is not run, unless `again`.

    The cache knows it by its text and by the source of shipbench.

    Raises:
        nbclient.exceptions.CellExecutionError: a cell fails.
    """
    text = path.read_bytes()
    digest = hashlib.sha256(text + package_digest("shipbench").encode()).hexdigest()[:16]
    kept = make_private("notebooks") / f"{path.stem}-{digest}.ipynb"
    if kept.is_file() and not again:
        return nbformat.read(kept, as_version=4)
    from nbclient import NotebookClient
    from traitlets.config import Config

    notebook = nbformat.reads(text.decode(), as_version=4)
    with tempfile.TemporaryDirectory(prefix="shipbench-notebook-") as folder:
        Path(folder, "work").mkdir()
        client = NotebookClient(
            notebook, timeout=_TIMEOUT_S, kernel_name="python3", resources={"metadata": {"path": f"{folder}/work"}},
            config=Config({"KernelManager": {"transport": "ipc", "ip": f"{folder}/kernel"}}),  # no port is opened
        )  # fmt: skip
        client.execute(env=os.environ | {"IPYTHONDIR": folder})
    part = kept.with_suffix(f".{os.getpid()}.tmp")
    nbformat.write(notebook, part)
    part.replace(kept)
    return notebook


def to_markdown(notebook: Any) -> str:
    """The cells in order, each with its outputs, as Markdown."""
    return "\n\n".join(part for cell in notebook.cells for part in _parts(cell))


def _parts(cell: Any) -> Iterator[str]:
    """Text as it stands; code, then what it printed and showed. Standard error is left out: it is progress."""
    if cell.cell_type != "code":
        yield cell.source
        return
    yield f"```python\n{cell.source}\n```"
    for output in cell.outputs:
        if output.output_type == "stream":
            if output.name == "stdout":
                yield _text(output.text)
        else:
            yield _shown(output.data)


def _shown(data: Any) -> str:
    """The richest form of a result: picture, HTML, text."""
    if "image/png" in data:
        return (
            f'<div class="output"><img alt="{escape(data["text/plain"])}" '
            f'src="data:image/png;base64,{data["image/png"].strip()}"></div>'
        )
    if "text/html" in data:
        table = (
            data["text/html"].replace(' class="dataframe"', "").replace(' border="1"', "")
        )  # pandas' own style; the theme's is used
        return f'<div class="output">{table}</div>'
    return _text(data["text/plain"])


def _text(text: str) -> str:
    return f'<pre class="output">{escape(text.rstrip())}</pre>'
