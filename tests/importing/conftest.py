"""`trial_import`: runs `shipbench data import` in an empty folder on a log and a mapping."""

from __future__ import annotations

import pytest
from trial import SHIP, mapping, write
from typer.testing import CliRunner

from shipbench.cli.app import app


@pytest.fixture
def trial_import(tmp_path, monkeypatch):
    """Call it with the log (a table, text, bytes, or a list of paths), the mapping's text and further options; `name`
    is the log's file name, `ship` the text of the ship file."""
    monkeypatch.chdir(tmp_path)

    def run(log, plan: str | None = None, *options: str, name: str = "log.csv", ship: str = SHIP):
        logs = log if isinstance(log, list) else [write(tmp_path, name, log)]
        write(tmp_path, "mapping.toml", mapping() if plan is None else plan)
        write(tmp_path, "ship.toml", ship)
        arguments = [
            "data",
            "import",
            *map(str, logs),
            "--map",
            "mapping.toml",
            "--ship",
            "ship.toml",
            "--out",
            "out",
            *options,
        ]
        return CliRunner().invoke(app, arguments)

    return run
