"""The Python interface: data sets as sequences, in frames and in notebooks; models in memory; scores."""

from __future__ import annotations

import gc
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import shipbench as sb
from shipbench.errors import InputError

ROOT = Path(__file__).parent.parent
OPTIONS = {"horizon": 40, "folds": 2, "quiet": True}


@dataclass
class Drift:
    """Keeps its velocity, scaled; counts how often it was fitted."""

    scale: float = 1.0
    fits: int = 0

    def fit(self, train, valid=None, *, seed=0):
        self.fits += 1
        if self.fits > 1:
            raise RuntimeError("fitted twice")
        self.dt = train.dt
        return self

    def predict(self, s0, U, history=None):
        S = np.repeat(s0[:, None], U.shape[1], axis=1)
        psi, u, v = s0[:, 2, None], s0[:, 3, None] * self.scale, s0[:, 4, None] * self.scale
        t = self.dt * np.arange(1, U.shape[1] + 1)
        S[:, :, 0] += t * (u * np.cos(psi) - v * np.sin(psi))
        S[:, :, 1] += t * (u * np.sin(psi) + v * np.cos(psi))
        return S


class Broken(Drift):
    def fit(self, train, valid=None, *, seed=0):
        raise ValueError("out of luck")


@pytest.fixture(scope="module")
def scores(harbour) -> sb.Scores:
    return sb.benchmark([Drift(0.5), Drift, "hold", Broken], harbour, **OPTIONS)


def test_a_data_set_is_a_sequence_of_runs(harbour):
    assert [run.id for run in harbour] == [run.id for run in harbour.runs]
    assert harbour["run7"] is harbour[7] is harbour.runs[7]
    assert harbour[-1] is harbour.runs[-1]
    assert "run7" in harbour
    assert "run99" not in harbour
    assert [run.id for run in harbour[2:8:3]] == ["run2", "run5"]
    assert harbour[:2].ship is harbour.ship
    assert np.array_equal(harbour[0].commands, harbour[0].inputs[:, :4])
    with pytest.raises(InputError, match=r"unknown run 'run77'\. Did you mean 'run7'"):
        harbour["run77"]
    with pytest.raises(IndexError, match="has no run 99; it has 16 runs, 0 to 15"):
        harbour[99]


def test_a_frame_gives_back_the_same_samples(harbour):
    frame = harbour.to_frame()
    assert list(frame.columns[:5]) == ["trajectory", "t", "x", "y", "psi"]
    assert len(frame) == sum(map(len, harbour))
    again = sb.Dataset.from_frame(frame, harbour.ship, name=harbour.name)
    assert again.fingerprint == harbour.fingerprint
    assert again.dt == harbour.dt


def test_a_frame_may_have_environment_channels_metadata_and_a_ship_file(harbour, tmp_path):
    (tmp_path / "ship.toml").write_text(harbour.ship.to_toml())
    frame = harbour[:2].to_frame().assign(depth=12.5, remark="calm")
    data = sb.Dataset.from_frame(frame, tmp_path / "ship.toml", meta={"run1": {"manoeuvre": "turn"}}, licence="MIT")
    assert data.inputs[-1] == "depth"
    assert (data["run0"].inputs[:, -1] == 12.5).all()
    assert data["run1"].kind == "turn"
    assert data.licence == "MIT"
    tenths = frame.assign(t=frame["t"] / 10.0)
    assert sb.Dataset.from_frame(tenths, harbour.ship).dt == 0.1


