"""Names and words of others on pages, in LaTeX, Markdown and CSV: they stay text."""

from __future__ import annotations

import base64
import hashlib
import re

import pytest
from made_diagnosis import make_diagnosis
from made_results import results

from shipbench.bench.predict import Rollout, write_csv
from shipbench.bench.progress import Bar
from shipbench.cli.common import console_for_tables
from shipbench.leaderboard.formats import render
from shipbench.leaderboard.pages import build_board
from shipbench.render.escaping import csv_text, latex_text, markdown_text
from shipbench.render.table import Table, TableColumn
from shipbench.render.terminal import show_table
from shipbench.reports.diagnosis.page import diagnosis_page as page

SCRIPT = "<script>alert(1)</script>"


@pytest.mark.parametrize(
    ("text", "escaped"),
    [
        (SCRIPT, "&lt;script>alert(1)&lt;/script>"), ("<!-- x", "&lt;!-- x"), ("p <0.001 & more", "p <0.001 & more"),
        ("&lt;b>", "&amp;lt;b>"),
        ("[a](javascript:b)", "[a]\\(javascript:b)"), ("![a][b]", "![a]\\[b]"), ("mlp[epochs=3]", "mlp[epochs=3]"),
        ("a\n# b", "a # b"),
        ("x\x1b[2J", "x\\x1b[2J"),
    ],
)  # fmt: skip
def test_markdown_holds_no_html_and_no_links_of_others(text, escaped):
    assert markdown_text(text) == escaped


@pytest.mark.parametrize(
    ("text", "escaped"),
    [
        ("x\n\\immediate\\write18{id}", r"x \textbackslash{}immediate\textbackslash{}write18\{id\}"),
        ("`a_b` c", r"\texttt{a\_b} c"), ("[x", "{}[x"),
        ("*", "{}*"),
    ],
)  # fmt: skip
def test_latex_takes_nothing_for_a_command(text, escaped):
    assert latex_text(text) == escaped


@pytest.mark.parametrize("text", ["=cmd|'/c calc'!A0", "+cmd", "-cmd", "@SUM(A1)", " =x", "\t=x", "\uff1dx"])
def test_no_spreadsheet_computes_a_name(text):
    assert csv_text(text) == "'" + text


@pytest.mark.parametrize("text", ["-5", "+3.5e2", "-", "", "hold", "20/20", "a=b"])
def test_other_cells_stay_as_they_are(text):
    assert csv_text(text) == text


def hostile(form, tmp_path, **texts):
    """The page in one format of a data set whose summaries hold these texts."""
    found = results({"m": [[1, 2]]})
    for summary in found.summaries:
        summary.update(texts)
    return render(build_board(found, "toy"), form, f"shipbench leaderboard {SCRIPT}", [], tmp_path)[1]


def test_every_line_of_the_head_of_a_latex_page_is_a_comment(tmp_path):
    attack = "x\n\\immediate\\write18{id}\r\\input{y}\u2028\\z"
    text = hostile("latex", tmp_path, source=attack, notes=[attack], command=attack)
    head = text[: text.index(r"\begin{table}")].splitlines()
    assert all(line.startswith("%") or not line for line in head)


def test_no_text_of_a_summary_becomes_html_in_markdown(tmp_path):
    text = hostile("md", tmp_path, source=SCRIPT, licence=SCRIPT, notes=[SCRIPT], command=SCRIPT, ship=SCRIPT)
    assert text.count("&lt;script>") == 6
    assert not re.search(r"<(?!br>|sub>|/sub>)[a-z/!?]", text)
    assert not re.search(r"<[a-z]", Table(SCRIPT, [TableColumn(SCRIPT, "a")], [{"a": SCRIPT}], [SCRIPT]).markdown())


def test_names_in_csv_are_text(tmp_path):
    lines = render(build_board(results({"=cmd": [[1, 2]]}, "=data"), "=data"), "csv", "", [], tmp_path)[1].splitlines()[
        1:
    ]
    assert lines
    assert all(line.startswith("'=data,") for line in lines)
    assert any(",'=cmd," in line for line in lines)


def test_names_of_runs_in_predictions_are_text(tmp_path):
    import numpy as np

    write_csv(
        [Rollout(name, np.arange(2.0), np.zeros((2, 10))) for name in ("=cmd|'/c calc'!A0", "-5")],
        tmp_path / "p.csv",
    )
    first = [line.split(",")[0] for line in (tmp_path / "p.csv").read_text().splitlines()[1:]]
    assert first == ["'=cmd|'/c calc'!A0"] * 2 + ["-5"] * 2


def test_a_terminal_gets_no_commands_and_no_markup(capsys):
    table = Table("t\x1b[2J", [TableColumn("h\x9b2J", "a")], [{"a": "[red]x[/nothing] \u202e"}], ["n\x07"])
    show_table(table, console_for_tables())
    shown = capsys.readouterr().out
    assert not set(shown) & set("\x1b\x9b\x07\u202e")
    assert "[red]x[/nothing] \\u202e" in shown


def test_the_bar_takes_a_model_for_text():
    bar = Bar()
    bar.start(1)
    bar.working("mlp[epochs=3][/no]")
    assert "mlp[epochs=3][/no]" in str(bar.progress.columns[-1](bar.progress.tasks[0]))
    bar.finish()


def digest_of(content):
    return base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()


def test_pages_allow_their_own_style_and_nothing_else(tmp_path):
    for text in (
        hostile("html", tmp_path, source="<style>*{display:none}</style>"),
        page(make_diagnosis(name="<style>*{display:none}</style>")),
    ):
        policy = re.search(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', text)[1]
        assert policy.startswith("default-src 'none'; base-uri 'none'; form-action 'none'; ")
        scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
        assert "unsafe-eval" not in policy
        assert re.findall(r"script-src ([^;]*)", policy) == (
            [" ".join(f"'sha256-{digest_of(s)}'" for s in scripts)] if scripts else []
        )
        [style] = re.findall(
            r"<style[^>]*>(.*?)</style>", re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL), re.DOTALL
        )
        assert f"'sha256-{digest_of(style)}'" in policy
