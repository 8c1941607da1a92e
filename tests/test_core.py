"""Signals, records, registry, specs, ship: the parts everything stands on."""

from __future__ import annotations

import re

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.integrate import rk4_step
from shipbench.records import Dataset, Run
from shipbench.registry import Registry
from shipbench.ship import Propeller, Rudder, Ship, Thrusters, Wind, complete
from shipbench.signals import COMMANDS, STATES, UNITS, wrap_angle
from shipbench.specs import EffectSpec, parse_spec


def _run(name: str = "a", samples: int = 11, dt: float = 1.0, **meta) -> Run:
    t = np.arange(samples) * dt
    states = np.arange(samples)[:, None] + np.zeros((samples, 10))
    return Run(name, t, states, np.zeros((samples, 4)), COMMANDS, meta)


SHIP = Ship(name="s", L=100.0, B=16.0, T=6.0, displacement=6000.0)


def test_wrap_angle_maps_to_the_half_open_circle():
    np.testing.assert_allclose(wrap_angle([np.pi, -np.pi, 3 * np.pi, 0.1 - 2 * np.pi]), [np.pi, np.pi, np.pi, 0.1])


def test_every_signal_has_a_unit():
    assert set(STATES) | set(COMMANDS) <= set(UNITS)


@pytest.mark.parametrize(("steps", "windows"), [(10, 1), (11, 0), (5, 2), (4, 2)])
def test_the_number_of_windows_at_the_boundary(steps, windows):
    data = Dataset("d", SHIP, 1.0, (_run(),))
    if windows == 0:
        with pytest.raises(InputError, match="as long as the horizon"):
            data.windows(steps)
    else:
        assert len(data.windows(steps)) == windows


def test_windows_keep_their_metadata_and_name_their_parent():
    windows = Dataset("d", SHIP, 1.0, (_run(group="log1", split="test"),)).windows(5)
    assert [w.meta.as_dict() for w in windows.runs] == [{"group": "log1", "split": "test", "parent": "a"}] * 2
    assert windows.runs[1].t[0] == 5.0


def test_a_batch_gives_s0_then_the_samples_after_it():
    batch = Dataset("d", SHIP, 1.0, (_run(),)).batch(history=3)
    assert batch.s0[0, 0] == 3.0
    np.testing.assert_array_equal(batch.truth[0, :, 0], np.arange(4.0, 11.0))
    assert batch.U.shape == (1, 7, 4)
    assert batch.history is not None
    np.testing.assert_array_equal(batch.history[0][0, :, 0], [0.0, 1.0, 2.0])


@pytest.mark.parametrize(
    ("steps", "stride", "history"), [(0, None, 0), (-5, None, 0), (2.5, None, 0), (2, 0, 0), (2, -3, 0), (2, None, -1)]
)
def test_windows_of_no_whole_number_of_samples_are_refused(harbour, steps, stride, history):
    with pytest.raises(InputError, match=r"accepted: a whole number of samples"):
        harbour.windows(steps, stride, history)


@pytest.mark.parametrize("history", [-3, 1_000_000, 1.5])
def test_a_history_that_the_runs_do_not_have_is_refused(harbour, history):
    with pytest.raises(InputError, match=rf"history = {history}; accepted: 0 to 40 samples"):
        harbour.batch(history)


def test_a_sample_that_is_not_finite_is_named():
    states = np.zeros((5, 10))
    states[3, 4] = np.inf
    with pytest.raises(InputError, match=r"run 'x', t = 3 s: v is inf"):
        Run("x", np.arange(5.0), states, np.zeros((5, 4)))


@pytest.mark.parametrize("runs", [(), (_run("a"), _run("a")), (_run("a", dt=2.0),)])
def test_an_inconsistent_data_set_is_refused(runs):
    with pytest.raises(InputError, match=r"no runs|not unique|sampled at"):
        Dataset("d", SHIP, 1.0, runs)


