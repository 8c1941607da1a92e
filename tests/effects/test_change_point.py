"""`change_point`: any effect from a run on, forces also from a time on; `unit_or_sign_error`: one channel times a
factor."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.effects.base import EFFECTS
from shipbench.effects.change_point import EFFECT as CHANGE
from shipbench.effects.unit_or_sign_error import EFFECT as UNIT
from shipbench.errors import InputError
from shipbench.physics.mmg import load_mmg_ship
from shipbench.physics.modifiers import Flow, Modifiers
from shipbench.ship import complete
from shipbench.signals import R, U
from shipbench.simulate.hidden import Hidden, gears_of, sail

SHIP = load_mmg_ship("container130")
PARTICULARS = complete(SHIP.particulars)


def sailed(hidden: list[Hidden], runs: int = 4) -> np.ndarray:
    s0 = np.zeros((runs, 10))
    s0[:, 3], s0[:, 6] = 4.5, 90.0
    commands = np.zeros((runs, 30, 4))
    commands[..., 0], commands[..., 1] = 90.0, 0.2
    return sail(SHIP, s0, commands, 1.0, hidden)


def test_a_force_from_a_run_on_leaves_the_runs_before_as_they_were():
    plain, always = sailed([]), sailed([Hidden(EFFECTS.get("current"), (0.3, 0.1))])
    for q in ((0.3, 0.1), (np.full(4, 0.3), np.full(4, 0.1))):
        changed = sailed([Hidden(CHANGE.of(EFFECTS.get("current"), from_run=2), q)])
        np.testing.assert_allclose(changed[:2], plain[:2], atol=1e-12)
        np.testing.assert_allclose(changed[2:], always[2:], atol=1e-12)
    assert np.max(np.abs(always - plain)) > 1.0


def test_rows_say_which_run_each_row_belongs_to():
    effect = CHANGE.of(EFFECTS.get("current"), from_run=1, rows=[1, 0, 0, 1])
    changed, always, plain = (
        sailed([Hidden(effect, (0.3, 0.1))]),
        sailed([Hidden(EFFECTS.get("current"), (0.3, 0.1))]),
        sailed([]),
    )
    np.testing.assert_allclose(changed[[0, 3]], always[[0, 3]], atol=1e-12)
    np.testing.assert_allclose(changed[[1, 2]], plain[[1, 2]], atol=1e-12)


def test_a_force_from_a_time_on_leaves_the_time_before_as_it_was():
    changed = sailed([Hidden(CHANGE.of(EFFECTS.get("rudder_offset"), from_time=10.0), (0.05,))])
    plain = sailed([])
    np.testing.assert_array_equal(changed[:, :10], plain[:, :10])
    assert np.all(np.abs(changed[:, -1, R] - plain[:, -1, R]) > 1e-4)


def test_a_time_gate_works_on_tensors_and_symbols():
    torch, casadi = pytest.importorskip("torch"), pytest.importorskip("casadi")
    effect = CHANGE.of(EFFECTS.get("rudder_offset"), from_time=10.0)
    t = np.array([0.0, 9.9, 10.0, 30.0])

    def angle(time):
        e = Modifiers()
        effect.force(e, Flow(*([0.0] * 11))._replace(t=time), (0.05,), PARTICULARS)
        return e.delta

    for found in (angle(t), angle(torch.tensor(t)).numpy(), angle(casadi.DM(t)).full().ravel()):
        np.testing.assert_array_equal(found, [0.0, 0.0, 0.05, 0.05])


def test_a_sensor_changes_from_a_run_on():
    S = sailed([])
    seen = CHANGE.of(EFFECTS.get("speed_scale"), from_run=3).measure(S, (0.1,), 1.0)
    np.testing.assert_array_equal(seen[:3], S[:3])
    np.testing.assert_allclose(seen[3, :, U], 1.1 * S[3, :, U])


def test_a_gear_changes_from_a_run_on():
    effect = CHANGE.of(EFFECTS.get("rudder_rate_limit"), from_run=1)
    built = gears_of(SHIP, [])["delta"].rate
    np.testing.assert_allclose(gears_of(SHIP, [Hidden(effect, (np.full(3, 0.01),))])["delta"].rate, [built, 0.01, 0.01])
    with pytest.raises(InputError, match="one value per run"):
        gears_of(SHIP, [Hidden(effect, (0.01,))])


def test_shape_parameters_are_kept_before_the_change():
    e = Modifiers()
    CHANGE.of(EFFECTS.get("rudder_stall"), from_time=10.0).force(e, Flow(*([0.0] * 11)), (0.5, 0.3), PARTICULARS)
    assert (e.stall, e.stall_angle) == (0.0, 0.3)


def test_a_change_reports_the_effect_and_where_it_begins():
    effect = CHANGE.of(EFFECTS.get("wind"), from_run=7)
    assert (effect.name, effect.enters, effect.inner.name) == ("change_point", "force", "wind")
    assert effect.summary == "wind from run 7 on"
    assert effect.units() == {"speed": "m/s", "from": "rad", "from_run": "1"}
    assert effect.public((0.0, 5.0)) == pytest.approx({"speed": 5.0, "from": np.pi / 2, "from_run": 7.0})
    assert effect.internal(effect.public((3.0, 4.0))) == pytest.approx((3.0, 4.0))
    assert effect.sized(130.0) == EFFECTS.get("wind").sized(130.0)
    with pytest.raises(InputError, match="begins at 7"):
        effect.internal({"speed": 5.0, "from_run": 3.0})


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("wind", {}, "give one of the two"),
        ("wind", {"from_run": 2, "from_time": 3.0}, "give one of the two"),
        ("speed_scale", {"from_time": 3.0}, "enters as sensor.*Use from_run"),
        ("rudder_lag", {"from_time": 3.0}, "enters as gear.*Use from_run"),
        ("change_point", {"from_run": 2}, "give one of the others"),
    ],
)
def test_a_change_that_makes_no_sense_is_refused(name: str, arguments: dict, message: str):
    with pytest.raises(InputError, match=message):
        CHANGE.of(EFFECTS.get(name), **arguments)


def test_a_change_of_nothing_in_particular_is_refused():
    uses = [
        lambda: CHANGE.force(Modifiers(), Flow(*([0.0] * 11)), (), PARTICULARS),
        lambda: CHANGE.gear({}, ()),
        lambda: CHANGE.measure(np.zeros((1, 2, 10)), (), 1.0),
        lambda: CHANGE.public(()),
        lambda: CHANGE.units(),
        lambda: CHANGE.internal({}),
    ]
    for use in uses:
        with pytest.raises(InputError, match="does not say what changes"):
            use()


def test_a_unit_error_multiplies_one_channel():
    S = sailed([])
    seen = UNIT.measure(S, UNIT.internal({"channel": "r", "factor": -1.0}), 1.0)
    np.testing.assert_array_equal(seen[..., R], -S[..., R])
    np.testing.assert_array_equal(np.delete(seen, R, axis=-1), np.delete(S, R, axis=-1))


@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [
        ("delta", 180.0 / np.pi, "delta recorded in degrees"),
        ("r", -1.0, "r recorded with the other sign"),
        ("u", 3600.0 / 1852.0, "u recorded in knots"),
        ("psi", -180.0 / np.pi, "psi recorded in degrees, with the other sign"),
        ("x", 2.5, "x recorded 2.5 times too large"),
    ],
)
def test_a_unit_error_has_a_name_in_words(channel: str, factor: float, words: str):
    assert UNIT.describe(UNIT.internal({"channel": channel, "factor": factor})) == words


@pytest.mark.parametrize(
    "values", [{"factor": 2.0}, {"channel": "r"}, {"channel": "q", "factor": 2.0}, {"channel": 10.0, "factor": 2.0}]
)
def test_a_unit_error_without_factor_or_channel_is_refused(values: dict):
    with pytest.raises(InputError, match="channel"):
        UNIT.internal(values)
