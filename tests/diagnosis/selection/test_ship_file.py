"""The file of another ship: what is named goes by the ship of the file, and is told with a warning or not at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_analysis, made_fit

from shipbench.checking.units import UnitFinding
from shipbench.diagnosis import diagnose as whole
from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.selection import ship_file
from shipbench.diagnosis.selection.analysis import THRESHOLD, plain_model
from shipbench.diagnosis.selection.ship_file import doubts_of, whatever_the_ship
from shipbench.diagnosis.selection.stepwise import select
from shipbench.effects.base import EFFECTS
from shipbench.estimation.coefficients import NUM_BASE
from shipbench.estimation.forward import Plant
from shipbench.estimation.term import Term
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.cases import draw_case, singles
from shipbench.suites.diagnosis.ships import draw_ship

QUESTION = "Is the ship file that of this ship"


@pytest.fixture(scope="module")
def tankers():
    """Variants of KVLCC2 of 66 and 110 m."""
    rng = np.random.default_rng(0)
    return [draw_ship(rng, "test", False) for _ in range(2)]


@pytest.mark.long
def test_a_thrust_that_a_ship_of_nearly_the_same_size_explains_too_is_told_with_a_warning(tankers):
    """With the file of the smaller one the larger one had too much thrust, and nothing else was out of the ordinary."""
    verdict = diagnose(replace(sea_trials(tankers[1], 0), ship=tankers[0].particulars), gain=False)
    assert [c.effect for c in verdict.causes] == ["thrust_gain"]
    (warning,) = [w for w in verdict.warnings if QUESTION in w]
    assert warning.startswith(
        "a similar ship of 1.4 times the size fits the runs about as well as thrust_gain (log Bayes factor "
    )


@pytest.mark.long
def test_a_stalled_rudder_that_no_other_size_explains_is_told_without():
    case = draw_case("single", singles().index("rudder_stall"), 4)
    verdict = diagnose(case.dataset(), gain=False)
    assert [c.effect for c in verdict.causes] == ["rudder_stall"]
    assert not any(QUESTION in w for w in verdict.warnings)


@pytest.mark.long
def test_a_slow_gear_of_an_odd_ship_is_told_with_a_warning():
    trials = replace(published_trials(PUBLISHED["tanker"], 0, (), Trials()), ship=PUBLISHED["navy"].particulars)
    verdict = diagnose(trials, gain=False)
    named = [c.effect for c in verdict.causes]
    assert named == ["rudder_lag", "shaft_lag"]
    (warning,) = [w for w in verdict.warnings if QUESTION in w]
    assert warning.endswith(
        "A wrong ship file may also cause rudder_lag and shaft_lag: they are certain only when the file is."
    )


def test_sizes_are_compared_beside_noise_of_their_own(monkeypatch):
    """Of a ferry in wind the speed log was 4.5 % off: beside the noise that suits a log so far off, not the sound one
    of the other size, the ship of the file was 4878 of log evidence behind one of 2.5 times her size; beside her own
    she was ahead."""
    data = sea_trials(
        load_mmg_ship("kcs"), 3, (Hidden(EFFECTS.get("speed_scale"), (0.045,)),), Trials(runs=8, samples=80)
    )
    null = plain_model(Plant.of(data), ("speed_scale",))
    found = select(null, THRESHOLD)
    assert found.null.evidence < null.evidence
    monkeypatch.setattr(ship_file, "needed", lambda _: np.ones(NUM_BASE))
    monkeypatch.setattr(ship_file, "better_size", lambda of: ["beside its own noise"] if of is null else [])
    (doubt,) = doubts_of(replace(made_analysis(found.final), selection=found))
    assert doubt.startswith("beside its own noise")


@pytest.mark.parametrize(
    ("changed", "shows"), [("heading_bias", True), ("rudder_offset", True), ("thrust_gain", False)]
)
def test_of_a_change_what_has_changed_decides_whether_it_shows_whatever_the_ship(changed, shows):
    terms = (Term(EFFECTS.get("current")), Term(EFFECTS.get(changed), since=9))
    assert whatever_the_ship("change_point", made_analysis(made_fit(terms))) is shows


@pytest.mark.long
def test_of_a_ship_in_doubt_no_actuator_is_read_to_the_other_side(monkeypatch):
    """Thrusters of a research ship, beside the file of a ship of 300 m, were all four named as of the wrong sign, with
    certainty."""
    monkeypatch.setattr(whole, "turned_actuators", lambda *_: [UnitFinding("delta", "sign", -1.0, "as if it were")])
    trials = published_trials(PUBLISHED["navy"], 3, (), Trials(runs=8, samples=100))
    verdict = diagnose(replace(trials, ship=PUBLISHED["s175"].particulars), gain=False)
    assert any(QUESTION in w for w in verdict.warnings)
    assert [c.effect for c in verdict.causes] == []
