"""Ships of the literature: the same to port and starboard, carried by a uniform current, and deaf to what their
equations do not have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.effects.base import EFFECTS
from shipbench.errors import InputError
from shipbench.ship import Wind
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, _rates, published_trials, rpm_at
from shipbench.simulate.trials import Trials

SHIPS = pytest.mark.parametrize("ship", PUBLISHED.values(), ids=PUBLISHED)


@SHIPS
def test_a_mirrored_motion_has_mirrored_rates(ship):
    rng = np.random.default_rng(0)
    u, odd, none = ship.cruise * rng.uniform(0.7, 1.1, 5), 0.02 * rng.standard_normal((2 + ship.more, 5)), np.zeros(5)
    n, delta = np.full(5, rpm_at(ship, ship.cruise)), rng.uniform(-0.5, 0.5, 5)
    here = ship.rates((u, *odd), n, delta, 1.0, (none, none, none))
    mirrored = ship.rates((u, *-odd), n, -delta, 1.0, (none, none, none))
    np.testing.assert_allclose(mirrored[0], here[0], rtol=1e-12)
    for a, b in zip(mirrored[1:], here[1:], strict=True):
        np.testing.assert_allclose(a, -b, rtol=1e-9, atol=1e-15)


@SHIPS
def test_a_positive_rudder_turns_to_starboard_and_the_cruising_speed_is_held(ship):
    none, n = np.zeros(1), np.array([rpm_at(ship, ship.cruise)])
    motion = (np.array([ship.cruise]), *(none for _ in range(2 + ship.more)))
    assert abs(ship.rates(motion, n, none, 1.0, (none, none, none))[0][0]) < 1e-9
    assert ship.rates(motion, n, np.array([0.3]), 1.0, (none, none, none))[2][0] > 0.0
    assert ship.rates(motion, n, none, 1.1, (none, none, none))[0][0] > 0.0


@SHIPS
def test_a_uniform_current_carries_the_ship_and_changes_nothing_else(ship):
    """Without air the acceleration seen from the earth is the same for the same motion through the water."""
    areas = Wind(frontal_area=1e-12, lateral_area=1e-12)
    bare = replace(ship, particulars=ship.particulars.model_copy(update={"wind": areas}))
    rng, north, east, no_wind = np.random.default_rng(1), 0.4, -0.3, np.zeros((4, 2))
    psi, u, odd = (
        rng.uniform(-3.0, 3.0, 4),
        ship.cruise * rng.uniform(0.8, 1.0, 4),
        0.01 * rng.standard_normal((2 + ship.more, 4)),
    )
    u_c, v_c = north * np.cos(psi) + east * np.sin(psi), -north * np.sin(psi) + east * np.cos(psi)
    actuators = np.stack(
        [np.full(4, rpm_at(ship, ship.cruise)), rng.uniform(-0.4, 0.4, 4), np.zeros(4), np.zeros(4)], axis=-1
    )
    place = np.zeros((2, 4))
    still = _rates(bare, (), (*place, psi, u, *odd), actuators, no_wind, 0.0)
    hidden = (Hidden(EFFECTS.get("current"), (north, east)),)
    carried = _rates(bare, hidden, (*place, psi, u + u_c, odd[0] + v_c, *odd[1:]), actuators, no_wind, 0.0)
    turn, level = still[2], np.cos(odd[3]) if ship.more else 1.0
    np.testing.assert_allclose(carried[3] - turn * v_c, still[3], rtol=1e-9)
    np.testing.assert_allclose(carried[4] + turn * u_c, still[4], rtol=1e-9)
    np.testing.assert_allclose(carried[5:], still[5:], rtol=1e-9)
    np.testing.assert_allclose(carried[0] - still[0], north + np.sin(psi) * v_c * (1.0 - level), rtol=1e-9)


def test_what_the_equations_do_not_have_is_refused_by_name():
    with pytest.raises(
        InputError, match=r"effect 'race_gain' changes 'race'.*accepted: effects that act through u_c, v_c"
    ):
        published_trials(
            PUBLISHED["tanker"], 5, (Hidden(EFFECTS.get("race_gain"), (0.2,)),), Trials(runs=2, samples=20)
        )
