"""FMUs of FMI 2.0 and 3.0: valid, and with the numbers of predict in FMPy."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest
from exporting_cases import CURRENT, GEARS, LONG, PHYSICS, largest

from shipbench.errors import InputError, WorkError
from shipbench.exporting import fmu
from shipbench.exporting.step import TOLERANCE, step_of
from shipbench.kept_code import compiler
from shipbench.signals import STATES

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


class _Unit:
    """FMU in FMPy, initialised with a start state, to step by hand."""

    def __init__(self, path: Path, s0=None, u=None) -> None:
        fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (extra `fmu`)")
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        told = fmpy.read_model_description(str(path))
        self.folder = fmpy.extract(str(path))
        self.vr = {v.name: v.valueReference for v in told.modelVariables}
        self.inputs = [self.vr[v.name] for v in told.modelVariables if v.causality == "input"]
        two = told.fmiVersion == "2.0"
        self.fmu = (FMU2Slave if two else FMU3Slave)(
            guid=told.guid,
            unzipDirectory=self.folder,
            modelIdentifier=told.coSimulation.modelIdentifier,
            instanceName="ship",
        )
        self.set, self.get = (self.fmu.setReal, self.fmu.getReal) if two else (self.fmu.setFloat64, self.fmu.getFloat64)
        self.fmu.instantiate()
        if two:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        if s0 is not None:
            self.set([self.vr[f"{name}_start"] for name in STATES], [float(v) for v in s0])
            self.set(self.inputs, [float(v) for v in u])
        self.fmu.exitInitializationMode()
        self.time = 0.0

    def step(self, u, length: float) -> list[float]:
        self.set(self.inputs, [float(v) for v in u])
        self.fmu.doStep(self.time, length)
        self.time += length
        return self.states()

    def states(self) -> list[float]:
        return list(self.get([self.vr[name] for name in STATES]))

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


@pytest.fixture
def unit(tmp_path):
    """Writes an FMU and opens it."""
    opened = []

    def make(step, fmi, *start):
        fmu.write(step, "ship", tmp_path / f"ship{fmi}.fmu", fmi=fmi)
        opened.append(_Unit(tmp_path / f"ship{fmi}.fmu", *start))
        return opened[-1]

    yield make
    for one in opened:
        one.close()


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("spec", "options"), [PHYSICS[3], *LONG])
def test_it_is_valid_and_gives_the_prediction(made, unit, tmp_path, spec, options, fmi):
    validation = pytest.importorskip("fmpy.validation", reason="FMPy is not installed (extra `fmu`)")
    step = step_of(made(spec, **options))
    found = step.reference
    one = unit(step, fmi, found.s0, found.U[0])
    assert validation.validate_fmu(str(tmp_path / f"ship{fmi}.fmu")) == []
    assert one.states() == list(found.s0)
    S = np.array([one.step(u, step.model.dt) for u in found.U])
    assert largest(S, found.S) < TOLERANCE


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_fmpy_simulates_it(made, tmp_path, fmi):
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (extra `fmu`)")
    step = step_of(made("physics"))
    fmu.write(step, "ship", tmp_path / "ship.fmu", fmi=fmi)
    U = np.repeat(step.reference.U[:1], 20, axis=0)
    found = fmpy.simulate_fmu(
        str(tmp_path / "ship.fmu"), stop_time=20.0, output_interval=1.0, start_values={"psi_start": 1.0}, output=STATES
    )
    s0 = step.reference.s0.copy()
    s0[2] = 1.0
    S = step.model.predict(s0, U)
    assert largest(np.array([list(row)[1:] for row in found])[1:], S) < TOLERANCE


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_communication_steps_are_multiples_or_parts_of_the_sample_time(made, unit, fmi):
    step = step_of(made("physics+current[speed=0.4,to=1.0]"))
    found = step.reference
    one = unit(step, fmi, found.s0, found.U[0])
    u = found.U[0]
    S = step.model.predict(found.s0, np.repeat(u[None], 6, axis=0))
    assert largest(np.array(one.step(u, 3.0)), S[2]) < TOLERANCE
    for length in (0.25, 0.3, 0.45, 1.6, 0.4):
        last = one.step(u, length)
    assert largest(np.array(last), S[5]) < 1e-5


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_delayed_commands_take_multiples_alone(made, unit, fmi):
    step = step_of(made(f"physics+{CURRENT}+{GEARS}"))
    found = step.reference
    one = unit(step, fmi, found.s0, found.U[0])
    with pytest.raises(Exception, match="status 3"):
        one.step(found.U[0], 0.5)
    S = step.model.predict(found.s0, np.repeat(found.U[:1], 2, axis=0))
    assert largest(np.array(one.step(found.U[0], 2.0)), S[1]) < TOLERANCE


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_its_state_can_be_kept_and_set_again(made, unit, fmi):
    step = step_of(made(f"physics+{GEARS}"))
    found = step.reference
    one = unit(step, fmi, found.s0, found.U[0])
    for u in found.U[:30]:
        one.step(u, 1.0)
    get, set_, bytes_of, of_bytes, free = (
        (getattr(one.fmu, name) for name in
         ("getFMUstate", "setFMUstate", "serializeFMUstate", "deSerializeFMUstate", "freeFMUstate"))
        if fmi == 2
        else (getattr(one.fmu, name) for name in
              ("getFMUState", "setFMUState", "serializeFMUState", "deserializeFMUState", "freeFMUState"))
    )  # fmt: skip
    state = get()
    first = one.step(found.U[30], 1.0)
    set_(of_bytes(bytes_of(state)))
    assert one.step(found.U[30], 1.0) == first
    free(state)


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_start_cannot_be_set_after_it(made, unit, fmi):
    one = unit(step_of(made("physics")), fmi)
    one.step([90.0, 0.1, 0.0, 0.0], 1.0)
    with pytest.raises(Exception, match="status 3"):
        one.set([one.vr["x_start"]], [5.0])


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_declarations_are_those_of_the_standard(made, tmp_path, fmi):
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (extra `fmu`)")
    fmu.write(step_of(made("physics")), "ship", tmp_path / "ship.fmu", fmi=fmi)
    with zipfile.ZipFile(tmp_path / "ship.fmu") as file:
        file.extractall(tmp_path)
    headers = Path(fmpy.__file__).parent / "c-code"
    for standard in ([], ["-DFMI_HEADERS", f"-I{headers}"]):
        command = ["cc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror", *standard]
        subprocess.run([*command, "-c", f"fmi{fmi}.c", "-o", "out.o"], cwd=tmp_path / "sources", check=True)


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_name_of_a_user_stays_text(made, tmp_path, fmi):
    validation = pytest.importorskip("fmpy.validation", reason="FMPy is not installed (extra `fmu`)")
    model = made("physics", wind=True)
    model.ship = model.ship.model_copy(update={"name": '"><x a="\n*/ #error é\x07'})
    model.inputs = (*model.inputs, "x", 'a"b;c')
    fmu.write(step_of(model), "ship", tmp_path / "ship.fmu", fmi=fmi)
    assert validation.validate_fmu(str(tmp_path / "ship.fmu")) == []
    with zipfile.ZipFile(tmp_path / "ship.fmu") as file:
        text = file.read("modelDescription.xml").decode()
    assert 'name="x_2"' in text
    assert 'name="a_b_c"' in text


@pytest.mark.long
def test_the_same_model_gives_the_same_bytes(made, tmp_path):
    step = step_of(made("physics"))
    for name in ("a", "b"):
        fmu.write(step, "ship", tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_without_a_compiler_other_formats_are_named(made, tmp_path, monkeypatch):
    monkeypatch.setenv("SHIPBENCH_COMPILER", "none")
    compiler.cache_clear()
    try:
        with pytest.raises(InputError, match=r"needs a C compiler.*Install gcc.*--format c"):
            fmu.write(step_of(made("physics")), "ship", tmp_path / "ship.fmu")
    finally:
        compiler.cache_clear()
    assert not list(tmp_path.iterdir())


def test_a_compiler_that_fails_is_one_message(made, tmp_path, monkeypatch):
    monkeypatch.setattr(fmu, "_FLAGS", ("-Dmodel_reset=1",))
    with pytest.raises(WorkError, match=r"the C compiler 'cc' failed: .*error"):
        fmu.write(step_of(made("physics")), "ship", tmp_path / "ship.fmu")


def test_an_unknown_platform_is_one_message(made, tmp_path, monkeypatch):
    monkeypatch.setattr("platform.machine", lambda: "vax")
    with pytest.raises(InputError, match=r"no folder for a library of this platform \(\w+ vax\)"):
        fmu.write(step_of(made("physics")), "ship", tmp_path / "ship.fmu")
