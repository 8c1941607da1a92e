"""Simulated twins: what they share with the trial, which ones are refused, and which of them train which model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

import shipbench as sb
from shipbench.bench.runner import Memory, run_tasks
from shipbench.bench.submissions import read_results
from shipbench.bench.task import TrainOn, make_task
from shipbench.bench.twins import check_twins, mean_distance, simulate_like, write_twin
from shipbench.data.files import read_dataset
from shipbench.errors import InputError, ShipbenchError, WorkError
from shipbench.leaderboard.pages import build_board
from shipbench.leaderboard.verify import verify
from shipbench.records import Dataset
from shipbench.signals import ACTUATORS, PSI
from shipbench.specs import spec_of

ALL: tuple[TrainOn, ...] = ("measured", "simulated", "simulated+measured")


def turn(s0, U, dt):
    """Turns to starboard at constant speed, heading from -pi to pi; its rudder is 1 rad."""
    t = dt * np.arange(1, U.shape[-2] + 1)
    S = np.repeat(s0[..., None, :], len(t), axis=-2)
    S[..., 0] += t * s0[..., None, 3]
    S[..., PSI] = np.mod(S[..., PSI] + 0.3 * t + np.pi, 2 * np.pi) - np.pi
    S[..., 7] = 1.0
    return S


def lost(s0, U, dt):
    return np.full((*U.shape[:-1], 10), np.inf)


def in_degrees(s0, U, dt):
    S = np.repeat(s0[..., None, :], U.shape[-2], axis=-2)
    S[..., PSI] = np.rad2deg(S[..., PSI] + 1.0)
    return S


def breaks(s0, U, dt):
    raise ZeroDivisionError("no speed")


@dataclass
class Seen:
    """Holds the state; notes every fit in `fits`, a list that copies share by being the class's own."""

    learns: bool = True
    fits: ClassVar[list[Any]] = []

    def fit(self, train, valid=None, *, seed=0):
        self.fits.append((self, getattr(self, "warm_start", None), train, valid))
        return self

    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1], axis=1)


class Warm(Seen):
    def __init__(self):
        super().__init__()
        self.warm_start = False


class WarmTogether(Warm):
    @classmethod
    def fit_group(cls, models, trains, valids, seeds):
        for parts in zip(models, trains, valids, seeds, strict=True):
            parts[0].fit(*parts[1:3], seed=parts[3])


@pytest.fixture
def trial(toy):
    return toy(runs=12, meta=lambda i: {"group": f"log{i // 2}", "manoeuvre": "zigzag"}, source="bridge", licence="CC0")


@pytest.fixture
def twin(trial):
    return simulate_like(turn, trial)


@pytest.fixture
def study(trial, twin, tmp_path):
    """Runs models in memory on the trial and its twin; `fits` are those that `Seen` noted."""
    Seen.fits.clear()

    def run(*models, twin=twin, resume=False, out="out", **task):
        specs = {spec.text: spec for spec in map(spec_of, models)}
        own = {"dataset": "toy", "models": list(specs), "horizon_s": 20, "folds": 3, "simulated": twin.name}
        memory = Memory({"toy": trial, twin.name: twin}, {k: s for k, s in specs.items() if s.given is not None})
        return run_tasks([make_task({**own, **task})], tmp_path / out, resume=resume, memory=memory)

    return run


def test_a_twin_has_the_starts_the_inputs_and_the_metadata_of_the_trial(trial, twin):
    assert (twin.name, twin.licence, twin.ship, twin.dt) == ("toy-simulated", "CC0", trial.ship, trial.dt)
    assert twin.source == f"Simulated by turn from starts and inputs of 'toy' (fingerprint {trial.fingerprint}). bridge"
    assert twin.notes[-1] == "simulated by turn, not measured"
    for ours, theirs in zip(twin, trial, strict=True):
        assert (ours.id, ours.group, ours.kind) == (theirs.id, theirs.group, theirs.kind)
        assert np.array_equal(ours.inputs, theirs.inputs)
        assert np.array_equal(ours.t, theirs.t)
        assert np.array_equal(ours.states[0], theirs.states[0])
        assert np.allclose(np.diff(ours.states[:, PSI]), 0.3)  # continuous, though the simulator's is not
        assert (ours.states[1:, 7] == 1.0).all()
    assert mean_distance(twin, trial) > 1.0
    check_twins(twin, trial)


def test_runs_of_different_lengths_and_an_object_with_simulate(toy):
    data = toy(runs=4)
    data = data.with_runs([data[0].slice(0, 1), data[1].slice(0, 5), *data.runs[2:]])
    assert [len(run) for run in simulate_like(turn, data)] == [1, 5, 21, 21]


def test_commanded_actuators_repeat_the_commands_in_the_twin_too(toy):
    data = toy(actuators="commanded")
    for ours, theirs in zip(simulate_like(turn, data), data, strict=True):
        assert np.array_equal(ours.states[:, ACTUATORS], theirs.states[:, ACTUATORS])


