"""The words of a diagnosis, for every effect."""

import re
from dataclasses import replace

import numpy as np
import pytest
from made_diagnosis import CAUSE, GAIN, make_diagnosis, make_trace

from shipbench.diagnosis.result import Calibrated, Cause, Estimate, Moved, NoiseFloor
from shipbench.effects.base import EFFECTS
from shipbench.reports.diagnosis.summary import cause_lines, summary_lines
from shipbench.reports.diagnosis.text import (
    calibration_words,
    estimate,
    force_words,
    gain_words,
    headline,
    in_words,
    next_command,
)  # fmt: skip

BANNED = re.compile(
    r"\b(told|said|felt|knots?|heals?|mends?|misread|plant|revolutions|off the regressions|off the formula)\b",
    re.IGNORECASE,
)
LONGEST = 30


def make_cause(name: str) -> Cause:
    """A cause of typical size."""
    effect = EFFECTS.get(name)
    sizes = {p.name: Estimate(p.typical, p.unit, (0.8 * p.typical, 1.2 * p.typical)) for p in effect.parameters}
    if effect.vector:
        sizes = {
            effect.vector[0]: Estimate(0.36, "m/s", (0.34, 0.37)),
            effect.vector[1]: Estimate(1.03, "rad", (1.0, 1.05)),
        }
    if name == "change_point":
        sizes = {"from_run": Estimate(6.0, "1", (float("nan"), float("nan")))}
    line = effect.correction({k: e.value for k, e in sizes.items()})
    return Cause(
        name, 1, 400.0, 0.001, sizes, ("wind",), effect.separate, None, "", "12 of 12 runs", {"sway": 38e3}, line
    )


@pytest.mark.parametrize("name", EFFECTS.built_in())
def test_a_cause_is_reported_in_short_sentences_with_its_typed_name(name):
    effect, cause = EFFECTS.get(name), make_cause(name)
    lines = cause_lines(cause, 80)
    text = " ".join(" ".join(lines).split())
    assert max(map(len, lines)) <= 80
    assert f"1. {name}: {effect.summary}" in text
    assert "Very strong evidence (log Bayes factor 200), supported by 12 of 12 runs." in text
    assert "Its force is up to 38 kN sideways on these runs." in text
    assert not BANNED.search(text), text
    assert max(len(sentence.split()) for sentence in re.split(r"(?<=[.:;])\s", text)) <= LONGEST
    if effect.vector:
        assert f"{effect.vector[1]} 059° (95 %: 057° to 060°)" in text
    for p in effect.parameters:
        if p.relative:
            assert f"{p.title} {p.name} {100 * abs(p.typical):.0f} % {'larger' if p.typical > 0 else 'smaller'}" in text
        if p.share_of:
            assert f"{p.title} {p.name} {100 * p.typical:.0f} % of {p.share_of} (95 %: " in text


@pytest.mark.parametrize("name", EFFECTS.built_in())
def test_a_cause_is_a_noun_phrase_that_holds_its_typed_name(name):
    words = in_words(make_cause(name))
    assert "{" not in words
    assert len(words.split()) <= 16
    assert not BANNED.search(words)
    assert name in words or all(part in words for part in name.split("_"))


@pytest.mark.parametrize(
    ("value", "ci95", "shown"),
    [
        (-0.57, (-0.79, -0.24), "57 % smaller (95 %: 24 to 79 % smaller)"),
        (-0.07, (-0.65, 0.52), "7 % smaller (95 %: 65 % smaller to 52 % larger)"),
        (0.35, (0.05, 0.65), "35 % larger (95 %: 5 to 65 % larger)"),
        (0.35, (float("nan"), float("nan")), "35 % larger"),
    ],
)
def test_a_relative_change_is_reported_in_percent_with_its_direction(value, ci95, shown):
    assert estimate("hull_derivatives", "Y_v", Estimate(value, "1", ci95)) == f"sway damping Y_v {shown}"


def test_forces_have_the_unit_that_suits_their_size():
    assert (
        force_words({"surge": 940.0, "sway": 38_100.0, "yaw": 1.21e6})
        == "up to 940 N lengthwise, 38 kN sideways and 1.2 MN m in yaw on these runs"
    )
    assert force_words({"yaw": 999_999.0}) == "up to 1.0 MN m in yaw on these runs"
    assert force_words({}) == ""


def test_a_sensor_error_comes_with_the_line_that_corrects_it():
    assert "To correct the record, write in dataset.toml: [bias] psi = 0.0349" in " ".join(
        cause_lines(make_cause("heading_bias"), 200)
    )
    assert EFFECTS.get("heading_bias").correction({"bias": 0.1, "turned_velocities": 1.0}) == ""
    alone = EFFECTS.get("speed_scale").fitted(130.0)[1]
    assert alone.correction({"scale": 0.05}) == "[scale] u = 1.05"
    assert EFFECTS.get("speed_scale").correction({"scale": 0.05}) == "[scale] u = 1.05 and v = 1.05"
    assert EFFECTS.get("rudder_offset").correction({"offset": 0.02}) == "[bias] delta = -0.02"


def test_a_headline_leaves_out_a_size_whose_interval_holds_zero():
    """An antenna -0.55 m forward stood beside very strong evidence; only how far to starboard it is was determined."""
    sizes = {"forward": Estimate(-0.55, "m", (-1.84, 0.74)), "starboard": Estimate(-0.041, "m", (-0.05, -0.03))}
    words = in_words(Cause("antenna_offset", 1, 160.0, 0.0, sizes, (), "12 of 12 runs", None, ""))
    assert words.startswith("a position antenna an undetermined distance forward and -0.041 m to starboard")


