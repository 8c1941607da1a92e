"""The parts of the import: position, resampling, speeds from a track, merging of streams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from trial import motion

from shipbench.errors import InputError
from shipbench.importing.channels import Block
from shipbench.importing.mapping import load_mapping
from shipbench.importing.position import to_body, to_midship, to_plane, velocity_at_midship
from shipbench.importing.resample import interval_means, interval_values, sample
from shipbench.importing.speeds import derivative
from shipbench.importing.stretches import Feed, Stretches
from shipbench.importing.thresholds import THRESHOLDS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.physics.wind import true_wind
from shipbench.simulate.harbour import draw_plan, fly


def test_local_plane_against_the_published_example():
    """IOGP Guidance Note 7-2, section 4.1.2: U = -189013.869 m, V = -128642.040 m."""
    lat, lon = np.deg2rad(53 + 48 / 60 + 33.82 / 3600), np.deg2rad(2 + 7 / 60 + 46.38 / 3600)
    north, east = to_plane(lat, lon, (np.deg2rad(55.0), np.deg2rad(5.0)), 73.0, 200.0)
    assert float(east) == pytest.approx(-189013.869, abs=0.01)
    assert float(north) == pytest.approx(-128642.040, abs=0.01)


def test_local_plane_is_whole_at_the_date_line_and_one_minute_of_latitude_is_a_mile():
    north, east = to_plane(np.deg2rad([0.0, 1 / 60]), np.deg2rad([179.999, -179.999]), (0.0, np.pi))
    assert north[1] == pytest.approx(1852, rel=6e-3)
    assert east[1] - east[0] == pytest.approx(0.002 * 111320, rel=1e-3)


def test_antenna_is_moved_to_midship_and_its_velocity_with_it():
    t = np.arange(0.0, 100.0, 0.01)
    s = motion(t)
    x_p = s["x"] + 12.0 * np.cos(s["psi"]) + 3.0 * np.sin(s["psi"])
    y_p = s["y"] + 12.0 * np.sin(s["psi"]) - 3.0 * np.cos(s["psi"])
    x, y = to_midship(x_p, y_p, s["psi"], (12.0, -3.0))
    np.testing.assert_allclose([x, y], [s["x"], s["y"]], atol=1e-9)
    body = to_body(
        np.gradient(x_p, t), np.gradient(y_p, t), s["psi"]
    )  # fine, noise-free samples: differences serve as the reference
    u, v = velocity_at_midship(*body, s["r"], (12.0, -3.0))
    np.testing.assert_allclose([u[5:-5], v[5:-5]], [s["u"][5:-5], s["v"][5:-5]], atol=1e-4)


def test_wind_felt_on_a_ship_that_makes_way_in_calm_air_is_no_wind():
    north, east = true_wind(
        np.array([1.0]), np.array([5.0]), np.array([0.0]), np.array([5.0]), np.array([0.0]), "apparent"
    )
    np.testing.assert_allclose([north, east], 0.0, atol=1e-12)


def test_what_the_grid_cannot_show_does_not_fold_into_it():
    t = np.arange(0.0, 200.0, 0.05)
    slow, fast = np.sin(2 * np.pi * t / 40.0), np.sin(2 * np.pi * t * 0.95)  # 0.95 Hz would fold to 0.05 Hz at dt = 1 s
    grid = np.arange(200.0)
    inner = slice(5, -5)
    truth = np.sin(2 * np.pi * grid / 40.0)
    folded = np.interp(grid, t, slow + fast) - truth
    assert np.std(folded[inner]) > 0.6
    assert np.std((sample(t, slow + fast, 0.0, 1.0, 200) - truth)[inner]) < 0.06
    assert np.std((sample(t, slow, 0.0, 1.0, 200) - truth)[inner]) < 0.01


def test_a_step_of_the_rudder_does_not_overshoot_and_a_line_stays_one_to_its_ends():
    t = np.arange(0.0, 60.0, 0.1)
    step = sample(t, np.where(t < 30, -0.6, 0.6), 0.0, 1.0, 60)
    assert np.abs(step).max() < 0.6 * 1.01
    np.testing.assert_allclose(sample(t, 5.0 * t - 7.0, 0.0, 1.0, 60), 5.0 * np.arange(60.0) - 7.0, atol=1e-6)


def test_slow_and_irregular_samples_are_interpolated():
    t = np.array([0.0, 2.9, 5.2, 7.0, 10.0])
    np.testing.assert_allclose(sample(t, 2.0 * t, 0.0, 1.0, 11), 2.0 * np.arange(11.0))
    np.testing.assert_allclose(interval_values(t, 2.0 * t, 0.0, 1.0, 10), 2.0 * np.arange(10.0) + 1.0)


def test_a_command_keeps_its_impulse_however_it_is_logged():
    t = np.array([0.0, 3.25, 7.5, 8.1])  # logged on change
    v = np.array([0.0, 1.0, -1.0, 0.5])
    means = interval_means(t, v, 0.0, 1.0, 12)
    assert means[3] == pytest.approx(0.75)
    assert means[7] == pytest.approx(0.0)
    assert means[8] == pytest.approx(-0.1 + 0.45)
    fine = np.arange(0.0, 12.0, 0.05)
    dense = interval_means(fine, v[np.searchsorted(t, fine + 1e-9, side="right") - 1], 0.0, 1.0, 12)
    np.testing.assert_allclose(means, dense, atol=1e-6)


NOISES = {
    "white": lambda rng, n, h: 0.2 * rng.standard_normal(n),
    "wander of seconds": lambda rng, n, h: wander(rng, n, h, 0.3, 3.0),
}


def wander(rng, n, h, sigma, time):
    """First-order Gauss-Markov noise, as of a satellite receiver."""
    keep = np.exp(-h / time)
    noise = rng.standard_normal(n) * sigma * np.sqrt(1 - keep**2)
    noise[0] *= 1 / np.sqrt(1 - keep**2)
    for k in range(1, n):
        noise[k] += keep * noise[k - 1]
    return noise


@pytest.mark.long
@pytest.mark.parametrize("kind", NOISES)
@pytest.mark.parametrize("h", [1.0, 0.2])
def test_speeds_from_a_noisy_track_against_the_simulated_truth(kind, h):
    ship = load_mmg_ship("container130")
    rng = np.random.default_rng(5)
    S, _ = fly(ship, draw_plan(rng, 4, ship.L, 300, 30), rng, 300, 30)
    grid, t = np.arange(301.0), np.arange(0.0, 300.0 + 1e-9, h)
    ours, differences = [], []
    for states in S:
        x, y, psi, u, v = states[:, :5].T
        truth = np.column_stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)])
        noisy = np.column_stack([CubicSpline(grid, s)(t) + NOISES[kind](rng, len(t), h) for s in (x, y)])
        found = derivative(t, noisy, grid, 1.0, np.sqrt(ship.L / 9.81))
        raw = np.gradient(noisy, t, axis=0)[:: round(1 / h)]
        ours.append(np.sqrt(np.mean((found.rate - truth) ** 2)))
        differences.append(np.sqrt(np.mean((raw - truth) ** 2)))
        assert np.sqrt(ship.L / 9.81) <= found.time_constant < 30.0
    assert np.mean(ours) < 0.04  # of about 4 m/s
    assert np.mean(ours) < 0.4 * np.mean(differences)


def test_speeds_from_an_exact_track_and_from_next_to_nothing():
    t = np.arange(0.0, 100.0, 0.5)
    s = motion(t)
    found = derivative(t, np.column_stack([s["x"], s["y"]]), t, 1.0, 2.0)
    north, east = (
        s["u"] * np.cos(s["psi"]) - s["v"] * np.sin(s["psi"]),
        s["u"] * np.sin(s["psi"]) + s["v"] * np.cos(s["psi"]),
    )
    truth = np.column_stack([north, east])
    np.testing.assert_allclose(
        found.rate, truth, atol=0.1
    )  # of 4 m/s, in the middle of a hard turn that the log cuts into
    np.testing.assert_allclose(found.rate[20:-20], truth[20:-20], atol=0.02)
    few = derivative(t[:3], s["x"][:3, None], t[:3], 1.0, 2.0)
    np.testing.assert_allclose(few.rate[:, 0], north[1], atol=0.02)


def stream(t, columns, size):
    values = np.column_stack(columns)
    return (Block(t[k : k + size], values[k : k + size]) for k in range(0, len(t), size))


@pytest.mark.parametrize("size", [7, 50, 100_000])
def test_stretches_of_two_rates_do_not_depend_on_the_blocks(size):
    a = np.delete(np.arange(0.0, 500.0, 1.0), slice(100, 130))
    b = np.delete(np.arange(2.05, 480.0, 0.1), slice(3000, 3100))
    feeds = [Feed(stream(a, [a], size), ("x",)), Feed(stream(b, [b], 3 * size), ("psi",))]
    found = Stretches(feeds, {"x": 3.0, "psi": 1.0}, frozenset(), 100.0, 1.0, 10.0)
    spans = [(round(s.start, 6), round(s.end, 6), s.part, s.last) for s in found]
    assert spans == [
        (2.05, 99.0, 0, True), (130.0, 230.0, 0, False), (231.0, 301.95, 1, True), (312.05, 412.05, 0, False),
        (413.05, 479.95, 1, True),
    ]  # fmt: skip
    assert [(round(c.start, 6), round(c.end, 6), c.channels) for c in found.cuts] == [
        (0.0, 2.05, ("psi",)), (99.0, 130.0, ("x",)), (301.95, 312.05, ("psi",)), (479.95, 499.0, ("psi",)),
    ]  # fmt: skip


def test_a_stream_is_forgotten_as_it_is_read():
    t = np.arange(0.0, 100_000.0, 1.0)
    feed = Feed(stream(t, [t], 500), ("x",))
    most = 0
    for _ in Stretches([feed], {"x": 3.0}, frozenset(), 1000.0, 1.0, 20.0):
        most = max(most, len(feed.t))
    assert most < 2100


def test_a_dense_stream_comes_in_parts_that_fit_into_memory(monkeypatch):
    row = THRESHOLDS.rows["readings_in_memory"]
    monkeypatch.setitem(THRESHOLDS.rows, row.name, replace(row, value=1000))
    t = np.arange(0.0, 50.0, 0.01)
    found = Stretches([Feed(stream(t, [t], 500), ("x",))], {"x": 3.0}, frozenset(), 3600.0, 1.0, 0.5)
    assert max(s.end - s.start for s in found) <= 10.0


@pytest.mark.parametrize("split", ["3", "[1]", '"x"'])
def test_a_split_that_is_no_table_is_refused_also_with_a_window_of_the_command(tmp_path, split):
    path = tmp_path / "mapping.toml"
    path.write_text(
        f'name = "t"\ndt = 1.0\nsplit = {split}\ntime = {{ column = "t" }}\n'
        'channels.psi = { column = "psi", unit = "rad" }\n'
    )
    with pytest.raises(InputError, match="split"):
        load_mapping(path, window=30.0)
