"""The folder of C: compiled without a warning, it gives the numbers of predict."""

from __future__ import annotations

import shutil
import subprocess

import pytest
from exporting_cases import LONG, PHYSICS

from shipbench.exporting import c_code
from shipbench.exporting.step import step_of

COMPILER = shutil.which("cc") or ""
pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler")
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1")


def _tested(folder) -> subprocess.CompletedProcess[str]:
    subprocess.run([COMPILER, *FLAGS, "-o", "test", "test.c", "model.c", "-lm"], cwd=folder, check=True)
    return subprocess.run([folder / "test"], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(("spec", "options"), [PHYSICS[3], *LONG])
def test_its_own_test_passes(made, tmp_path, spec, options):
    c_code.write(step_of(made(spec, **options)), "ship", tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == c_code.FILES
    done = _tested(tmp_path)
    assert done.returncode == 0, done.stdout
    assert done.stdout.startswith("ok: 60 steps")


def test_its_test_fails_where_a_number_differs(made, tmp_path):
    c_code.write(step_of(made("physics")), "ship", tmp_path)
    text = (tmp_path / "model.c").read_text()
    (tmp_path / "model.c").write_text(text.replace("s[2] = ", "s[2] = 1e-8 + "))
    done = _tested(tmp_path)
    assert done.returncode == 1
    assert "FAILED: step 0, state 2" in done.stdout


@pytest.mark.long
def test_the_header_tells_every_channel_with_its_unit(made):
    text = c_code.header(step_of(made("physics", wind=True)), "ship")
    for words in (
        "[2] psi [rad]: heading, clockwise from north", "[6] n [rpm]", "[6] wind_from [rad]", "#define SHIP_DT 1.0",
        "p10", "N s^2/m^2", "any time up to SHIP_DT",
    ):  # fmt: skip
        assert words in text
    assert "always SHIP_DT" in c_code.header(step_of(made("physics+rudder_delay[delay=1.3]")), "ship")


def test_the_name_of_a_ship_stays_in_its_comment(made, tmp_path):
    model = made("physics")
    model.ship = model.ship.model_copy(update={"name": '*/ #error out\n#error "\\ ??/ **/ /* é½'})
    c_code.write(step_of(model), "ship", tmp_path)
    assert _tested(tmp_path).returncode == 0
