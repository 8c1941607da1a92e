"""A heading that was interpolated linearly across 360/0 is found in a log and left out; a ship that turns a circle is
not."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.importing.north import fill_angle, interpolated, without_interpolated


def course(seconds: int = 400) -> np.ndarray:
    """A heading [rad] that swings to and fro across north, continuous."""
    t = np.arange(seconds, dtype=float)
    return np.asarray(0.4 * np.sin(0.05 * t) + 0.001 * np.random.default_rng(1).standard_normal(seconds))


def logged(psi: np.ndarray, every: int, begin: float = 0.0) -> np.ndarray:
    """The heading as numbers from `begin` up, at every so many samples, interpolated as they stand."""
    at = np.arange(0, len(psi), every)
    return np.interp(np.arange(at[-1] + 1), at, np.remainder(psi[at] - begin, 2.0 * np.pi) + begin)


@pytest.mark.parametrize("every", [2, 3, 10])
@pytest.mark.parametrize(("begin", "turned"), [(0.0, 0.0), (-np.pi, np.pi)])
def test_every_crossing_is_found_and_bridged(every, begin, turned):
    psi = course() + turned
    record = logged(psi, every, begin)
    off = np.abs(np.angle(np.exp(1j * (record - psi[: len(record)])))) > 0.1
    bad = np.zeros(len(record), dtype=bool)
    for a, b in interpolated(record):
        bad[a : b + 1] = True
    assert off.sum() >= 6
    assert np.all(bad[off])
    assert np.max(np.abs(np.angle(np.exp(1j * (fill_angle(record, bad) - psi[: len(record)]))))) < 0.15
    (t, kept), count = without_interpolated({"psi": (np.arange(len(record)), record)})[0]["psi"], int(bad.sum())
    assert (len(t), len(kept)) == (len(record) - count, len(record) - count)


def test_degrees_are_read_by_their_own_turn():
    record = np.rad2deg(logged(course(), 3))
    assert len(interpolated(record, 360.0)) == len(interpolated(np.deg2rad(record)))


@pytest.mark.parametrize("rate", [0.01, 0.06, 0.3])
def test_a_turning_circle_is_none(rate):
    turning = np.cumsum(
        np.concatenate(
            [np.zeros(100), np.linspace(0.0, rate, 8), np.full(round(2.0 * np.pi / rate) - 4, rate), np.zeros(100)]
        )
    )
    noise = 1e-3 * np.random.default_rng(2).standard_normal(len(turning))
    assert interpolated(np.remainder(turning + 1.0 + noise, 2.0 * np.pi)) == []


@pytest.mark.parametrize("rate", [0.0087, 0.026, 0.05])
def test_a_long_turn_in_a_record_that_is_mostly_straight_is_none(rate):
    """A research vessel turned circles at 3 deg/s; most of her record was straight, and 230 good headings were replaced
    by a straight line."""
    rng = np.random.default_rng(4)
    turning = np.concatenate(
        [
            np.full(1500, 1e-4),
            np.linspace(0.0, rate, 12),
            np.full(round(3.2 * 2.0 * np.pi / rate), rate),
            np.full(900, 1e-4),
        ]
    )
    steps = turning * (1.0 + 0.03 * rng.standard_normal(len(turning)))
    assert interpolated(np.remainder(np.cumsum(steps) + 0.2, 2.0 * np.pi)) == []
    assert interpolated(np.remainder(np.cumsum(turning) + 0.2, 2.0 * np.pi)) == []  # at one rate, to the last digit


@pytest.mark.parametrize("offset", [0.0, 0.1, 0.2, 0.3, 0.4])
def test_crossings_are_found_wherever_the_samples_lie_between_the_readings(offset):
    """A circle at 3 deg/s, read every 2.5 s and resampled to 0.5 s."""
    at = np.arange(offset, 600.0, 2.5)
    psi = np.deg2rad(3.0) * at + 0.02 * np.sin(0.3 * at)
    t = np.arange(5.0, 590.0, 0.5)
    record = np.interp(t, at, np.remainder(psi, 2.0 * np.pi))
    off = np.abs(np.angle(np.exp(1j * (record - np.interp(t, at, psi))))) > 0.02
    bad = np.zeros(len(t), dtype=bool)
    for a, b in interpolated(record):
        bad[a : b + 1] = True
    assert off.sum() >= 12
    assert np.all(bad[off])
    assert bad.sum() <= off.sum() + 10


def test_a_wrapped_heading_is_none():
    assert interpolated(np.remainder(course(), 2.0 * np.pi)) == []
