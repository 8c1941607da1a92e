"""Names from outside: what is refused on load, what becomes of a label on disk, and that nothing unseen reaches a
terminal."""

from __future__ import annotations

import numpy as np
import pytest
from toy_ship import TOY_SHIP, sail, write_toy_folder
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.errors import InputError
from shipbench.names import check_label, check_name, file_name, shown
from shipbench.records import Dataset, Run

ESCAPE, C1, BIDI, ZERO_WIDTH, SURROGATE = "\x1b[2Jx", "\x9b2Jx", "a\u202eb", "a\u200bb", "a\udc80"
PATHS = ["../../evil", "/etc/evil", "a/b", "a\\b", "..", ".", ".hidden", "a..b", "", " "]


def run(name="r0", **meta):
    S, C = sail(20, 0)
    return Run(name, np.arange(21.0), S, C, meta=meta)


@pytest.mark.parametrize(
    "name", [*PATHS, ESCAPE, C1, BIDI, ZERO_WIDTH, SURROGATE, "x" * 81, "a\nb", "a\tb", "a\u2028b"]
)
def test_the_name_of_a_data_set_is_no_path_and_has_nothing_unseen(name):
    with pytest.raises(InputError, match="name = ") as caught:
        Dataset(name, TOY_SHIP, 1.0, (run(),))
    assert str(caught.value).isprintable()
    with pytest.raises(InputError, match=r"mapping\.toml: name = "):
        check_name(name, "mapping.toml: name")


@pytest.mark.parametrize(
    "name", ["harbour90", "my trial", "x" * 80, "Zürich-7 (noisy)", "试航", "v1.2", "single-current[0.3]"]
)
def test_names_that_people_use_are_accepted(name):
    assert Dataset(name, TOY_SHIP, 1.0, (run(),)).name == name


@pytest.mark.parametrize("text", [ESCAPE, C1, BIDI, "x" * 81, "a\nb"])
@pytest.mark.parametrize("key", ["id", "manoeuvre", "group"])
def test_labels_of_runs_have_nothing_unseen(key, text):
    with pytest.raises(InputError, match="run" if key == "id" else f"run 'r0': {key} = "):
        run(**({"name": text} if key == "id" else {key: text}))


def test_a_manoeuvre_may_be_written_with_a_slash_and_windows_may_lengthen_a_name():
    kept = run("20/20 zigzag " + "x" * 67, manoeuvre="zigzag 20/20")
    assert Dataset("toy", TOY_SHIP, 1.0, (kept,)).windows(5).runs[1].id.endswith("x@5s")


@pytest.mark.parametrize("number", [7, None, ["a"]])
def test_a_name_is_text(number):
    with pytest.raises(InputError, match=r"model = .* is no text"):
        check_label(number, "model")


@pytest.mark.parametrize(
    ("label", "name"),
    [
        ("mlp[epochs=3]", "mlp[epochs=3]"),
        ("physics+current", "physics+current"),
        ("./mine.py:Still", ".-mine.py-Still-0487a0"),
    ],
)
def test_labels_keep_the_folders_that_they_had(label, name):
    """Studies on disk are found and resumed under these names."""
    assert file_name(label) == name


@pytest.mark.parametrize(
    "label", [*PATHS, "../" * 40 + "x", "\U0001d400" * 80, ESCAPE, SURROGATE, "a\0b", "CON:x", "x" * 5000]
)
def test_a_file_name_is_one_part_of_a_path_and_tells_labels_apart(label):
    name = file_name(label)
    assert name not in ("", ".", "..")
    assert not set(name) & set("/\\\0:")
    assert len(name.encode()) < 240
    assert file_name(label + "x") != name


def test_text_on_a_terminal_shows_what_is_unseen():
    assert shown(f"{ESCAPE} {BIDI} {C1} {SURROGATE}") == r"\x1b[2Jx a\u202eb \x9b2Jx a\udc80"
    assert shown("zwölf\u00a0试航") == "zwölf\u00a0试航"
    assert shown("one\ntwo\x07", keep="\n") == "one\ntwo\\x07"


@pytest.mark.parametrize("name", ['"../../evil"', '".."', '"a/b"', '"\\u001b[2Jx"', '"' + "x" * 300 + '"'])
def test_run_refuses_the_name_before_anything_is_fitted(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    write_toy_folder(tmp_path / "toyset", 4)
    description = tmp_path / "toyset/dataset.toml"
    lines = [f"name = {name}" if line.startswith("name = ") else line for line in description.read_text().splitlines()]
    description.write_text("\n".join(lines))
    before = sorted(tmp_path.rglob("*"))
    result = CliRunner().invoke(
        app, ["run", "-m", "hold", "-d", "toyset", "--horizon", "10", "--folds", "2", "--out", "o"]
    )
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: toyset/dataset.toml: name = ")
    assert result.stderr.rstrip("\n").isprintable()
    assert sorted(tmp_path.rglob("*")) == before