def test_a_twin_on_disk_is_the_same_and_replaces_no_other_data(trial, twin, tmp_path):
    write_twin(twin, tmp_path / "twin")
    again = read_dataset(tmp_path / "twin")
    assert again.fingerprint == twin.fingerprint
    assert [run.group for run in again] == [run.group for run in trial]
    check_twins(again, trial)
    write_twin(twin, tmp_path / "twin")
    with pytest.raises(InputError, match="holds the data set 'toy-simulated'; accepted: a new folder"):
        write_twin(replace(twin, name="other-simulated"), tmp_path / "twin")


@pytest.mark.long
def test_a_saved_model_the_particulars_and_a_file_make_twins(harbour, tmp_path):
    data = harbour[:3]
    sb.make_predictor("hold").fit(data).save(tmp_path / "saved")
    (tmp_path / "sim.py").write_text("from helper import go\n\ndef simulate(s0, U, dt):\n    return go(s0, U)\n")
    (tmp_path / "helper.py").write_text(
        "import numpy as np\n\ndef go(s0, U):\n    return s0[:, None] + 0 * U[..., :1]\n"
    )
    for spec in (str(tmp_path / "saved"), "hold", "physics", "oracle", f"{tmp_path}/sim.py:simulate"):
        check_twins(sb.simulate_like(spec, data), data)
    assert mean_distance(sb.simulate_like("oracle", data), data) < mean_distance(
        sb.simulate_like("physics", data), data
    )


@pytest.mark.parametrize(
    ("model", "error", "message"),
    [
        (
            "calibrated",
            InputError,
            "'calibrated' must be fitted before it can simulate. Accepted: a saved model",
        ),
        ("physics+current", InputError, "'physics\\+current' must be fitted"),
        (Seen(), InputError, "'Seen' must be fitted"),
        ("oracle", InputError, "'oracle' cannot simulate these runs: data set 'toy' was not made by this simulator"),
        (lost, WorkError, "lost diverges in run 'r00': x is inf 1 s after the start"),
        (in_degrees, InputError, r"the states of in_degrees are no twin of 'toy': headings at the start differ"),
        (breaks, WorkError, r"breaks fails on 12 runs \(r00, r01, r02\): .*ZeroDivisionError: no speed"),
    ],
)
def test_what_cannot_simulate_is_one_message(trial, model, error, message):
    with pytest.raises(error, match=message) as caught:
        simulate_like(model, trial)
    assert isinstance(caught.value, ShipbenchError)


def _changed(twin: Dataset, **parts) -> Dataset:
    return twin.with_runs([*twin.runs[:-1], replace(twin.runs[-1], **parts)])


def test_a_wrong_twin_is_one_message(trial, twin):
    last = twin.runs[-1]
    U, S = last.inputs.copy(), last.states.copy()
    U[3, 1] += 0.1
    S[0, 3] += 0.1
    slow = [replace(run, t=2 * run.t) for run in twin]
    wrong = [
        (trial, "its states are the measured ones"),
        (twin[:5], "it lacks 7 of 12 runs, such as 'r05'"),
        (replace(twin, ship=twin.ship.model_copy(update={"L": 60.0})), "its ship is 'toy' with other particulars"),
        (replace(twin, dt=2.0, runs=tuple(slow)), "it is sampled at 2 s, the trial at 1 s"),
        (replace(twin, actuators="commanded"), "its actuators are commanded, those of the trial measured"),
        (_changed(twin, inputs=U), "1 of 12 runs differ: 'r11' has other inputs"),
        (_changed(twin, states=S), "1 of 12 runs differ: 'r11' has another start"),
        (_changed(twin, t=last.t + 1.0), "1 of 12 runs differ: 'r11' has other times"),
        (twin.with_runs([*twin.runs[:-1], last.slice(0, 9)]), "'r11' has 9 samples, 21 in the trial"),
    ]
    for other, message in wrong:
        with pytest.raises(InputError) as caught:
            check_twins(other, trial)
        assert message in str(caught.value)
        assert "shipbench data simulate MODEL --like TRIAL" in str(caught.value)


def test_a_wrong_twin_stops_the_study_before_anything_is_fitted(study, twin):
    with pytest.raises(InputError, match="is no twin of data set 'toy': it lacks"):
        study(Seen(), twin=twin[:5])
    assert not Seen.fits


def test_twins_of_training_runs_train_and_no_twin_of_a_scored_run_does(study, trial, twin):
    outcome = study(Seen())
    assert [(s["model"], s["train_on"]) for s in outcome.summaries[::3]] == [
        ("Seen", "measured"), ("Seen (simulated)", "simulated"), ("Seen (simulated+measured)", "simulated+measured"),
    ]  # fmt: skip
    for summary, (_, _, train, valid) in zip(outcome.summaries, Seen.fits, strict=True):
        runs, scored = summary["runs"], set(summary["runs"]["test"])
        groups = {trial[i].group for i in scored}
        assert not {run.parent for run in (*train, *valid)} & scored
        assert not {run.group for run in (*train, *valid)} & groups
        of = {"measured": [trial], "simulated": [twin], "simulated+measured": [trial, twin]}[summary["train_on"]]
        expected = [source[i].states for source in of for i in runs["train"]]
        assert all(np.array_equal(a.states, b) for a, b in zip(train, expected, strict=True))
        assert all(np.array_equal(run.states, of[0][i].states) for run, i in zip(valid, runs["valid"], strict=True))
    errors = outcome.rows.groupby("model")["ed"].mean()
    assert errors.nunique() == 1  # the same measured runs are scored


