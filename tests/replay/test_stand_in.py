"""Physics that stands in for a simulation of which only trajectories are known."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.frames import long_table
from shipbench.predictors.base import make_predictor
from shipbench.replay.stand_in import stand_in
from shipbench.specs import parse_spec


@pytest.fixture
def theirs(harbour, tmp_path):
    """Predicted trajectories of the first eight runs: the recorded ones, without the actuators."""
    table = long_table(harbour.runs[:8])[["trajectory", "t", "x", "y", "psi", "u", "v", "r"]]
    (tmp_path / "theirs").mkdir()
    table.to_csv(tmp_path / "theirs" / "predicted.csv", index=False)
    return parse_spec(f"predictions:{tmp_path / 'theirs'}")


@pytest.mark.long
def test_the_stand_in_follows_the_trajectories_and_says_how_closely(harbour, theirs):
    spec, note = stand_in(theirs, harbour)
    assert spec.text == theirs.text
    assert "Physics fitted to 8 of them" in note
    assert "Matching: " in note
    assert "8 trajectories matched by run id" in note
    batch = harbour.subset(range(8)).batch()
    S = make_predictor(spec).fit(harbour).predict(batch.s0, batch.U)
    apart = np.hypot(*(S - batch.truth)[..., :2].reshape(-1, 2).T).mean()
    assert apart < 1.0
    told = float(note.partition("on average ")[2].partition(" m off")[0])
    assert told == pytest.approx(apart, rel=0.6)  # it begins with the ordered actuators, for the file has none


def test_another_simulation_is_taken_as_it_is(harbour):
    assert stand_in(parse_spec("hold"), harbour) == (parse_spec("hold"), "")


def test_trajectories_that_are_too_short_are_refused(harbour, tmp_path):
    table = long_table(harbour.runs[:1]).head(2)
    table.to_csv(tmp_path / "short.csv", index=False)
    with pytest.raises(InputError, match="3 samples"):
        stand_in(parse_spec(f"predictions:{tmp_path / 'short.csv'}"), harbour)


@pytest.mark.parametrize("fault", ["degrees", "origin"])
def test_another_unit_is_refused_and_another_origin_is_not(harbour, tmp_path, fault):
    table = long_table(harbour.runs[:4])[["trajectory", "t", "x", "y", "psi"]]
    other = {"degrees": {"psi": np.rad2deg(table["psi"])}, "origin": {"x": table["x"] + 3000.0}}[fault]
    table = table.assign(**other)
    table = table if fault == "degrees" else table.groupby("trajectory").head(2)  # too short to be fitted
    table.to_csv(tmp_path / "other.csv", index=False)
    said = "angles in degrees; correct the files" if fault == "degrees" else "3 samples"
    with pytest.raises(InputError, match=said):
        stand_in(parse_spec(f"predictions:{tmp_path / 'other.csv'}"), harbour)