def test_the_fingerprint_sees_every_sample():
    a, b = _run(), _run()
    b.states[7, 3] += 1e-12
    assert Dataset("d", SHIP, 1.0, (a,)).fingerprint != Dataset("d", SHIP, 1.0, (b,)).fingerprint
    assert Dataset("d", SHIP, 1.0, (a,)).fingerprint == Dataset("other", SHIP, 1, (_run(),)).fingerprint


def test_specs_of_every_form_are_read(tmp_path):
    assert parse_spec("mlp[hidden=64,seed=3]").params == {"hidden": 64, "seed": 3}
    assert [e.name for e in parse_spec("physics+current+wind").effects] == ["current", "wind"]
    several = parse_spec("physics[iterations=3]+current[speed=0.3,to=1.0]+bank_suction[line=1e+3]")
    assert several.params == {"iterations": 3}
    assert several.effects == (
        EffectSpec("current", {"speed": 0.3, "to": 1.0}),
        EffectSpec("bank_suction", {"line": 1000.0}),
    )
    assert parse_spec("a/b.py:Model[x=true]").class_name == "Model"
    assert parse_spec("a+c/b.py:Model+current").effects == (EffectSpec("current"),)
    saved = tmp_path / "physics+current[speed=0.3,to=1.0]"
    saved.mkdir()
    (saved / "model.json").write_text("{}")
    assert parse_spec(str(saved)).path == saved
    with pytest.raises(InputError, match="no value"):
        parse_spec("mlp[hidden]")
    with pytest.raises(InputError, match="cannot be read"):
        parse_spec("mlp[")


def test_listing_a_registry_imports_nothing_and_a_misspelling_is_met_with_a_suggestion():
    registry = Registry("predictor", "predictors", "PREDICTOR", frozenset({"base", "training"}))
    assert "lstm" in registry.names()
    assert "base" not in registry.names()
    with pytest.raises(InputError, match="Did you mean 'lstm'"):
        registry.get("lstn")


def test_what_a_ship_file_leaves_out_is_estimated_and_said_so():
    known = complete(SHIP)
    assert known.mass == 6000.0 * 1025.0
    assert known.Cb == pytest.approx(0.625)
    assert len(known.notes) >= 6
    assert all("from" in note for note in known.notes)
    assert known.lacks("propeller")
    assert not complete(SHIP.model_copy(update={"xG": 0.0})).lacks("xG")
    assert (known.x_bow, known.x_stern) == (0.4 * known.L, -0.4 * known.L)


def test_a_ship_that_contradicts_itself_is_refused():
    with pytest.raises(InputError, match="block coefficient"):
        complete(SHIP.model_copy(update={"Cb": 0.9}))