def test_actuators_that_a_frame_lacks_are_noted(harbour):
    data = sb.Dataset.from_frame(harbour[:2].to_frame().drop(columns=["F_b", "F_b_c"]), harbour.ship, notes=["mine"])
    assert data.notes == ("mine", "F_b and F_b_c are not recorded: taken as zero")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.drop(columns="psi"), "frame lacks psi"),
        (lambda f: f.drop(columns="trajectory"), 'frame.assign(trajectory="run1")'),
        (lambda f: f.assign(u="fast"), "frame, row 0: u is 'fast', not a number"),
        (lambda f: f.assign(u=True), "u is 'True', not a number"),
        (lambda f: f.iloc[:0], "frame has no rows"),
        (lambda f: f.to_dict(), "frame is of the type dict"),
        (lambda f: f.assign(t=f["t"] ** 2), "Resample the run"),
        (lambda f: f.set_axis(["trajectory", "t", "x", "x", *f.columns[4:]], axis=1), "2 columns are 'x'"),
    ],
)
def test_a_frame_that_is_no_data_set_is_refused(harbour, change, message):
    with pytest.raises(InputError, match=re.escape(message)):
        sb.Dataset.from_frame(change(harbour[:2].to_frame()), harbour.ship)


def test_metadata_of_an_unknown_run_are_refused(harbour):
    with pytest.raises(InputError, match="unknown run in meta 'run9'"):
        sb.Dataset.from_frame(harbour[:2].to_frame(), harbour.ship, meta={"run9": {}})


def test_a_data_set_shows_a_paragraph_and_a_picture(harbour):
    text = repr(harbour)
    for part in ("16 runs", "40 s each", "container130", "L = 130 m"):
        assert part in text
    hostile = harbour.with_runs([replace(harbour[0], id="<b>")])
    html = hostile._repr_html_()
    assert "<b>" not in html.replace("<b>Data set", "")
    assert html.count("<path") == 2  # a track and the scale
    still = harbour[0].slice(0, 1)
    assert "nan" not in harbour.with_runs([still])._repr_html_()


def test_the_package_says_that_it_is_typed():
    assert (ROOT / "shipbench/py.typed").is_file()


def test_models_in_memory_stand_in_the_table_beside_others(scores):
    table = scores.table().set_index("model")
    assert set(table.index) == {"Drift[scale=0.5]", "Drift", "hold", "Broken"}
    assert table.index[-1] == "Broken"
    assert table.loc["Drift", "scored"] == "16/16"
    assert table.loc["Broken", "scored"] == "0/16"
    assert table.loc["Drift", "ED"] < table.loc["Drift[scale=0.5]", "ED"]
    assert (table["ED low"] < table["ED"])[:3].all()
    assert (table["ED"] < table["ED high"])[:3].all()
    rows = scores.results.rows
    assert table.loc["hold", "ED"] == pytest.approx(rows[rows["model"] == "hold"].groupby("fold")["ed"].mean().mean())
    assert scores.table().attrs["units"]["ED"] == "m"
    assert list(scores.table("rmse_r").columns) == ["model", "scored", "RMSE r", "RMSE r low", "RMSE r high"]
    assert scores.table(["ED"]).equals(scores.table(["ed"]))
    with pytest.raises(InputError, match="unknown metric 'eed'"):
        scores.table(["eed"])


def test_scores_tell_of_fits_that_failed(scores):
    assert len(scores.failed) == 2
    for text in (repr(scores), scores._repr_html_()):
        assert "fit: ValueError: out of luck" in text
    lines = repr(scores).splitlines()
    assert lines[1].startswith("'hold' is first")
    assert "(after Holm for 3 pairs), 16 runs." in lines[1]
    assert lines[2].startswith("  hold: ")


def test_scores_without_a_score_say_where_the_reasons_stand(harbour):
    text = repr(sb.benchmark(Broken, harbour, **OPTIONS))
    assert "in Python in scores.results.rows" in text


def test_scores_draw_and_write_a_page(scores, tmp_path):
    axes = scores.plot_tracks("run7").axes
    assert [axis.get_title() for axis in axes] == ["run7"]
    assert len(scores.plot_tracks().axes) == 3
    for figure in (scores.plot_errors(), scores.plot_growth()):
        assert figure._repr_png_().startswith(b"\x89PNG")
    page = scores.report(tmp_path / "page.html")
    assert "Drift[scale=0.5]" in page.read_text()
    with pytest.raises(InputError, match="unknown run 'run77'"):
        scores.plot_tracks("run77")
    with pytest.raises(InputError, match="unknown data set 'other'"):
        scores.plot_errors("other")


