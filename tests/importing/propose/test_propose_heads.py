"""Heads and units in English, German, French, Spanish and Norwegian: the channel that is named, and what is no
channel."""

from __future__ import annotations

import pytest

from shipbench.importing.propose.heads import read_head, units_of

HEADS = {
    "psi": (
        "HDG (deg)|Heading (true)|Steuerkurs [°]|Kurs rechtweisend|cap (°)|cap vrai|rumbo verdadero|guiñada "
        "[°]|baugretning|psi_hat [rad]|yaw"
    ),
    "cog": (
        "COG|Kurs über Grund [°]|Kurs ueber Grund|route fond (°)|rumbo sobre el fondo|kurs over "
        "grunn|navigation.courseOverGroundTrue"
    ),
    "sog": (
        "SOG [kn]|speed over ground|Fahrt über Grund (Knoten)|vitesse fond (nœuds)|velocidad sobre el fondo|fart "
        "over grunn [knop]"
    ),
    "lat": "Latitude|GNSS Lat [deg]|lat_e7|Breite|geogr. Breite|latitud|breddegrad|gps.lat",
    "lon": "lon|Länge|Laenge|longitud|lengdegrad",
    "x": "x_position_mid [m]|Northing|Hochwert [m]|norte (m)",
    "y": "east|Rechtswert [m]|este|øst [m]|Easting",
    "u": "u_velo [m/s]|surge|Längsgeschwindigkeit [kn]|vitesse longitudinale|velocidad de avance|jaghastighet|u_m_s"
    "|Surge_ms",
    "v": "vm_velo [m/s]|sway velocity|Quergeschwindigkeit|vitesse latérale|velocidad lateral|svaihastighet",
    "r": (
        "ROT [deg/min]|rate of turn|Drehrate [°/min]|taux de giration (°/min)|velocidad de giro|svinghastighet "
        "[°/min]|wz|r_angvelo [rad/s]|YawRate_degs|yaw_rate_rads"
    ),
    "n": "shaft speed [rpm]|Drehzahl [1/min]|Wellendrehzahl [U/min]|régime [tr/min]|"
    "revoluciones|turtall [o/min]|n_prop [rps]|propulsion.port.revolutions",
    "delta": "Rudder Angle [°]|Ruder [°]|Ruderlage|barre (°)|angle de safran [°]|"
    "timón [grados]|ror [grader]|rorvinkel|steering.rudderAngle|rudder [%]",
    "delta_c": (
        "rudder_cmd [deg]|Rudder Order|Ruderwinkel Soll [°]|consigne barre (°)|orden timón|rorvinkel ordre|delta_c"
    ),
    "wind_speed": (
        "wind speed [m/s]|wind_velo_true [m/s]|Windgeschwindigkeit|vitesse du vent|velocidad del viento|vindhastighet"
    ),
    "apparent_wind_from": "AWA|wind_dir_relative_mid [rad]|apparent wind angle",
    "F_b": "F_b_kN|Bow thruster [kN]",
    None: "shaft power [kW]|UKC [m]|Rudder rate [deg/s]|HeadingSet|SpeedSet|x_p|xe_upper|Voltage|"
    "cheese|heave|GPS quality|r_max|Speed|Kurs|STW [kn]|qx",
}


@pytest.mark.parametrize(
    ("channel", "head"), [(channel, head) for channel, heads in HEADS.items() for head in heads.split("|")]
)
def test_a_head_names_its_channel_and_no_other(channel, head):
    found = read_head(head)
    assert (found.channel if found.fits else None) == channel


@pytest.mark.parametrize(
    ("quantity", "unit", "words"),
    [
        ("angle", "deg", "deg|°|degrees|Grad|degrés|grados|grader|º"),
        ("speed", "kn", "kn|kt|kts|knots|Knoten|nœuds|nudos|knop"),
        ("speed", "m/s", "m/s|mps|m s-1|m·s⁻¹"), ("rate", "deg/min", "deg/min|°/min|Grad/min|degrés/min|grados/min"),
        ("shaft", "rpm", "rpm|1/min|U/min|tr/min|o/min|min-1|r.p.m."), ("shaft", "rev/s", "rps|1/s|Hz|tr/s"),
        ("percent", "%", "%|Prozent|percent"),
        ("force", "kN", "kN"), ("time", "us", "us|µs"), ("angle", "1e-7 deg", "1e-7 deg|degE7"),
    ],
)  # fmt: skip
def test_units_by_their_words(quantity, unit, words):
    for word in words.split("|"):
        assert units_of(word).get(quantity) == unit, word


def test_a_force_in_kilonewton_is_no_speed_in_knots():
    assert "speed" not in units_of("kN")
    assert "force" not in units_of("kn")


@pytest.mark.parametrize(
    ("head", "unit"),
    [("heading_deg", "deg"), ("Fahrt kn", "kn"), ("rudder, deg", "deg"), ("r_deg_s", "deg s"), ("TimeUS", "us")],
)
def test_a_unit_without_brackets_at_the_end(head, unit):
    assert read_head(head).unit == unit


def test_a_row_of_units_counts_before_the_head():
    assert read_head("speed", "knots").units == {"speed": "kn"}