@pytest.mark.parametrize("wrong", [{"L": 12_000.0}, {"displacement": None, "mass": 6150.0}, {"displacement": 6.15e6}])
def test_a_ship_in_other_units_is_refused_with_the_figures(wrong):
    """Length in cm, mass in t, displacement in kg."""
    with pytest.raises(InputError, match=r"give a block coefficient of [0-9.e+-]+; hulls have"):
        complete(SHIP.model_copy(update=wrong))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"propeller": Propeller(diameter=4600.0)}, "propeller.diameter is 4600 m; accepted: up to 2 T = 12"),
        ({"rudder": Rudder(area=215.0)}, "rudder.area is 215 m^2; accepted: up to 0.15 L T = 90"),
        (
            {"rudder": Rudder(area=10.0, x=50.0)},
            "rudder.x is 50 m; accepted: -60 to 0 (from midship, forward positive)",
        ),
        ({"B": 6.0, "T": 16.0}, "L, B, T are 100, 6, 16 m; accepted: L >= B >= T"),
        ({"thrusters": Thrusters(x_bow=110.0, x_stern=10.0)}, "thrusters.x_bow is 110 m; accepted: -60 to 60"),
        ({"Izz": 6e6}, "Izz is 6e+06 kg m^2; accepted: 6.15e+08 to 1.54e+10"),
        (
            {"xG": 1e9, "Izz": 1.0},
            "xG is 1e+09 m; accepted: -60 to 60 (from midship, forward positive); Izz is 1 kg m^2",
        ),
        (
            {"propeller": Propeller(diameter=4.0, kt=(0.4, -0.3, 1e6))},
            "propeller.kt is [0.4, -0.3, 1000000.0]; accepted: -5 to 5 each",
        ),
        ({"rudder": Rudder(area=10.0, height=5000.0)}, "rudder.height is 5000 m; accepted: up to 2 T = 12"),
        (
            {"wind": Wind(frontal_area=3e8, lateral_area=1e9)},
            "wind.frontal_area is 3e+08 m^2; accepted: up to 10 B^2 = 2560; wind.lateral_area",
        ),
        (
            {"thrusters": Thrusters(max_force=6e8)},
            "thrusters.max_force is 6e+08 N; accepted: up to the weight of the ship, 6.033e+07",
        ),
    ],
    ids=[
        "diameter in mm",
        "area in square feet",
        "from the stern",
        "exchanged",
        "thrusters from the stern",
        "in t m^2",
        "two faults",
        "K_T",
        "span in mm",
        "areas in mm^2",
        "force",
    ],
)
def test_what_no_ship_has_is_refused_with_what_is_accepted(wrong, told):
    """A propeller in mm once ended in an OverflowError of the diagnosis, a rudder at the bow in `none`. It is refused
    where the file is read."""
    ship = SHIP.model_copy(update=wrong)
    with pytest.raises(InputError, match=re.escape(told)):
        complete(ship)
    with pytest.raises(InputError, match=re.escape(f"her.toml: ship 's': {told}")):
        Ship.from_dict(ship.model_dump(), "her.toml")


INF, NAN, HUGE = float("inf"), float("nan"), 10**400
NO_PARTICULARS: dict[str, dict[str, list]] = {
    "": {
        "L": ["100", True, INF, 1e300, HUGE],
        "T": [1e-300],
        "mass": [-1.0],
        "rho": [1.0],
        "xG": [NAN],
        "Cb": ["0.6"],
        "Izz": [INF],
        "name": [3],
    },
    "propeller": {"kt.0": [NAN, "1"], "pitch_ratio": [INF, 50.0], "blades": ["4", True, 3.5]},
    "rudder": {"height": [INF]},
    "wind": {"frontal_area": [INF]},
    "thrusters": {"max_force": [INF, "9"]},
}
NEEDED = {
    "": {},
    "propeller": {"diameter": 4.0},
    "rudder": {"area": 10.0},
    "wind": {"lateral_area": 1.0},
    "thrusters": {},
}


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [(t, k, v) for t, keys in NO_PARTICULARS.items() for k, values in keys.items() for v in values],
)
def test_text_truth_values_and_infinities_are_no_particulars(table, key, value):
    given = {**NEEDED[table], "kt": [value, 0, 0]} if key == "kt.0" else {**NEEDED[table], key: value}
    with pytest.raises(
        InputError, match=rf"^her.toml: {re.escape('.'.join(filter(None, (table, key))))}: .+ \(value: .+\)"
    ):
        Ship.from_dict(SHIP.model_dump(exclude_none=True) | ({table: given} if table else given), "her.toml")


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"displacment": 100.0}, "unknown key 'displacment'. Did you mean 'displacement'? Known: B,"),
        (
            {"propeller": {"diameter": 4.0, "pitch_ratoi": 0.8}},
            "[propeller] unknown key 'pitch_ratoi'. Did you mean 'pitch_ratio'? Known: area_ratio,",
        ),
    ],
)
def test_a_key_that_a_ship_file_does_not_know_is_told_with_those_it_knows(wrong, told):
    with pytest.raises(InputError, match=re.escape(f"her.toml: {told}")):
        Ship.from_dict(SHIP.model_dump(exclude_none=True) | wrong, "her.toml")


def wrong_run(t=None, states=None, inputs=None, **others) -> Run:
    given = {"id": "r1", "t": np.arange(4.0), "states": np.zeros((4, 10)), "inputs": np.zeros((4, 4))}
    return Run(
        **given | {k: v for k, v in {"t": t, "states": states, "inputs": inputs}.items() if v is not None} | others
    )