def test_results_are_kept_where_out_says_and_else_as_long_as_the_scores(harbour, tmp_path):
    kept = sb.benchmark(Drift, [harbour], out=tmp_path / "mine", **OPTIONS)
    assert repr(sb.Scores(sb.read_results(str(tmp_path / "mine")))) == repr(kept)
    assert sb.report(tmp_path / "mine", tmp_path / "page.html").stat().st_size > 10_000
    passing = sb.benchmark({"mine": Drift()}, harbour, **OPTIONS)
    assert passing.table()["model"].tolist() == ["mine"]
    [folder] = set(passing.results.sources)
    assert folder.is_dir()
    del passing
    gc.collect()
    assert not folder.exists()


def test_cells_of_a_model_in_memory_are_never_taken_for_finished(harbour, tmp_path):
    found = sb.benchmark(Drift, harbour, out=tmp_path, **OPTIONS)
    assert {summary["key"] for summary in found.results.summaries} == {""}


def test_a_second_call_goes_on_where_resume_says_so(harbour, tmp_path):
    sb.benchmark("hold", harbour, out=tmp_path, **OPTIONS)
    began = {path: path.stat().st_mtime_ns for path in tmp_path.glob("cells/*/*/*/rows.parquet")}
    with pytest.raises(InputError, match=r"holds the results of another study.*resume=True"):
        sb.benchmark(["hold", Drift], harbour, out=tmp_path, **OPTIONS)
    both = sb.benchmark(["hold", Drift], harbour, out=tmp_path, resume=True, **OPTIONS)
    assert set(both.table()["model"]) == {"hold", "Drift"}
    assert {path: path.stat().st_mtime_ns for path in began} == began


def test_a_task_that_is_not_accepted_is_told_in_one_line():
    with pytest.raises(InputError, match=r'^Task: no model is given; name at least one \(models=\["physics"\]\)'):
        sb.Task(dataset="demo")
    with pytest.raises(InputError, match=r"^Task: folds: "):
        sb.Task(dataset="demo", models=["hold"], folds=1)
    assert sb.Task(dataset="demo", models=["hold"]).horizon_s == 120.0


def test_runs_and_registries_show_their_names_in_brief(harbour):
    assert isinstance(harbour.runs, tuple)
    assert repr(harbour.runs).startswith("<16 runs: run0, run1,")
    many = harbour.with_runs(replace(harbour[0], id=f"run{k:04d}") for k in range(200))
    assert len(repr(many.runs)) <= 1000
    assert "hold, lstm, mlp" in repr(sb.PREDICTORS)
    assert "demo, esso_osaka" in repr(sb.DATASETS)
    assert "cvdm, ed" in repr(sb.METRICS)


def test_a_predictor_says_whether_it_is_fitted(harbour):
    model = sb.make_predictor("mlp[hidden=8]")
    assert repr(model).startswith("<MLP(hidden=8, ")
    assert repr(model).endswith("not fitted>")
    assert repr(sb.make_predictor("hold").fit(harbour)) == "<Hold(), fitted>"


def test_a_data_set_by_folder_and_several_at_once(harbour, tmp_path):
    from shipbench.data.files import write_dataset

    write_dataset(replace(harbour, name="other"), tmp_path / "other")
    found = sb.benchmark("hold", (harbour, tmp_path / "other"), **OPTIONS)
    assert found.datasets == ["small_harbour", "other"]
    table = found.table()
    assert table["dataset"].tolist() == ["small_harbour", "other"]
    assert table["ED"].iloc[0] == table["ED"].iloc[1]


class NeedsSize(Drift):
    def __init__(self, size):
        self.size = size


