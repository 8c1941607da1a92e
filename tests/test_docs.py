"""The documentation: every block of code runs, every printed line comes out, and the site builds without a warning and
without the network."""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

from shipbench.cache import cache_folder

ROOT = Path(__file__).parent.parent
PAGES = sorted((ROOT / "docs").glob("*.md"))
_BLOCK = re.compile(
    r"(?:^`(?P<file>[\w./-]+)`:\n\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE
)
_SHIMS = {"shipbench": "-m shipbench", "pip": "-m pip", "python": ""}


@dataclass(frozen=True)
class Block:
    """A fenced block: the file that it is written to ("" where it is run instead), its language, its text, its line in
    the page."""

    file: str
    language: str
    text: str
    line: int


def blocks(text: str) -> list[Block]:
    return [
        Block(m["file"] or "", m["language"], m["text"], text[: m.start()].count("\n") + 1)
        for m in _BLOCK.finditer(text)
    ]


class Session:
    """Runs the blocks of one page in one folder: Python shares its names, files stay, `text` is what the block before
    must have printed."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self.folder, self.environment = folder, environment
        self.names: dict = {"__name__": "page"}
        self.output = ""

    def run(self, block: Block) -> None:
        if block.file:
            path = self.folder / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text)
        elif block.language == "python":
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile(block.text, f"line {block.line}", "exec"), self.names)
            self.output = printed.getvalue()
        elif block.language == "bash":
            command = ["bash", "-euo", "pipefail", "-c", block.text]
            done = subprocess.run(
                command, cwd=self.folder, env=self.environment, capture_output=True, text=True, check=False
            )
            self.output = done.stdout
            assert done.returncode == 0, f"{block.text}\n{done.stdout[-2000:]}\n{done.stderr[-3000:]}"
        elif block.language == "toml":
            tomllib.loads(block.text)
        elif block.language == "text":
            self.compare(block.text)
        else:
            pytest.fail(
                f"line {block.line}: a block of '{block.language}' cannot be run; accepted: python, bash, toml, text"
            )

    def compare(self, expected: str) -> None:
        """Every line must come in the output, in order; words between its words may be more."""
        lines = iter(self.output.splitlines())
        for line in expected.splitlines():
            pattern = r".*".join(re.escape(word) for word in line.split())
            assert any(re.search(pattern, found) for found in lines), (
                f"'{line}' was not printed (in this order) in:\n{self.output}"
            )


@pytest.fixture(scope="session")
def cache(tmp_path_factory):
    """Simulated data are made once for all pages, and machine code is that of the other tests."""
    folder, compiled = tmp_path_factory.mktemp("cache"), cache_folder() / "compiled"
    compiled.mkdir(parents=True, exist_ok=True)
    (folder / "compiled").symlink_to(compiled)
    return str(folder)


@pytest.fixture
def session(tmp_path, cache, monkeypatch):
    shims, site, work = tmp_path / "bin", tmp_path / "site", tmp_path / "work"
    shims.mkdir()
    work.mkdir()
    for name, arguments in _SHIMS.items():
        (shims / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {arguments} "$@"\n')
        (shims / name).chmod(0o755)
    monkeypatch.chdir(work)
    monkeypatch.setenv("SHIPBENCH_CACHE", cache)
    pip = {
        "PIP_TARGET": str(site),
        "PIP_NO_DEPS": "1",
        "PIP_NO_BUILD_ISOLATION": "0",
        "PIP_NO_INDEX": "1",
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
    }
    paths = {
        "PATH": f"{shims}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)]),
        "OMP_NUM_THREADS": "1",
    }
    return Session(work, os.environ | pip | paths)


@pytest.mark.long
@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_every_block_of_the_page_runs(page, session):
    found = blocks(page.read_text())
    assert page.read_text().count("\n```") == 2 * len(found)  # none is overlooked
    for block in found:
        session.run(block)


@pytest.mark.parametrize(
    "text",
    [
        "```python\n1 / 0\n```\n",
        "```bash\nfalse\n```\n",
        "```toml\nx =\n```\n",
        "```bash\necho a b\n```\n\n```text\nb a\n```\n",
        "```ruby\n1\n```\n",
    ],
)
def test_a_block_that_is_wrong_fails(text, session):
    *before, last = blocks(text)
    for block in before:
        session.run(block)
    with pytest.raises((AssertionError, ZeroDivisionError, tomllib.TOMLDecodeError, pytest.fail.Exception)):
        session.run(last)


@pytest.mark.long
def test_the_site_builds_strictly_and_fetches_nothing(tmp_path):
    pytest.importorskip("mkdocs", reason="mkdocs is not installed (extra `docs`)")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False
    )
    assert done.returncode == 0, done.stderr
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) >= len(PAGES)
    for page in pages:
        fetched = re.findall(r'<(?:script|link|img|iframe)[^>]*(?:src|href)="((?:https?:)?//[^"]*)"', page.read_text())
        assert not fetched, f"{page.name} fetches {fetched}"
    for style in (tmp_path / "site").rglob("*.css"):
        assert not re.search(r"url\([\"']?(?:https?:)?//", style.read_text()), style.name
    reference = (tmp_path / "site" / "commands" / "index.html").read_text()
    for command in ("shipbench run", "shipbench report RESULTS...", "shipbench data check DATASET"):
        assert f"<code>{command}</code>" in reference
    assert "--diagnosis" in reference
    for notebook in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
        page = tmp_path / "site" / "notebooks" / notebook.stem
        assert 'class="output"' in (page / "index.html").read_text()
        assert (page / notebook.name).read_bytes() == notebook.read_bytes()  # to download
