"""Code written for nonlinear_benchmarks, with shipbench's data and models, against shipbench's own study."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from nonlinear_benchmarks import Input_output_data
from nonlinear_benchmarks.error_metrics import RMSE

from shipbench.adapters.nonlinear_benchmarks import InputOutputModel, from_records, ship_benchmark, to_records
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.data.base import load_dataset
from shipbench.data.files import write_dataset
from shipbench.errors import InputError


@pytest.mark.parametrize("history_s", [0.0, 5.0])
def test_the_figures_are_those_of_a_study(toy, tmp_path, history_s):
    """A loop in their style, with their metric, over the same fold."""
    write_dataset(toy(runs=6, steps=40), tmp_path / "toy")
    folder = str(tmp_path / "toy")
    train, test = ship_benchmark(folder, fold=1, folds=2, horizon_s=20.0, history_s=history_s)
    model = InputOutputModel("sklearn:Ridge", load_dataset(folder).ship).fit(train)
    theirs = {}
    for record in test:
        n = record.state_initialization_window_length
        y_model = model.simulate(record.u, record.y[:n])
        assert y_model.shape == record.y.shape
        theirs[record.name] = float(np.sqrt((RMSE(record, y_model)[:2] ** 2).sum()))
    settings = {"dataset": folder, "models": ["sklearn:Ridge"], "folds": 2, "horizon_s": 20.0, "history_s": history_s}
    task = make_task({**settings, "metrics": ["ed", "position_rmse"]})
    rows = run_tasks([task], tmp_path / "out").rows
    ours = rows[rows["fold"] == 1].set_index("run")["position_rmse"].to_dict()
    assert theirs.keys() == ours.keys()
    assert list(theirs.values()) == pytest.approx(list(ours.values()), rel=1e-9)


def test_a_record_has_their_shape_and_is_a_copy(toy):
    data = toy(runs=4)
    (first, *_), window = to_records(data, window=3), 3
    assert isinstance(first, Input_output_data)
    assert (first.u.shape, first.y.shape, first.sampling_time, first.name) == ((21, 4), (21, 10), 1.0, "r00")
    assert first.state_initialization_window_length == window
    first.y[:] = 0.0
    assert np.abs(data.runs[0].states).max() > 0.0


def test_there_and_back_is_the_same_data(toy):
    data = toy(runs=4)
    assert from_records(to_records(data), data.ship).fingerprint == data.fingerprint


def test_fewer_channels_are_filled_and_said_so(toy):
    data = toy(runs=4)
    outputs, inputs = ("u", "v", "r", "x", "y", "psi"), ("delta_c", "n_c")
    picked = [Input_output_data(r.inputs[:, [1, 0]], r.states[:, [3, 4, 5, 0, 1, 2]], 1.0, r.id) for r in data.runs]
    back = from_records(picked, data.ship, outputs=outputs, inputs=inputs)
    np.testing.assert_array_equal(back.runs[2].states[:, :6], data.runs[2].states[:, :6])
    np.testing.assert_array_equal(back.runs[2].inputs[:, :2], data.runs[2].inputs[:, :2])
    assert "delta is not in y: taken from delta_c" in back.notes
    assert "F_b_c is not in u: taken as zero" in back.notes
    model = InputOutputModel("hold", data.ship, outputs=outputs, inputs=inputs).fit(picked)
    assert model.simulate(picked[0].u, picked[0].y[:4]).shape == picked[0].y.shape


def test_what_is_known_is_returned_and_the_next_sample_is_predicted(toy):
    data = toy(runs=4)
    record = to_records(data)[0]
    y = InputOutputModel("hold", data.ship).fit(to_records(data)).simulate(record.u, record.y[:5])
    np.testing.assert_array_equal(y[:5], record.y[:5])
    np.testing.assert_array_equal(y[5:, 3], record.y[4, 3])  # hold keeps the speed of the last sample that it was given


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"outputs": ("u", "v", "r")}, "x, y, psi is missing"), ({"outputs": ("u", "w")}, "unknown channel 'w'"),
        ({"inputs": ("n_c",)}, "accepted: 10 outputs .* 1 inputs"),
    ],
)  # fmt: skip
def test_columns_that_do_not_fit_are_named(toy, change, says):
    with pytest.raises(InputError, match=says):
        from_records(to_records(toy(runs=2)), toy(runs=2).ship, **change)


def test_wrong_use_is_told(toy, monkeypatch):
    data = toy(runs=4)
    records = to_records(data)
    with pytest.raises(InputError, match="before fit"):
        InputOutputModel("hold", data.ship).simulate(records[0].u, records[0].y[:1])
    with pytest.raises(InputError, match="y_init has 0 samples"):
        InputOutputModel("hold", data.ship).fit(records).simulate(records[0].u, records[0].y[:0])
    with pytest.raises(InputError, match="one time"):
        from_records([records[0], Input_output_data(records[1].u, records[1].y, 2.0)], data.ship)
    with pytest.raises(InputError, match="fold = 9"):
        ship_benchmark(data, fold=9, folds=2, horizon_s=10.0)
    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", None)
    with pytest.raises(InputError, match=r"pip install 'shipbench\[nonlinear-benchmarks\]'"):
        to_records(data)
