"""Files of bands: kept with the model, and refused in one message where damaged, hostile or of other weights."""

from __future__ import annotations

import json
import os
import shutil

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.predictors._band import BAND_FILE, Band, _digest, read_band
from shipbench.predictors.base import make_predictor
from shipbench.signals import MOTION, STATES

FACTOR = np.arange(1.0, 31.0).reshape(5, 6) / 7.0


@pytest.fixture
def folder(toy, tmp_path):
    """A saved `hold` with a band."""
    model = make_predictor("hold").fit(toy())
    model.band = Band(FACTOR, 1.0, 0.9, 12)
    model.save(tmp_path / "model")
    return tmp_path / "model"


def _refused(folder, match=""):
    with pytest.raises(InputError, match=r"band\.json is no band of this model, or it is damaged: ") as caught:
        make_predictor(str(folder))
    assert "Delete it to predict without limits, or save model and band again: shipbench run --bands." in str(
        caught.value
    )
    assert match in str(caught.value)


def _signed(folder, **changes):
    """As somebody would write a wrong band by hand, digest and all."""
    content = json.loads((folder / BAND_FILE).read_text())
    content = {key: value for key, value in content.items() if key != "digest"} | changes
    (folder / BAND_FILE).write_text(json.dumps(content | {"digest": _digest(content)}))


def test_a_loaded_band_is_the_saved_one_and_leaves_the_model_as_it_is(folder, toy):
    band = make_predictor(str(folder)).band
    np.testing.assert_array_equal(band.factor, FACTOR)
    assert (band.dt, band.coverage, band.groups, band.history, band.of_samples) == (1.0, 0.9, 12, 0, False)
    assert band.seconds == 5.0
    assert repr(band) == "<Band of 90 % over 5 s, from 12 groups of runs>"
    make_predictor("hold").fit(toy()).save(folder.with_name("plain"))
    same = (
        json.loads((folder / "model.json").read_text()),
        json.loads((folder.with_name("plain") / "model.json").read_text()),
    )
    assert same[0] == same[1]


def test_a_model_that_is_fitted_again_has_no_band_and_saves_none(folder, toy):
    model = make_predictor(str(folder))
    model.save(folder.with_name("copy"))
    assert read_band(folder.with_name("copy")) is not None
    model.fit(toy())
    assert model.band is None
    model.save(folder)
    assert not (folder / BAND_FILE).exists()
    assert make_predictor(str(folder)).band is None


def test_a_band_of_other_weights_is_refused(folder, toy):
    other = folder.with_name("other")
    make_predictor("hold").fit(toy(runs=4)).save(other)
    shutil.copy(folder / BAND_FILE, other)
    _refused(other, "it belongs to other weights: model.json is not the file that it was saved with")
    (other / "weights.npz").write_bytes(b"")
    _signed(other, files={"../model/arrays.npz": "0"})
    _refused(other, "it belongs to a model with the file '../model/arrays.npz', which is not here")


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "{}", '{"schema": 1}', "[" * 100_000, "\udcff"])
def test_a_damaged_file_is_one_message(folder, text):
    (folder / BAND_FILE).write_text(text, errors="surrogateescape")
    _refused(folder)


def test_a_file_cut_short_or_with_a_flipped_byte_is_one_message(folder):
    rng = np.random.default_rng(0)
    whole = (folder / BAND_FILE).read_bytes()
    for at in rng.integers(0, len(whole) - 2, 60):
        (folder / BAND_FILE).write_bytes(whole[:at])
        _refused(folder)
        (folder / BAND_FILE).write_bytes(
            whole[:at] + bytes([whole[at] ^ (1 << int(rng.integers(8)))]) + whole[at + 1 :]
        )
        try:
            make_predictor(str(folder))
        except InputError:
            continue
        assert json.loads((folder / BAND_FILE).read_text()) == json.loads(whole)  # a blank for another


def _with(value):
    return {name: list(column) for name, column in zip(STATES[MOTION], FACTOR.T, strict=True)} | {"x": value}


@pytest.mark.parametrize(
    ("key", "value", "accepted"),
    [
        ("schema", 2, "accepted: 1"),
        ("dt", 0, "dt = 0; accepted: a positive number of seconds"),
        ("dt", "1", "dt = '1'; accepted: a positive number"),
        ("dt", 10**400, "accepted: a positive number"),
        ("dt", float("nan"), "dt = nan; accepted: a positive number"),
        ("coverage", 90, "coverage = 90; accepted: a number between 0 and 1"),
        ("groups", True, "groups = True; accepted: a whole number from 1"),
        ("history", -1, "history = -1; accepted: a whole number from 0"),
        ("of_samples", 0, "of_samples = 0; accepted: true or false"),
        ("files", {}, "files = {}; accepted: digests by name"),
        ("files", {"model.json": 3}, "accepted: digests by name"),
        ("factor", [1, 2], "factor = [1, 2]; accepted: numbers by channel"),
        ("factor", {"x": [1.0]}, "factor has the channels x of [1] time steps; accepted: x, y, psi, u, v, r"),
        ("factor", _with([1.0]), "accepted: x, y, psi, u, v, r, all of one number of time steps"),
        ("factor", _with(3), "all of one number of time steps"),
        ("factor", {name: [] for name in STATES[MOTION]}, "all of one number of time steps"),
        ("factor", _with([-1.0] * 5), "factor holds other values than finite numbers from 0"),
        ("factor", _with([float("inf")] * 5), "factor holds other values than finite numbers"),
        ("factor", _with(["1"] * 5), "factor holds other values than finite numbers"),
        ("factor", _with([10**400] * 5), "factor holds other values than finite numbers"),
        ("factor", _with([None] * 5), "factor holds other values than finite numbers"),
        ("factor", _with([[1.0, 2.0]] * 5), "factor holds other values than finite numbers"),
        ("factor", _with([{}] * 5), "factor holds other values than finite numbers"),
    ],
)
def test_a_value_that_no_band_has_is_named(folder, key, value, accepted):
    _signed(folder, **{key: value})
    _refused(folder, accepted)


def test_numbers_that_were_changed_are_refused(folder):
    content = json.loads((folder / BAND_FILE).read_text())
    content["factor"]["x"][0] *= 0.5
    (folder / BAND_FILE).write_text(json.dumps(content))
    _refused(folder, "its numbers were changed after it was saved")


def test_a_file_that_is_too_large_or_no_file_is_refused(folder):
    os.truncate(folder / BAND_FILE, 64_000_001)
    _refused(folder, "has 64 MB; accepted: a band of up to 64 MB")
    (folder / BAND_FILE).unlink()
    os.mkfifo(folder / BAND_FILE)
    _refused(folder, "it is a named pipe")
    (folder / BAND_FILE).unlink()
    (folder / BAND_FILE).symlink_to("nowhere.json")
    _refused(folder, "a link to a file that does not exist")


def test_a_band_says_for_which_predictions_it_is_not():
    band, samples = Band(FACTOR, 1.0, 0.9, 12), Band(FACTOR, 1.0, 0.9, 12, of_samples=True)
    assert band.misfit(object()) == band.misfit(object(), 0, 1.0) == ""
    assert band.misfit(object(), 0, 0.5) == "the band is for time steps of 1 s, the data have 0.5 s"
    assert band.misfit(object(), 10) == "the band is for predictions with 0 samples of history, these have 10"
    assert samples.misfit(object()) == "the band is for a model with predict_samples"