def test_without_a_cause_the_next_command_tries_the_calibrated_ship():
    none = make_diagnosis("none")
    assert next_command(none) == ""
    better = replace(none, extended_model="calibrated")
    assert "--model physics --model calibrated --dataset trial --horizon 60" in next_command(better)
    assert "Model to compare: calibrated" in "\n".join(summary_lines(better))


@pytest.mark.parametrize(("held_out", "where"), [(True, "held-out runs"), (False, "the runs that were fitted")])
def test_the_errors_of_ship_file_and_calibrated_ship_are_always_stated(held_out, where):
    turn = Moved("yaw rate with 10° of rudder at 110 rpm", 0.444, "1", (0.4, 0.493), 0.7)
    own = Calibrated(15.74, 0.467, (0.251, 0.828), 120.0, held_out, (turn,))
    text = " ".join(" ".join(summary_lines(replace(make_diagnosis("none"), calibration=own))).split())
    assert f"rollouts of at most 120 s on {where}, the ship file's model is 15.7 m off on average" in text
    assert "it is 0.467 m off (95 %: 0.25 to 0.83 m)" in text
    assert "noise floor" not in text
    floored = replace(own, noise_floor=NoiseFloor(0.31, 0.01))
    text = calibration_words(replace(make_diagnosis("none"), calibration=floored))
    assert "The noise of the sensors alone makes 0.31 m and 0.57° of heading (noise floor)." in text
    assert (
        "yaw rate with 10° of rudder at 110 rpm is 44 % larger than the ship file's (95 %: 40 to 49 % larger)" in text
    )
    assert calibration_words(make_diagnosis()) == ""


def test_where_only_the_hull_is_a_cause_the_verdict_is_the_ships_own_coefficients():
    own = replace(GAIN, before=15.7, after=0.467)
    hull = Cause("hull_derivatives", 1, 400.0, 0.001, {}, gain=own)
    alone = replace(make_diagnosis(), causes=(hull,), gain=own)
    assert headline(alone) == "Found: only the ship's own coefficients (hull_derivatives)."
    beside = replace(make_diagnosis(), causes=(CAUSE, hull))
    assert "and the ship's own coefficients (hull_derivatives). With it, the position error of" in headline(beside)
    assert "With them, the position error on held-out runs falls from 15.7 m to 0.467 m" in gain_words(own, hull)


def judged(**changes):
    """Diagnosis of a simulation of the user's own, with a cause and its gain on held-out runs."""
    own = Calibrated(21.6, 14.2, (11.0, 17.0), 120.0, True)
    gain = replace(GAIN, before=14.2, after=6.3, after_ci95=(5.1, 7.9))
    d = replace(make_diagnosis(), simulation="sim.py:simulate", calibration=own, gain=gain)
    return replace(d, extended_model="out/corrected.py:corrected", **changes)


def test_a_simulation_is_told_alone_with_coefficients_and_with_the_cause():
    text = calibration_words(judged())
    assert "your simulation sim.py:simulate is 21.6 m off on average" in text
    assert "With the ship's own coefficients corrected it is 14.2 m off (95 %: 11 to 17 m)." in text
    assert "With a current of 0.31 m/s towards 143° as well it is 6.30 m off (95 %: 5.1 to 7.9 m)." in text
    assert "ship file" not in text


def test_the_next_command_runs_the_simulation_beside_its_correction():
    command = next_command(judged())
    assert (
        command
        == "shipbench run --model sim.py:simulate --model out/corrected.py:corrected --dataset trial --horizon 60"
    )
    assert next_command(replace(judged(), extended_model="sim.py:simulate")) == ""


def test_the_next_command_leaves_most_runs_in_and_is_as_long_as_they_were_rolled_out():
    """`run` leaves out runs that are shorter than its horizon of 120 s, and refuses where all are."""
    d = make_diagnosis()
    trace = make_trace(4)
    assert next_command(replace(d, trace=None)).endswith("--dataset trial")
    for lengths, seconds in (([21, 31, 41, 61], 30), ([61, 61, 11, 61], 60), ([61, 21, 31, 31], 30)):
        measured = trace.measured.copy()
        for row, length in enumerate(lengths):
            measured[row, length:] = np.nan
        assert next_command(replace(d, trace=replace(trace, measured=measured))).endswith(f"--horizon {seconds}")
    two = replace(trace, run=np.array([0, 0, 1, 1]), names=trace.names[:2], measured=measured)  # in two pieces each
    assert next_command(replace(d, trace=two)).endswith("--horizon 30")


def test_a_stand_in_is_said():
    assert calibration_words(judged(stand_in="Only trajectories are known.")).endswith("Only trajectories are known.")


def test_what_the_ship_does_otherwise_than_the_simulation_is_said():
    own = replace(judged().calibration, moved=(Moved("speed at 90 rpm", -0.09, "1", (-0.12, -0.06), 1.8),))
    assert "The ship's speed at 90 rpm is 9 % smaller than your simulation's" in calibration_words(
        judged(calibration=own)
    )


def test_the_errors_of_a_simulation_are_told_once_and_the_correction_knows_the_runs():
    assert headline(judged()) == "Found: a current of 0.31 m/s towards 143°."
    assert "Model to compare: out/corrected.py:corrected (fitted to these runs)" in "\n".join(summary_lines(judged()))