MASKED = np.ma.array(np.zeros((4, 10)), mask=np.eye(4, 10))
OBJECTS = np.zeros((4, 10), dtype=object)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"states": np.zeros((4, 9))}, r"states \(4, 9\)"),
        ({"states": np.zeros(4)}, r"states \(4,\)"),
        ({"states": [[0.0] * 10] * 3}, r"states \(3, 10\)"),
        ({"states": [[0.0] * 10, [0.0]]}, "states is no array"),
        ({"states": OBJECTS}, "states holds object"),
        ({"states": np.zeros((4, 10), dtype=bool)}, "states holds bool"),
        ({"states": np.zeros((4, 10), dtype=complex)}, "states holds complex128"),
        ({"states": np.full((4, 10), "1")}, "states holds <U1"),
        ({"states": MASKED}, "x is nan"),
        ({"states": np.full((4, 10), np.inf)}, r"x is inf \(40 such values"),
        ({"states": np.full((4, 10), 1e308)}, "at most 1e.12"),
        ({"inputs": np.full((4, 4), np.nan)}, "n_c is nan"),
        ({"inputs": np.zeros((4, 5))}, r"inputs \(4, 5\)"),
        ({"inputs": None, "inputs_names": ("a", "b", "c", "d")}, "inputs_names are"),
        ({"inputs": np.zeros((4, 5)), "inputs_names": (*COMMANDS, "n_c")}, "inputs_names are"),
        ({"t": np.zeros((4, 1))}, r"t has the shape \(4, 1\)"),
        ({"t": [0.0, 1.0, np.nan, 3.0]}, "t goes from 1 s to nan s"),
        ({"t": np.arange(4.0)[::-1]}, "t goes from 3 s to 2 s"),
        ({"t": np.zeros(4)}, "t goes from 0 s to 0 s"),
        ({"t": [0.0, 1.0, 2.5, 3.5]}, "t goes from 1 s to 2.5 s; accepted: t that grows by the same step, 1 s here"),
        ({"t": ["a", "b", "c", "d"]}, "t holds <U1"),
        ({"t": [], "states": np.zeros((0, 10)), "inputs": np.zeros((0, 4))}, "one sample at least"),
    ],
)
def test_a_run_of_wrong_arrays_is_refused_with_its_name(wrong, told):
    with pytest.raises(InputError, match=rf"run 'r1'.*{told}"):
        wrong_run(**wrong)


def test_a_run_takes_whatever_holds_real_numbers():
    run = wrong_run(t=[0, 1, 2, 3], states=np.zeros((4, 10), dtype=np.int32), inputs=np.ones((4, 4), dtype=np.float32))
    assert (run.dt, run.states.dtype, run.inputs.dtype) == (1.0, np.dtype(float), np.dtype(float))
    states = np.zeros((4, 10))
    assert wrong_run(states=states).states is states


@pytest.mark.parametrize(
    ("wrong", "told"),
    [({"dt": -1.0}, "dt = -1"), ({"dt": np.nan}, "dt = nan"), ({"dt": "1"}, "dt = '1'"), ({"dt": True}, "dt = True"),
     ({"dt": 2.0}, "run 'r1' is sampled"), ({"runs": ()}, "no runs"), ({"runs": (3,)}, "runs holds int")],
)  # fmt: skip
def test_a_data_set_of_wrong_parts_is_refused(wrong, told):
    with pytest.raises(InputError, match=told):
        Dataset(**{"name": "d", "ship": SHIP, "dt": 1.0, "runs": (wrong_run(),)} | wrong)


def test_rk4_is_of_fourth_order_on_an_oscillator():
    def error(h: float) -> float:
        state = (1.0, 0.0)
        for _ in range(round(1.0 / h)):
            state = rk4_step(lambda s, _: (s[1], -s[0]), state, h)
        return abs(state[0] - np.cos(1.0))

    assert np.log2(error(0.1) / error(0.05)) == pytest.approx(4.0, abs=0.2)
