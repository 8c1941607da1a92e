"""The page of `shipbench report`: what it holds, what it leaves out, what it refuses, and that no name can break out of
its text."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hostile import HOSTILE, Elements, drawings, page_of
from typer.testing import CliRunner

from shipbench.bench.submissions import read_results
from shipbench.cli.app import app
from shipbench.errors import InputError
from shipbench.leaderboard.histories import near
from shipbench.leaderboard.pages import build_board
from shipbench.leaderboard.series import gather
from shipbench.leaderboard.slicing import regime_errors
from shipbench.metrics.base import fit_percent
from shipbench.render.svg import Axes, limits, path, ticks
from shipbench.render.table import Table, TableColumn, number, table_cells
from shipbench.reports.study.beside import _numbers, check_given, diagnoses
from shipbench.reports.study.page import write_report


def test_the_page_holds_all_parts_and_fetches_nothing(study, tmp_path):
    text = page_of(study, tmp_path).path.read_text()
    for part in ("board", "tracks", "growth", "regimes", "fits", "diagnoses", "status", "about"):
        assert f'id="d0-{part}"' in text
        assert f'href="#d0-{part}"' in text
    assert re.search(
        r"default-src 'none'; .*style-src-elem( 'sha256-[\w+/=]+'){2}; style-src-attr 'unsafe-inline'; script-src( "
        r"'sha256-[\w+/=]+'){4}\">",
        text,
    )
    for tag, attributes in Elements(text).tags:
        assert "src" not in attributes, tag
        assert attributes.get("href", "#").startswith("#")  # no diagnosis here, so no link out of the page


def test_no_name_breaks_out_of_its_text(study, tmp_path):
    text = page_of(study, tmp_path).path.read_text()
    tags = Elements(text).tags
    assert "r4 &lt;img" in text
    assert [a.get("type") for tag, a in tags if tag == "script"] == ["application/json", None, None, None, None]
    assert "img" not in dict(tags)
    assert not [name for _, attributes in tags for name in attributes if name.startswith("on")]
    assert {run["name"] for run in drawings(text)["runs"]} == {f"r{i} {HOSTILE}" for i in range(9)}


def test_failed_and_diverged_models_stand_with_their_reasons(study, tmp_path):
    text = page_of(study, tmp_path).path.read_text()
    status = text[text.index('id="d0-status"') :]
    assert "predict: ValueError: &lt;/script&gt;" in status
    assert "x is inf at t = 6 s" in status
    assert "<dt>Failed, diverged or skipped</dt><dd>6<small>" in text  # three folds each of Fails and Blows
    assert "m.py:Fails" not in text[text.index("Models in the pictures") : text.index('id="d0-tracks"')]


def test_the_error_of_the_best_model_is_that_of_the_table(study, tmp_path):
    text = page_of(study, tmp_path).path.read_text()
    board = build_board(read_results([study]), read_results([study]).rows["dataset"][0])
    best = next(row for row in board.tables[0].rows if row["model"] == board.ranking[0])
    assert f"mean position error ED {best['ed_mean']:.3g} m over" in text


def test_any_run_can_be_drawn_with_the_error_of_each_model(study, tmp_path):
    data = drawings(page_of(study, tmp_path).path.read_text())
    results = read_results([study])
    assert len(data["runs"]) == 9
    for run in data["runs"]:
        rows = results.rows[results.rows["run"] == run["name"]].set_index("model")["ed"]
        errors = [cells[0] for cells in run["cells"]]
        assert errors[0].endswith(" m")
        shown = sorted(float(e.split()[0]) for e in errors if re.fullmatch(r"[\d.e+-]+ m", e))
        assert shown == sorted(float(f"{v:.3g}") for v in rows.dropna())
        assert len(run["values"]) == len(data["series"]) == 4  # measured and three models that were scored


def test_the_plots_hold_what_was_measured_and_predicted_to_the_last_decimal(study, tmp_path):
    results = read_results([study])
    data = drawings(page_of(study, tmp_path).path.read_text())
    whole = {track.run: track for track in gather(results, "toy", ["hold"]).tracks}
    names = [c["name"] for c in data["columns"]]
    hold = next(i for i, s in enumerate(data["series"]) if s["name"] == "hold")
    for run in data["runs"]:
        track = whole[run["name"]]
        for line, S in ((0, track.truth), (hold, track.predicted["hold"])):
            for name, factor, column in (
                ("u", 1.0, 3),
                ("r", 180 / np.pi, 5),
                ("delta", 180 / np.pi, 7),
                ("east", 1.0, 1),
            ):
                c = names.index(name)
                steps, decimals = run["values"][line][c], data["columns"][c]["decimals"]
                got = np.cumsum([s for s in steps if s is not None]) / 10.0**decimals
                np.testing.assert_allclose(got, factor * S[: len(got), column], atol=0.501 * 10.0**-decimals)
        error = run["values"][hold][names.index("error")]
        assert error[0] == 0
        assert run["values"][0][names.index("error")] is None  # what was measured has no error


def test_fit_is_that_of_matlabs_compare():
    t = np.linspace(0.0, 6.0, 61)
    true = np.zeros((61, 10))
    true[:, 3], true[:, 4] = np.sin(t), 2.0
    pred = true.copy()
    pred[:, 3] = true[:, 3].mean()
    assert fit_percent(true=true, pred=true)[3] == 100.0
    assert fit_percent(true=true, pred=pred)[3] == pytest.approx(0.0)
    assert np.isnan(fit_percent(true=true, pred=pred)[4])  # a constant has nothing to explain


def test_tracks_are_thinned_and_left_out_within_the_budget_and_the_page_says_so(study):
    results, models = read_results([study]), ["hold"]
    whole = gather(results, "toy", models)
    assert (len(whole.tracks), len(whole.tracks[0].truth), whole.left_out) == (9, 31, [])
    thinned = gather(results, "toy", models, points=9 * (2 * 26 + 50))
    assert (len(thinned.tracks), len(thinned.tracks[0].truth)) == (9, 26)
    np.testing.assert_array_equal(thinned.tracks[0].truth[[0, -1]], whole.tracks[0].truth[[0, -1]])
    assert any("26 of its points" in line for line in thinned.left_out)
    few = gather(results, "toy", models, points=4 * (2 * 25 + 50))
    assert len(few.tracks) == 4
    assert any("Tracks and time histories: 4 of 9 windows" in line for line in few.left_out)


def test_a_folder_without_predictions_still_gives_its_tables(study, tmp_path):
    bare = tmp_path / "bare"
    bare.mkdir()
    for name in ("rows.parquet", "summary.json"):
        shutil.copy(study / name, bare)
    written = write_report(read_results([bare]), tmp_path / "page.html", "c")
    text = written.path.read_text()
    assert 'id="d0-board"' in text
    assert 'id="d0-tracks"' not in text
    assert any("`hold`, fold 0, are not drawn; they cannot be read" in line for line in written.left_out["toy"])
    assert "<code>hold</code>, fold 0, are not drawn" in text


def test_damaged_predictions_are_named_and_the_others_drawn(study, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(study, copy)
    (copy / "cells" / "toy" / "hold" / "fold1-seed0" / "predictions.npz").write_bytes(b"PK\x03\x04 no archive")
    written = write_report(read_results([copy]), tmp_path / "page.html", "c")
    assert [line[:40] for line in written.left_out["toy"]] == ["The predictions of `hold`, fold 1, are n"]
    assert len(drawings(written.path.read_text())["runs"]) == 9


def test_the_growth_ends_at_the_median_error_of_the_rows(study):
    series = gather(read_results([study]), "toy", ["hold"])
    rows = read_results([study]).rows
    assert series.t[-1] == 30.0
    assert np.median(series.errors["hold"][0][:, -1]) == pytest.approx(
        rows.loc[rows["model"] == "hold", "final_displacement"].median()
    )


def test_regimes_are_means_over_the_windows_of_the_slice(study, tmp_path):
    results = read_results([study])
    held = results.rows[results.rows["model"] == "hold"].set_index("run")["ed"]
    astern = f"r4 {HOSTILE}"
    expected = [held.drop(astern).mean(), held[astern]]
    (drawn,) = [r for r in regime_errors(results.rows, results.windows, ["hold"]) if r.name == "astern"]
    assert (drawn.labels, drawn.counts) == (("never astern", "astern"), (8, 1))
    assert drawn.values["hold"] == pytest.approx(expected)
    text = page_of(study, tmp_path).path.read_text()
    table = text[text.index("<summary>Regime slices") :]
    for label, value in zip(drawn.labels, expected, strict=True):
        row = table[table.index(f">{label}<") :].split("</tr>")[0]
        assert any(float(v) == pytest.approx(value) for v in re.findall(r'class="number" data-by="([\d.]+)">', row))


def diagnosis(folder: Path, fingerprint: str, dataset: str = "toy") -> Path:
    cause = {"effect": f"current{HOSTILE}", "parameters": {"speed": {"value": 0.3, "unit": "m/s", "ci95": [0.2, None]}},
             "gain": {"metric": "ED", "relative": 0.25}}  # fmt: skip
    document = {
        "dataset": dataset,
        "verdict": "found",
        "causes": [cause],
        "extended_model": "physics+current",
        "fingerprint": fingerprint,
    }
    folder.mkdir(parents=True)
    (folder / "diagnosis.json").write_text(json.dumps(document))
    (folder / "report.html").write_text("<p>diagnosis</p>")
    return folder


def test_diagnoses_are_linked_whether_given_or_found_beside(study, tmp_path):
    fingerprint = read_results([study]).summaries[0]["fingerprint"]
    given = diagnosis(tmp_path / "my diagnosis?#", fingerprint)
    text = page_of(study, tmp_path, given=[given]).path.read_text()
    assert 'href="./my%20diagnosis%3F%23/report.html"' in text
    assert "speed 0.3 m/s [0.2, -]; ED -25 % on held-out runs" in text
    assert "other data" not in text
    copy = tmp_path / "runs" / "copy"
    shutil.copytree(study, copy)
    diagnosis(tmp_path / "diagnoses" / "toy", "f00")
    text = write_report(read_results([copy]), copy / "report.html", "c").path.read_text()
    assert 'href="./../../diagnoses/toy/report.html"' in text
    assert f"other data than these scores (fingerprint f00, here {fingerprint})" in text


def test_a_diagnosis_that_cannot_be_read_is_refused_where_given_and_told_where_found(study, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(study, copy)
    (copy / "diagnosis.json").write_text("[1")
    results = read_results([copy])
    with pytest.raises(InputError, match=r"holds no diagnosis that can be read"):
        write_report(results, tmp_path / "page.html", "c", given=[copy])
    assert not (tmp_path / "page.html").exists()
    assert "holds no diagnosis that can be read" in write_report(results, tmp_path / "page.html", "c").path.read_text()
    with pytest.raises(InputError, match=r"is of data set 'other'; these results are of toy"):
        write_report(results, tmp_path / "page.html", "c", given=[diagnosis(tmp_path / "d", "f", "other")])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"causes": 5}, "causes = 5; accepted: a valid list"), ({"causes": [5]}, "causes.0 = 5"),
        ({"causes": [{"parameters": [1]}]}, "causes.0.parameters = [1]"),
        ({"causes": [{"gain": 1}]}, "causes.0.gain = 1"),
        ({"causes": [{"parameters": {"speed": {"value": "3"}}}]}, "causes.0.parameters.speed.value"),
        ({"causes": [{"gain": {"relative": 10**400}}]}, "causes.0.gain.relative"),
        ({"extended_model": 1}, "extended_model = 1"),
        ({"fingerprint": None}, "fingerprint = None"), ({"verdict": ["found"]}, "verdict = "),
        ({"dataset": 3}, "dataset = 3"),
    ],
)  # fmt: skip
def test_a_diagnosis_with_an_entry_of_another_type_is_refused_where_given_and_told_where_found(
    study, tmp_path, change, message
):
    folder = diagnosis(tmp_path / "copy/diagnosis", "f")
    shutil.copytree(study, tmp_path / "copy", dirs_exist_ok=True)
    document = json.loads((folder / "diagnosis.json").read_text())
    (folder / "diagnosis.json").write_text(json.dumps(document | change))
    with pytest.raises(InputError, match=re.escape(f"{folder}/diagnosis.json: {message}")):
        check_given([folder], ["toy"])
    found = diagnoses(read_results([tmp_path / "copy"]), "toy", [], tmp_path / "page.html")
    assert [message in d.warning for d in found] == [True]


@pytest.mark.parametrize("text", ["[" * 100_000, "5", "[1]", "\ud800", ""])
def test_a_diagnosis_that_is_no_object_is_refused(tmp_path, text):
    (tmp_path / "diagnosis.json").write_text(text, errors="surrogatepass")
    with pytest.raises(InputError, match="diagnosis"):
        check_given([tmp_path], ["toy"])


def test_fitted_numbers_are_compared_over_the_fits(study, tmp_path):
    text = page_of(study, tmp_path).path.read_text()
    assert "1/s [1, 3] some &lt;b&gt;gain&lt;/b&gt;" in text
    assert _numbers(["  p = 1.2.3 m x\n  q = 1e999 m x"]) == [("q", np.inf, np.inf, np.inf, "m x")]
    found = _numbers(
        ["a\n  p1 = 2 N s/m [1, 3] x\n  p1 = 7 1 y", "  p1 = 4e1 N s/m z\n  p1 = 7 1 y", "  p1 = -1 N s/m z"]
    )
    assert found == [("p1", 2.0, -1.0, 40.0, "N s/m [1, 3] x"), ("p1", 7.0, 7.0, 7.0, "1 y")]


def test_a_prediction_that_leaves_the_picture_is_cut():
    truth = np.zeros((11, 10))
    truth[:, 0] = np.linspace(0, 100, 11)
    away = truth.copy()
    away[5:, 1] = 1e7
    away[8, 0] = np.nan
    assert np.isfinite(near(away, truth)).all(axis=1).tolist() == [True] * 5 + [False] * 6


def test_axes_put_points_where_they_belong():
    axes = Axes((0.0, 10.0), (1.0, 100.0), log=True)
    assert float(axes.py(10.0)) == pytest.approx(0.5 * float(axes.py(1.0) + axes.py(100.0)))
    assert float(axes.py(0.0)) == float(axes.py(1.0))
    assert path(np.array([[0, 0], [1.26, 2], [np.nan, 0], [5, 5.04]])) == "M0 0l1.3 2M5 5"
    assert ticks(0.0, 10.0) == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
    assert limits([0.0], [2.0], [1.0, 1.5]) == ((0.0, 2.1), False)
    assert limits([0.1, 1.0], [2.0, 60.0], [0.5, 40.0])[1]


def test_the_command_writes_the_page_and_says_what_it_left_out(study, tmp_path):
    def command(*args):
        return CliRunner().invoke(app, ["report", *map(str, args)])

    done = command(study, "--out", tmp_path / "deep" / "p.html", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["bytes"] == (tmp_path / "deep" / "p.html").stat().st_size
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["p.html"]
    refused = command(tmp_path / "nothing")
    assert refused.exit_code == 2
    assert "holds no results" in refused.output
    (tmp_path / "file").write_text("")
    refused = command(study, "--out", tmp_path / "file" / "p.html")
    assert (refused.exit_code, "Traceback" in refused.output) == (2, False)
    assert "cannot write the page" in refused.output


def test_intervals_of_a_table_stand_under_their_figures():
    column = TableColumn("ED", "ed", number(2))
    cells = table_cells(
        Table("T", [column], [{"ed": 1.0, "ed_low": 0.5, "ed_high": 2.0}, {"ed": 1.0}, {"ed": float("nan")}])
    )["rows"]
    assert [(row["cells"][0]["between"], row["cells"][0]["by"]) for row in cells] == [
        ("0.50 to 2.00", "1.0"),
        ("", "1.0"),
        ("", ""),
    ]