@pytest.mark.parametrize(
    ("models", "options", "message"),
    [
        (
            Drift,
            {"executor": "processes"},
            "runs in this process only; executor 'processes' needs a class that can be imported",
        ),
        (np.eye(3), {}, "the model ndarray has no method fit and no predict"),
        (NeedsSize, {}, "Give an object, such as MyNet(hidden=64)"),
        ("hodl", {}, "Did you mean 'hold'"),
        ({"mine": "hold"}, {}, "'mine' names a spec, which is its own name"),
        ([], {}, "no model is given"),
        ("hold", {"hurry": True}, "benchmark has no parameter 'hurry'. Accepted: bands, data, device"),
        ("hold", {"horizon_s": 30}, "no parameter 'horizon_s'. Did you mean 'horizon'"),
        ("hold", {"horizn": 30}, "no parameter 'horizn'. Did you mean 'horizon'"),
        ("hold", {"dataset": "demo"}, "no parameter 'dataset'"),
        ("hold", {"horizon": 400}, "Shorten the horizon"),
    ],
)
def test_what_cannot_be_scored_is_refused(harbour, models, options, message):
    with pytest.raises(InputError, match=re.escape(message)):
        sb.benchmark(models, harbour, **OPTIONS | options)


def test_a_predictor_is_made_of_text_a_class_or_an_object(harbour):
    assert sb.make_predictor("physics+current").name == "physics"
    assert isinstance(sb.make_predictor(Drift), Drift)
    mine = Drift(0.5)
    copied = sb.make_predictor(mine).fit(harbour)
    assert (copied.scale, mine.fits) == (0.5, 0)


class Again(Drift):
    """May be fitted more than once."""

    def fit(self, train, valid=None, *, seed=0):
        self.fits = 0
        return super().fit(train, valid, seed=seed)


def test_the_contract_is_put_to_a_class_in_memory():
    found = sb.check_model(Again)
    assert found.model == "Again"
    assert not [v for v in found.of("broken") if v.rule in ("fit", "parameters", "causality", "shapes")], found
    assert {v.rule for v in found.of("not applicable")} >= {"parameters"}
    assert repr(found).startswith("Check of Again")


def test_a_script_without_a_guard_may_use_processes(tmp_path):
    script = tmp_path / "script.py"
    lines = [
        "from shipbench.processes import process_pool",
        "print('begun')",
        "with process_pool(2, '') as pool:",
        "    print(pool.submit(abs, -7).result())",
    ]
    script.write_text("\n".join(lines))
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert (done.stdout, done.returncode) == ("begun\n7\n", 0), done.stderr


def test_a_folder_of_results_does_not_hide_the_data_set_of_its_name(tmp_path, monkeypatch):
    (tmp_path / "demo").mkdir()
    monkeypatch.chdir(tmp_path)
    assert sb.load_dataset("demo").name == "demo"


def test_a_check_of_data_shows_its_findings(harbour):
    assert repr(sb.check_data(harbour)) == "No findings"
    port = harbour.with_runs([replace(r, states=np.where(np.arange(10) == 7, -r.states, r.states)) for r in harbour])
    found = sb.check_data(port)
    assert found
    assert repr(found).startswith(f"{sum(f.severity == 'error' for f in found)} error")
    assert found.table()["severity"].tolist() == [f.severity for f in found]
    assert found[0].kind in found._repr_html_()


def _log(folder: Path, harbour: sb.Dataset) -> Path:
    frame = harbour["run0"].states
    columns = dict(zip(["x", "y", "psi", "u", "v", "r"], frame[:, :6].T, strict=True))
    lines = [
        ",".join(["t", *columns]),
        *(",".join(f"{v:.6f}" for v in (t, *row)) for t, row in zip(harbour["run0"].t, frame[:, :6], strict=True)),
    ]
    (folder / "bridge.csv").write_text("\n".join(lines))
    (folder / "ship.toml").write_text(harbour.ship.to_toml())
    return folder / "bridge.csv"