@pytest.mark.parametrize("kind", [Warm, WarmTogether])
def test_a_model_with_a_warm_start_is_trained_on_the_twins_first(study, trial, twin, kind):
    outcome = study(kind, train_on=["simulated+measured"])
    assert not outcome.failed
    assert len(Seen.fits) == 6
    by_model: dict[int, list] = {}
    for fit in Seen.fits:
        by_model.setdefault(id(fit[0]), []).append(fit)
    assert len(by_model) == 3
    for first, second in by_model.values():
        assert [np.array_equal(run.states, twin[run.id].states) for run in first[2]] == [True] * len(first[2])
        assert [np.array_equal(run.states, trial[run.id].states) for run in second[2]] == [True] * len(second[2])
        assert [run.id for run in first[2]] == [run.id for run in second[2]]
        assert second[1] is True
    assert "Warm" in outcome.summaries[0]["notes"][-1]
    assert "trained on the simulated runs, then on the measured ones" in outcome.summaries[0]["notes"][-1]


def test_a_model_that_learns_nothing_has_one_row(study):
    outcome = study("hold", turn, Seen())
    assert list(dict.fromkeys(s["model"] for s in outcome.summaries))[:3] == ["hold", "turn", "Seen"]
    assert len({s["model"] for s in outcome.summaries}) == 5
    notes = outcome.summaries[0]["notes"]
    assert "hold, turn: not fitted, one row for every choice of training runs" in notes
    assert "(simulated+measured) Seen: fitted on both together, since they have no warm start" in notes


def test_results_are_read_back_verified_and_not_mixed_with_those_of_another_twin(study, trial, tmp_path):
    out = tmp_path / "out"
    outcome = study("hold", "physics[iterations=0]", train_on=["measured", "simulated"])
    back = read_results([out])
    assert set(back.rows["model"]) == {"hold", "physics[iterations=0]", "physics[iterations=0] (simulated)"}
    assert verify(back)[0] == []
    assert {s["simulated"]["fingerprint"] for s in outcome.summaries} == {simulate_like(turn, trial).fingerprint}
    study("physics[iterations=1]", twin=simulate_like("hold", trial), train_on=["simulated"], out="other")
    with pytest.raises(InputError, match="different tasks"):
        build_board(read_results([out, tmp_path / "other"]), "toy")


def test_resume_keeps_the_cells_of_the_same_twin_only(study, trial, tmp_path):
    out = tmp_path / "out"
    study("hold", "physics[iterations=0]", train_on=["simulated"])
    before = {p: p.stat().st_mtime_ns for p in out.glob("cells/*/*/*/summary.json")}
    study("hold", "physics[iterations=0]", train_on=["simulated"], resume=True)
    assert {p: p.stat().st_mtime_ns for p in out.glob("cells/*/*/*/summary.json")} == before
    study("hold", "physics[iterations=0]", train_on=["simulated"], resume=True, twin=simulate_like("hold", trial))
    after = {p: p.stat().st_mtime_ns for p in out.glob("cells/*/*/*/summary.json")}
    assert all(after[p] > before[p] for p in before)


def test_benchmark_takes_a_twin_in_memory_or_its_folder(trial, twin, tmp_path):
    options: dict[str, Any] = {"horizon": 20, "folds": 2, "quiet": True}
    scores = sb.benchmark([Seen(), "hold"], trial, simulated=twin, **options)
    assert set(scores.results.rows["model"]) == {"hold", *("Seen", "Seen (simulated)", "Seen (simulated+measured)")}
    sb.simulate_like(turn, trial, out=tmp_path / "twin")
    again = sb.benchmark([Seen(), "hold"], trial, simulated=tmp_path / "twin", train_on=["simulated"], **options)
    assert set(again.results.rows["model"]) == {"hold", "Seen (simulated)"}
    with pytest.raises(InputError, match="its states are the measured ones"):
        sb.benchmark("hold", trial, simulated=trial, **options)


def test_twins_of_long_runs_are_cut_like_the_measured_runs(toy):
    data = toy(runs=4, steps=65)
    Seen.fits.clear()
    sb.benchmark(Seen(), data, simulated=simulate_like(turn, data), horizon=20, folds=2, quiet=True, history_s=5)
    measured, simulated = Seen.fits[0], Seen.fits[2]
    assert [run.id for run in measured[2]] == [run.id for run in simulated[2]]
    assert [run.t.tolist() for run in measured[2]] == [run.t.tolist() for run in simulated[2]]
    assert len({run.id for run in measured[2]}) > len({run.parent for run in measured[2]})
