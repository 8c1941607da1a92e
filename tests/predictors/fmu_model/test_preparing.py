"""Preparation of an FMU: platform, source, kind and step."""

from __future__ import annotations

import shutil

import made_fmu
import numpy as np
import pytest
from made_fmu import STATES, description, sail_fmu, write_archive

from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor
from shipbench.predictors.fmu_model.description import read_description
from shipbench.predictors.fmu_model.mapping import mapping_of
from shipbench.predictors.fmu_model.preparing import Prepared, kind_of, plan_of, prepare


def test_an_fmu_for_another_platform_without_source_is_one_message(tmp_path):
    files: dict[str, str | bytes] = {"modelDescription.xml": description(), "binaries/win64/ship.dll": b"MZ"}
    path = write_archive(tmp_path / "ship.fmu", files)
    with pytest.raises(
        InputError, match=r"has libraries for win64 and no source; needed: linux64 \(ship\.so\)\. Export"
    ):
        prepare(read_description(path), "co-simulation")


WITHOUT, WITH = (
    'canHandleVariableCommunicationStepSize="true"/>',
    'canHandleVariableCommunicationStepSize="true"><SourceFiles><File name="ship.c"/></SourceFiles></CoSimulation>',
)


@pytest.mark.long
def test_source_that_does_not_compile_is_one_message(tmp_path):
    files = {"modelDescription.xml": description().replace(WITHOUT, WITH), "sources/ship.c": "no C"}
    path = write_archive(tmp_path / "ship.fmu", files)
    with pytest.raises(InputError, match="no library for this platform, and its source does not compile"):
        prepare(read_description(path), "co-simulation")


@pytest.mark.long
@pytest.mark.skipif(shutil.which("gcc") is None or shutil.which("make") is None, reason="needs gcc and make")
def test_source_is_compiled_where_there_is_no_library(tmp_path):
    source = f"#define FMI 2\n{made_fmu.source()}"
    files = {"modelDescription.xml": description().replace(WITHOUT, WITH), "sources/ship.c": source}
    path, data = write_archive(tmp_path / "ship.fmu", files), sail_fmu(2, 20)
    model, batch = make_predictor(f"{path}[kind=co-simulation,workers=1]").fit(data), data.batch()
    np.testing.assert_allclose(model.predict(batch.s0, batch.U), batch.truth, atol=1e-9)


@pytest.fixture
def plan(tmp_path):
    def made(kind: str, dt: float, step: float = 0.0, text: str = ""):
        found = read_description(write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": text or description()}))
        return plan_of(found, mapping_of(found), (), kind_of(found, kind), Prepared(), dt, step)

    return made


@pytest.mark.parametrize(
    ("kind", "dt", "step", "substeps"),
    [
        ("co-simulation", 1.0, 0.0, 1),
        ("co-simulation", 1.0, 0.1, 10),
        ("model-exchange", 1.0, 0.0, 4),  # the default experiment's 0.25 s
        ("model-exchange", 0.1, 0.0, 1),
        ("model-exchange", 1.0, 0.5, 2),
    ],
)
def test_the_step_divides_the_sample_time(kind, dt, step, substeps, plan):
    assert plan(kind, dt, step).substeps == substeps


def test_without_a_default_experiment_model_exchange_steps_a_tenth_of_a_second(plan):
    assert (
        plan("model-exchange", 1.0, text=description().replace('<DefaultExperiment stepSize="0.25"/>', "")).substeps
        == 10
    )


def test_the_folder_of_an_fmu_goes_with_it():
    prepared = Prepared()
    folder = prepared.folder
    assert folder.is_dir()
    del prepared
    assert not folder.exists()


def test_the_values_are_set_in_the_order_of_the_plan(plan):
    found = plan("co-simulation", 1.0)
    assert list(found.set_refs) == list(range(2, 2 + len(STATES)))
    assert list(found.input_refs) == [0, 1]