MAPPING = """
name = "bridge"
dt = 1.0
[time]
column = "t"
format = "s"
[channels]
x = {column = "x", unit = "m"}
y = {column = "y", unit = "m"}
psi = {column = "psi", unit = "rad"}
u = {column = "u", unit = "m/s"}
v = {column = "v", unit = "m/s"}
r = {column = "r", unit = "rad/s"}
"""


def test_a_log_becomes_a_data_set(harbour, tmp_path):
    log = _log(tmp_path, harbour)
    draft = sb.propose_mapping(log)
    assert "[channels]" in draft.text
    assert "mapping.toml" not in " ".join(draft.remarks)  # nothing was written
    written = sb.propose_mapping([log], tmp_path / "draft.toml")
    assert (tmp_path / "draft.toml").read_text() == written.text == draft.text
    assert (
        written.remarks[-1].strip()
        == f'shipbench.import_log({str(log)!r}, {str(tmp_path / "draft.toml")!r}, "ship.toml", out="my_trial")'
    )
    with pytest.raises(InputError, match="another name with out=FILE, or force=True to replace it"):
        sb.propose_mapping(log, tmp_path / "draft.toml")
    (tmp_path / "mapping.toml").write_text(MAPPING)
    summary = sb.import_log(log, tmp_path / "mapping.toml", tmp_path / "ship.toml", tmp_path / "trial", name="mine")
    assert "1 run" in repr(summary)
    data = sb.load_dataset(tmp_path / "trial")
    assert data.name == "mine"
    assert data[0].states[:, 0] == pytest.approx(harbour["run0"].states[:, 0], abs=1e-5)
    with pytest.raises(InputError, match="another folder with out=FOLDER, or force=True to replace that data set"):
        sb.import_log(log, tmp_path / "mapping.toml", tmp_path / "ship.toml", tmp_path / "trial")


@pytest.fixture(scope="module")
def shown(harbour, scores) -> dict[str, object]:
    """One object of each public kind, with long names and many parts."""
    from shipbench.api import Verdict
    from shipbench.bench.runner import Outcome
    from shipbench.diagnosis.result import Candidate, Cause, Estimate
    from shipbench.specs import parse_spec

    long = harbour.with_runs(
        [replace(run, id=f"{run.id} {'long ' * 14}", meta={"manoeuvre": f"{run.id} turn"}) for run in harbour]
    )
    cause = Cause(
        "current",
        1,
        30.0,
        0.001,
        {f"size{i}": Estimate(0.3, "m/s", (0.2, 0.4)) for i in range(60)},
        evidence="evidence " * 300,
    )
    candidate = Candidate("wind", 1.0, 0.5, "because " * 300)
    verdict = Verdict(
        "demo",
        "found",
        (cause,) * 20,
        (candidate,) * 40,
        (),
        {},
        "physics+current",
        "0" * 16,
        1.0,
        ("a warning " * 20,) * 20,
    )
    board = sb.build_board(scores.results, "small_harbour")
    task = sb.load_tasks(overrides={"models": [f"mlp[hidden={i}]" for i in range(200)]})[0]
    objects = [
        long,
        long[0],
        harbour.batch(10),
        harbour.ship,
        scores,
        scores.results,
        board,
        Outcome(Path("x" * 2000), None, [], []),
        task,
        cause,
    ]
    objects += [
        candidate,
        verdict,
        sb.check_data(harbour),
        parse_spec(f"mlp[hidden=8]{'+current' * 300}"),
        sb.make_predictor("physics+current"),
    ]
    objects += [sb.make_predictor(name) for name in ("hold", "mlp", "lstm", "neural_ode", "sklearn:Ridge")]
    return {f"{type(thing).__name__}{k}": thing for k, thing in enumerate(objects)}


def test_no_object_floods_a_notebook(shown):
    lengths = {name: len(repr(thing)) for name, thing in shown.items()}
    assert max(lengths.values()) <= 1000, lengths


def test_a_diagnosis_shows_its_verdict_in_words(shown):
    text = repr(next(thing for name, thing in shown.items() if name.startswith("Verdict")))
    assert "Diagnosis of demo" in text
    assert "current" in text
