"""Channels made of several columns, and units that need to know what full deflection is."""

from __future__ import annotations

import numpy as np
import pytest
from trial import channels, logged, mapping, motion

from shipbench.data.base import load_dataset

T = np.arange(0.0, 60.0, 1.0)
S = motion(T)


def imported(trial_import, table, **entries: str) -> np.ndarray:
    """States of the only run, with some channels mapped otherwise."""
    result = trial_import(table, mapping(body=channels(**entries)), "--force")
    assert result.exit_code == 0, result.output
    (run,) = load_dataset("out").runs
    return run.states


def wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def test_two_shafts(trial_import):
    table = logged(T).assign(port=100.0, stbd=130.0)
    assert imported(trial_import, table, n='{ mean = ["port", "stbd"], unit = "rpm" }')[:, 6] == pytest.approx(115.0)
    assert imported(trial_import, table, n='{ sum = ["port", "stbd"], unit = "rpm", factor = 0.5 }')[
        :, 6
    ] == pytest.approx(115.0)
    assert imported(trial_import, table, n='{ diff = ["stbd", "port"], unit = "rev/s", offset = 1.0 }')[
        :, 6
    ] == pytest.approx(31.0 * 60.0)


def test_the_mean_of_two_headings_crosses_north(trial_import):
    table = logged(T)
    table["a"], table["b"] = (
        (table["HDG"] + 182.0) % 360.0,
        (table["HDG"] + 178.0) % 360.0,
    )  # the ship crosses 180, these cross north
    psi = imported(trial_import, table, psi='{ mean = ["a", "b"], unit = "deg", offset = 180.0 }')[:, 2]
    np.testing.assert_allclose(wrapped(psi - S["psi"]), 0.0, atol=1e-3)


def test_a_reading_of_one_column_alone_is_none(trial_import):
    table = logged(T).assign(port=100.0, stbd=130.0)
    table.loc[30:31, "stbd"] = np.nan
    assert imported(trial_import, table, n='{ mean = ["port", "stbd"], unit = "rpm" }')[:, 6] == pytest.approx(115.0)


def test_heading_of_components_and_of_quaternions(trial_import):
    table = logged(T).assign(sine=3.0 * np.sin(S["psi"]), cosine=3.0 * np.cos(S["psi"]))
    psi = imported(trial_import, table, psi='{ atan2 = ["sine", "cosine"] }')[:, 2]
    np.testing.assert_allclose(wrapped(psi - S["psi"]), 0.0, atol=1e-3)
    ned = logged(T).assign(qx=0.0, qy=0.0, qz=np.sin(S["psi"] / 2), qw=np.cos(S["psi"] / 2))
    psi = imported(trial_import, ned, psi='{ quaternion = ["qx", "qy", "qz", "qw"] }')[:, 2]
    np.testing.assert_allclose(wrapped(psi - S["psi"]), 0.0, atol=1e-3)
    yaw = np.pi / 2 - S["psi"]  # from east, counterclockwise, as in ROS
    enu = logged(T).assign(qx=0.0, qy=0.0, qz=np.sin(yaw / 2), qw=np.cos(yaw / 2))
    entry = f'{{ quaternion = ["qx", "qy", "qz", "qw"], sign = "counterclockwise", offset = {-np.pi / 2:.9f} }}'
    np.testing.assert_allclose(wrapped(imported(trial_import, enu, psi=entry)[:, 2] - S["psi"]), 0.0, atol=1e-3)


def test_rudder_in_percent_of_35_degrees_and_pulses(trial_import):
    table = logged(T)
    percent, pulse = table["rudder"] / 0.35, 1500.0 + table["rudder"] / 35.0 * 500.0
    expected = imported(trial_import, table)[:, 7]
    entry = '{ column = "rudder", unit = "%", full = 35.0, full_unit = "deg" }'
    np.testing.assert_allclose(
        imported(trial_import, table.assign(rudder=percent), delta=entry)[:, 7], expected, atol=1e-9
    )
    entry = '{ column = "rudder", unit = "pwm", full = 35.0, full_unit = "deg" }'
    np.testing.assert_allclose(
        imported(trial_import, table.assign(rudder=pulse), delta=entry)[:, 7], expected, atol=1e-9
    )
    told = trial_import(table, mapping(body=channels(delta='{ column = "rudder", unit = "%" }'))).stderr
    assert (
        'unit "%" without full; accepted: the value at full deflection, such as full = 35.0, full_unit = "deg"' in told
    )


def test_no_pulse_is_no_reading_and_a_short_pulse_is_one(trial_import):
    pulse = np.round(1500.0 + 450.0 * np.sin(T / 6.0))
    pulse[20:22] = 0.0
    pulse[40] = 999.0
    entry = '{ column = "rudder", unit = "pwm", full = 60.0, full_unit = "deg" }'
    delta = np.rad2deg(imported(trial_import, logged(T).assign(rudder=pulse), delta=entry)[:, 7])
    assert np.abs(delta).max() < 60.5  # 0 us would be -180 deg
    assert delta[40] == pytest.approx(-501.0 / 500.0 * 60.0, abs=0.1)


def test_centidegrees_and_steps_of_a_unit(trial_import):
    table = logged(T)
    expected = imported(trial_import, table)
    table["HDG"], table["surge"] = np.round(table["HDG"] * 100.0), np.round(table["surge"] * 10.0)
    found = imported(
        trial_import, table, psi='{ column = "HDG", unit = "cdeg" }', u='{ column = "surge", unit = "0.1 kn" }'
    )
    np.testing.assert_allclose(found[:, 2], expected[:, 2], atol=1e-3)
    np.testing.assert_allclose(found[:, 3], expected[:, 3], atol=0.03)


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ('{ unit = "rpm" }', "no column; accepted: one of column, mean"),
        ('{ column = "rpm", mean = ["a", "b"], unit = "rpm" }', "column and mean; accepted: one of"),
        ('{ mean = ["a"], unit = "rpm" }', "at least 2"),
        ('{ diff = ["rpm", "b"], unit = "rpm" }', "'b'"),
        ('{ atan2 = ["rpm", "rudder"], unit = "deg" }', "atan2 makes radians"),
        ('{ column = "rpm", unit = "rpm", full = 3.0 }', "Remove full"),
        ('{ column = "rpm", unit = "%", full = 0.0, full_unit = "rpm" }', "factor or full is 0"),
        ('{ column = "rpm", unit = "rpm", factor = 1e-300 }', "factor or full is 0 or next to it"),
        ('{ column = "rpm", unit = "rpm", factor = 1e300 }', "less than or equal to 1000000000000"),
        ('{ column = "rpm", unit = "1e300 rpm" }', "unit of 'n' '1e300 rpm'"),
        ('{ column = "rpm", unit = "rpm", hemisphere = "surge" }', "hemisphere serves a lat or lon"),
        ('{ column = "rpm", unit = "ddmm.mmmm" }', "unit of 'n' 'ddmm.mmmm'"),
        ('{ column = "rpm", unit = "0 rpm" }', "unit of 'n' '0 rpm'"),
    ],
)
def test_an_entry_that_means_nothing_is_refused(trial_import, entry, told):
    refused = trial_import(logged(T), mapping(body=channels(n=entry)))
    assert refused.exit_code == 2
    assert told in refused.stderr
