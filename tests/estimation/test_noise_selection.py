"""Noise models of the channels, in words, and waves that the latent force follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_fit, made_plant

from shipbench.estimation.laplace import Fit
from shipbench.estimation.noise import Colour
from shipbench.estimation.noise_selection import noise_in_words, swinging_force
from shipbench.signals import PSI, R, U, V


def quiet(dt: float = 1.0, steps: int = 60) -> Fit:
    return made_fit(plant=made_plant(4, dt=dt, states=np.zeros((4, steps + 1, 10))))


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({}, "errors that last for about 8 s"),
        ({"smooth": True}, "errors that are smooth for about 8 s, as of a filter"),
        ({"period": 12.0}, "swings with a period of about 24 s, as in waves"),
    ],
)
def test_noise_that_is_not_white_is_told_with_its_time_in_seconds(more: dict, told: str):
    fit = quiet(dt=2.0)
    assert noise_in_words(fit) == {}
    coloured = fit.scales.coloured(fit.scales.colour.with_channel(PSI, 4.0, 4.0, **more))
    words = noise_in_words(replace(fit, scales=coloured))
    assert list(words) == ["heading"]
    assert words["heading"].startswith(told)
    assert words["heading"].endswith("deg)")


@pytest.mark.parametrize(("axis", "channel"), [(0, U), (1, V), (2, R)])
def test_a_latent_force_that_swings_makes_wave_noise_of_its_velocity(axis: int, channel: int):
    fit = quiet(steps=120)
    colour = Colour.white(fit.plant.steps + 1)
    w = np.zeros_like(fit.point.w)
    w[..., axis] = np.cos(2.0 * np.pi * np.arange(w.shape[1]) * fit.plant.knot_time / 20.0)
    found = swinging_force(replace(fit, point=replace(fit.point, w=w)), colour)
    assert np.flatnonzero(np.isfinite(found.period)).tolist() == [channel]
    assert found.period[channel] == pytest.approx(20.0, abs=2.0)


def test_a_latent_force_that_lasts_is_no_wave():
    fit = quiet(steps=120)
    colour = Colour.white(fit.plant.steps + 1)
    w = np.ones_like(fit.point.w)
    assert not np.isfinite(swinging_force(replace(fit, point=replace(fit.point, w=w)), colour).period).any()
