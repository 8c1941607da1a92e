"""Whether a similar ship of another size explains the runs better."""

from __future__ import annotations

import pytest
from made_fits import made_fit

from shipbench.diagnosis.selection import other_size
from shipbench.diagnosis.selection.other_size import better_size
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.forward import Plant
from shipbench.estimation.linearisation import Scales
from shipbench.ship import Ship, complete
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials


@pytest.fixture(scope="module")
def plant():
    return Plant.of(published_trials(PUBLISHED["s175"], 3, (), Trials(runs=8, samples=100)))


def test_particulars_scale_with_their_power_of_the_length():
    ship = complete(PUBLISHED["s175"].particulars)
    double = ship.resized(2.0)
    for key, power in (("L", 1), ("xG", 1), ("D_P", 1), ("A_R", 2), ("A_L", 2), ("mass", 3), ("Izz", 5)):
        assert getattr(double, key) == pytest.approx(2.0**power * getattr(ship, key)), key
    assert double.Cb == ship.Cb


def test_evidence_of_the_same_size_is_the_same(plant):
    """So that what is gained by another size is of the size alone, not of the pieces or of their units."""
    same = plant.resized(1.0)
    assert null_fit(same, Scales(same)).evidence == pytest.approx(null_fit(plant, Scales(plant)).evidence, abs=1e-6)


def test_a_right_file_is_not_doubted(plant):
    assert better_size(null_fit(plant, Scales(plant))) == []


@pytest.mark.long
@pytest.mark.parametrize(("factor", "better"), [(0.4, "2.5"), (2.5, "0.4")])
def test_a_file_of_a_smaller_or_larger_similar_ship_is_doubted(plant, factor, better):
    wrong = plant.resized(factor)
    (line,) = better_size(null_fit(wrong, Scales(wrong)))
    assert line.startswith(f"a similar ship of {better} times the size fits the runs better (log Bayes factor ")


@pytest.mark.parametrize(("bare", "gain", "doubted"), [(False, 127.0, True), (True, 127.0, False), (True, 200.0, True)])
def test_a_size_that_suits_an_estimated_propeller_needs_more_evidence(plant, monkeypatch, bare, gain, doubted):
    """Mariner, known by her main dimensions alone, gains 127 as a ship of 2.5 times her size."""
    evidence = {True: 0.0, False: gain}
    monkeypatch.setattr(other_size, "first_evidence", lambda *_: gain)
    monkeypatch.setattr(other_size, "null_fit", lambda at, _: made_fit(plant=at, log_evidence=evidence[at is few]))
    monkeypatch.setattr(
        plant, "ship", complete(Ship(name="bare", L=175.0, B=25.4, T=8.5, displacement=21222.0)) if bare else plant.ship
    )
    few = plant.thinned(99)
    assert bool(better_size(made_fit(plant=plant))) is doubted
