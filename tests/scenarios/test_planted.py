"""Every planted fault is found, its lines heal it, a second check and clean sets are silent. `shipbench suite check`
does it on more sets."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from every_day import every

from shipbench.checking.base import check_dataset, check_path
from shipbench.data.files import read_dataset
from shipbench.errors import InputError
from shipbench.physics.mmg import load_mmg_ship
from shipbench.signals import DELTA, PSI, STATES, N, R, U, V, X, Y
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.checks.clean_sets import EQUATION, SHIPS, base_set, clean_sets
from shipbench.suites.checks.faults import FAULTS, Fault
from shipbench.suites.checks.outcome import Outcome
from shipbench.suites.checks.suite import apply_lines, run_case, write_planted

SEED = 311  # neither one on which thresholds were set nor one that the suite reports
SHIP = "kcs"
BY_NAME = {fault.name: fault for fault in FAULTS}


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Callable[[str], tuple[Outcome, Path]]:
    """What came of a fault, and its folder with the lines of the check in dataset.toml; each is made once."""
    root, made = tmp_path_factory.mktemp("planted"), {}

    def get(name: str) -> tuple[Outcome, Path]:
        if name not in made:
            made[name] = run_case(BY_NAME[name], SHIP, SEED, root / str(len(made)))
        return made[name], root / str(list(made).index(name))

    return get


@pytest.mark.parametrize("name", every(10, BY_NAME))
def test_a_planted_fault_is_found_and_healed(name: str, case):
    outcome, _ = case(name)
    assert outcome.found
    assert outcome.others == ()
    assert outcome.healed is not False, outcome.after


@pytest.mark.parametrize("source", [*SHIPS, EQUATION])
def test_a_clean_set_gives_no_finding(source: str):
    assert check_dataset(base_set(source, SEED)) == []


def test_a_clean_set_gives_no_finding_from_its_files(tmp_path):
    _, found = check_path(str(write_planted(base_set(SHIP, SEED), None, SEED, tmp_path / "set")))
    assert found == []


@pytest.mark.parametrize(
    "kind", ["MMG ships, no noise, calm", "MMG ships, wind recorded", "MMG ships under real effects"]
)
def test_what_is_real_is_no_fault(kind: str):
    make = [make for k, make in clean_sets([SEED]) if k == kind][-1]
    assert check_dataset(replace(make(), simulation=None)) == []


@pytest.mark.long
@pytest.mark.parametrize(
    "kind", ["MMG ships, rounded", pytest.param("port manoeuvres, rounded", marks=pytest.mark.long)]
)
def test_values_that_repeat_themselves_for_their_last_digit_are_no_fault(kind: str):
    """Where there is little noise, a yaw rate in steps of a degree a minute stands still for half a minute, and runs
    agree for some samples."""
    for make in [make for k, make in clean_sets([SEED]) if k == kind]:
        assert check_dataset(replace(make(), simulation=None)) == []


@pytest.mark.parametrize("channels", [("r",), ("psi",), ("x", "y")])
def test_what_stands_still_in_a_rounded_record_is_found(channels: tuple[str, ...]):
    data = [make for k, make in clean_sets([SEED]) if k == "MMG ships, rounded"][2]()  # KCS, as instruments have it
    run = max(data.runs, key=lambda run: np.ptp(run.states[:, R]))
    at = int(np.argmax([np.ptp(run.states[a : a + 20, R]) for a in range(len(run) - 20)]))
    states = run.states.copy()
    states[at : at + 20, [STATES.index(c) for c in channels]] = states[at, [STATES.index(c) for c in channels]]
    found = check_dataset(data.with_runs([replace(run, states=states) if r.id == run.id else r for r in data.runs]))
    assert [(f.kind, f.channels, f.runs) for f in found] == [("frozen", channels, (run.id,))]


@pytest.mark.long
@pytest.mark.parametrize("seed", [4, 5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_side_of_the_rudder_shows_in_a_single_log(sign: float, seed: int):
    data = sea_trials(load_mmg_ship(SHIP), seed, (), Trials(runs=1, samples=1200))
    states, inputs = data.runs[0].states.copy(), data.runs[0].inputs.copy()
    states[:, DELTA] *= sign
    inputs[:, data.inputs.index("delta_c")] *= sign
    found = check_dataset(data.with_runs([replace(data.runs[0], states=states, inputs=inputs)]))
    assert [(f.kind, f.channels) for f in found] == ([] if sign > 0.0 else [("sign", ("delta",))])


def test_a_rudder_that_answers_the_motion_on_a_straight_course_does_not_seem_to_lie_on_the_other_side():
    """A ship of Nomoto's first order in gusts and waves, whose autopilot works against the yaw rate: just after a
    rudder she turns against it."""
    rng = np.random.default_rng(SEED)
    S = np.zeros((3600, len(STATES)))
    gust = psi = r = delta = 0.0
    for k, state in enumerate(S):
        gust += -gust / 20.0 + 0.001 * rng.normal()
        r += (0.06 * delta + gust - r) / 25.0
        psi += r
        delta += 0.4 * (-0.5 * psi - 40.0 * r - delta)
        state[[PSI, U, R, N, DELTA]] = psi, 7.0, r + 0.002 * np.sin(0.45 * k), 100.0, delta
    S[:, X], S[:, Y] = np.cumsum(7.0 * np.cos(S[:, PSI])), np.cumsum(7.0 * np.sin(S[:, PSI]))
    data = base_set(SHIP, SEED)
    logs = [
        replace(data.runs[0], id=f"log{i}", t=np.arange(300.0), states=part, inputs=part[:, N:])
        for i, part in enumerate(np.split(S, 12))
    ]
    assert np.rad2deg(np.std(S[:, DELTA])) > 1.0
    assert "sign" not in [f.kind for f in check_dataset(data.with_runs(logs))]


@pytest.mark.parametrize(
    "name", every(5,
    ["heading in degrees", "heading in degrees, 0 to 360", "rudder in degrees", "yaw rate in deg/min",
        "speeds in knots", "revolutions in rev/s",
     "rudder sign", "west positive", "x east, y north", "ENU, v and r ours", "heading from east",
     "velocities north, east", "velocities east, north"]),
)  # fmt: skip
def test_healed_gross_errors_give_the_clean_samples(name: str, case):
    clean, loaded = base_set(SHIP, SEED), read_dataset(case(name)[1])
    for a, b in zip(clean.runs, loaded.runs, strict=True):
        turn = 2.0 * np.pi * np.round((b.states[0, PSI] - a.states[0, PSI]) / (2.0 * np.pi))
        np.testing.assert_allclose(
            b.states - turn * (np.arange(len(STATES)) == PSI), a.states, rtol=1e-5, atol=1e-6 * np.max(np.abs(a.states))
        )


@pytest.mark.parametrize("name", every(3, [n for n, fault in BY_NAME.items() if fault.wind]))
def test_healed_wind_is_the_true_one(name: str, case):
    clean, loaded = base_set(SHIP, SEED, wind=True), read_dataset(case(name)[1])
    for a, b in zip(clean.runs, loaded.runs, strict=True):
        true, read = (run.inputs[:, -2] * np.exp(1j * run.inputs[:, -1]) for run in (a, b))
        np.testing.assert_allclose(read, true, atol=1e-6)


@pytest.mark.parametrize(
    ("wrong", "right"), [({"wind": "apparent"}, "wind = "), ({"signs": {"wind_from": "to"}}, "clockwise")]
)
def test_a_declaration_that_makes_the_wind_wrong_is_what_the_finding_speaks_of(wrong: dict, right: str, tmp_path):
    folder = write_planted(
        base_set(SHIP, SEED, wind=True), Fault("declared", lambda p: p.toml.update(wrong), []), SEED, tmp_path / "set"
    )
    (finding,) = check_path(str(folder))[1]
    assert finding.channels[-1] == "wind_from"
    assert right in finding.line + finding.todo


def test_a_kind_of_wind_without_a_wind_is_refused(tmp_path):
    folder = write_planted(
        base_set(SHIP, SEED), Fault("declared", lambda p: p.toml.update(wind="apparent"), []), SEED, tmp_path / "set"
    )
    with pytest.raises(InputError, match="needs the columns wind_speed and wind_from"):
        read_dataset(folder)


@pytest.mark.parametrize(
    ("name", "channel", "within"),
    [
        ("speeds 8 % high", U, 0.08),
        ("heading bias", PSI, np.deg2rad(0.5)),
        ("yaw rate bias", R, np.deg2rad(0.01)),
        ("speeds through water", V, 0.12),
    ],
)
def test_healed_biases_are_the_clean_samples_to_within_their_error(name: str, channel: int, within: float, case):
    clean, loaded = base_set(SHIP, SEED), read_dataset(case(name)[1])
    off = np.concatenate(
        [b.states[:, channel] - a.states[:, channel] for a, b in zip(clean.runs, loaded.runs, strict=True)]
    )
    assert np.sqrt(np.mean(off**2)) < within


@pytest.mark.parametrize(
    ("name", "channel", "seconds"), [("yaw rate late", R, 3.0), ("position late", X, 3.0), ("rudder late", DELTA, 5.0)]
)
def test_healed_lags_are_the_planted_ones(name: str, channel: int, seconds: float, case):
    delay = tomllib.loads((case(name)[1] / "dataset.toml").read_text())["delay"]
    assert delay[STATES[channel]] == pytest.approx(seconds * (base_set(SHIP, SEED).ship.L / 130.0) ** 0.5, rel=0.2)


def test_runs_that_share_samples_get_one_group_so_that_no_fold_parts_them(case):
    groups = {run.id: run.group for run in read_dataset(case("piece of a run")[1]).runs}
    assert groups["copy"] == groups["run03"]
    assert len(set(groups.values())) == len(groups) - 1


def test_a_copy_of_parts_of_two_runs_binds_all_three(case):
    groups = {run.id.split("#")[0]: run.meta.group for run in read_dataset(case("overlapping runs")[1]).runs}
    assert groups["copy"] == groups["run03"] == groups["run04"] is not None


def test_two_faults_at_once_are_both_found(tmp_path):
    def both(planting) -> None:
        BY_NAME["speeds in knots"].plant(planting)
        BY_NAME["yaw rate late"].plant(planting)

    folder = write_planted(base_set(SHIP, SEED), Fault("both", both, []), SEED, tmp_path / "set")
    found = check_path(str(folder))[1]
    assert {(f.kind, c) for f in found for c in f.channels} >= {("unit", "u"), ("lag", "r")}
    apply_lines(folder, found)
    assert check_path(str(folder))[1] == []


def test_ships_at_rest_at_one_berth_are_no_pieces_of_one_log():
    data = base_set(SHIP, SEED)
    still = []
    for run in data.runs:
        S = run.states.copy()
        S[-30:, [U, V, R]] = 0.0
        S[-30:, [X, Y, PSI]] = 0.0
        S[:5, [X, Y, PSI, U, V, R]] = 0.0
        still.append(replace(run, states=S))
    assert "pieces of one log" not in {f.kind for f in check_dataset(data.with_runs(still))}


def test_windows_of_the_only_log_stay_apart():
    """As one group nothing of them could be held out."""
    data = base_set(SHIP, SEED)
    log = data.runs[0]
    half = len(log) // 2
    pieces = tuple(replace(log, id=name, t=log.t[part], states=log.states[part], inputs=log.inputs[part])
                   for name, part in (("a", slice(half)), ("b", slice(half, None))))  # fmt: skip
    alone = [f for f in check_dataset(data.with_runs(pieces)) if f.kind == "pieces of one log"]
    among = [f for f in check_dataset(data.with_runs((*pieces, *data.runs[1:]))) if f.kind == "pieces of one log"]
    assert [(f.severity, f.line) for f in alone] == [("note", "")]
    assert [(f.severity, "group" in f.line) for f in among] == [("warning", True)]
