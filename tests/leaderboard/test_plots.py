"""Plots: drawn from saved predictions, with every model that has a score and none that has not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from toy_ship import write_toy_folder

from shipbench.bench.runner import run_tasks
from shipbench.bench.submissions import read_results
from shipbench.bench.task import make_task
from shipbench.leaderboard.plots import (
    against_horizon,
    boxes,
    choose_runs,
    draw_all,
    outline,
    short_name,
    style,
    tracks,
)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    data = write_toy_folder(folder / "toy", 10, 20)
    (folder / "m.py").write_text(
        "import numpy as np\n"
        "class Still:\n"
        "    def fit(self, train, valid=None, *, seed=0): return self\n"
        "    def predict(self, s0, U, history=None): return np.repeat(s0[:, None], U.shape[1], axis=1)\n"
        "class Fails(Still):\n"
        "    def predict(self, s0, U, history=None): raise ValueError('no')\n"
    )
    models = ["hold", f"{folder}/m.py:Still", f"{folder}/m.py:Fails"]
    run_tasks([make_task({"dataset": str(data), "models": models, "horizon_s": 20, "folds": 2})], folder / "out")
    return read_results([folder / "out"]), models


def test_every_plot_is_a_png_of_some_size(study, tmp_path):
    results, models = study
    paths = draw_all(results, "toy", models, tmp_path / "plots")
    assert [p.name for p in paths] == ["tracks.png", "errors.png", "error-against-horizon.png"]
    for path in paths:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size > 10_000
    assert len(list((tmp_path / "plots").iterdir())) == 3


def test_tracks_show_the_true_run_and_every_scored_model(study):
    results, models = study
    figure = tracks(results, "toy", models[:2], results.summaries[0])
    assert len(figure.axes) == 3
    for axis in figure.axes:
        labels = [text.get_text() for text in axis.get_legend().get_texts()]
        assert labels[0] == "true"
        assert [label.split(" (ED")[0] for label in labels[1:]] == ["hold", "m.py:Still"]
        assert axis.get_xlabel() == "east y [m]"
        run = axis.get_title().split(": ")[1]
        error = results.rows[(results.rows.run == run) & (results.rows.model == "hold")]["ed"].iloc[0]
        assert f"hold (ED {error:.3g} m)" in labels


def test_error_against_horizon_ends_at_the_median_final_displacement(study):
    results, _ = study
    axis = against_horizon(results, "toy", ["hold"], 1.0).axes[0]
    rows = results.rows[results.rows.model == "hold"]
    line = axis.lines[0]
    assert line.get_xdata()[-1] == 20
    assert line.get_ydata()[-1] == pytest.approx(rows["final_displacement"].median())


def test_box_plots_have_a_panel_with_unit_for_each_metric_of_table_iii(study):
    results, models = study
    figure = boxes(results.rows, models[:2], results.summaries[0])
    assert [a.get_ylabel() for a in figure.axes] == ["ED [m]", "EDH [m]", "cVDM [%]"]


def test_chosen_runs_are_good_median_and_bad_by_the_models_and_not_by_the_floor():
    errors = {f"r{i}": float(i) for i in range(11)}
    rows = pd.DataFrame(
        [
            {"run": r, "model": m, "status": "ok", "ed": e if m == "a" else 100 - e}
            for r, e in errors.items()
            for m in ("a", "hold")
        ]
    )
    assert choose_runs(rows, ["a", "hold"]) == {"good": "r1", "median": "r5", "bad": "r9"}


def test_the_outline_points_its_bow_along_the_heading():
    corners = outline(x=100.0, y=10.0, psi=np.pi / 2, L=40.0, B=6.0)  # heading east
    np.testing.assert_allclose(corners[0], [30.0, 100.0], atol=1e-12)
    assert np.ptp(corners[:, 0]) == pytest.approx(40.0)
    assert np.ptp(corners[:, 1]) == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("spec", "name"),
    [("mlp[epochs=3]", "mlp[epochs=3]"), ("a/b/model.py:Mine", "model.py:Mine"), ("m" * 40, "m" * 25 + "...")],
)
def test_names_in_legends_stay_short(spec, name):
    assert short_name(spec) == name


def test_models_have_colours_of_their_own_and_known_ones_keep_theirs():
    styles = style(["physics", "mlp", "mine", "physics+current"])
    assert styles["physics"] == style(["physics"])["physics"]
    assert len({s["color"] for s in styles.values()}) == 4
