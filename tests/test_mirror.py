"""Mirror: the test of a module stands at the same place below tests/ and bears its name."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
PACKAGE = TESTS.parent / "shipbench"
DECIDING = ("bench", "checking", "contract", "data", "diagnosis", "estimation", "importing", "leaderboard", "metrics")
"""Packages whose modules decide something: what is found, scored, ranked, read or refused."""
ELSEWHERE = {
    "bench/durations": "bench/test_progress.py",
    "bench/predict": "predictors/test_saved.py",
    "bench/provenance": "scenarios/test_find.py",
    "bench/results": "bench/test_bench_export.py",
    "bench/work": "predictors/test_device.py",
    "checking/base": "checking/test_clock_steps.py",
    "checking/finding": "checking/test_applying.py",
    "checking/track": "scenarios/test_sensors_of_receivers.py",
    "contract/rules": "contract/test_contract_check.py",
    "contract/saving": "contract/test_contract_check.py",
    "contract/small": "contract/test_contract_check.py",
    "contract/subject": "predictors/test_contract.py",
    "data/base": "data/test_dataset_specs.py",
    "data/demo": "scenarios/test_demo.py",
    "data/describe": "data/test_dataset_specs.py",
    "data/esso_osaka": "data/test_datasets.py",
    "data/harbour90_noisy": "data/test_coverage.py",
    "data/mat": "data/test_export.py",
    "data/noise": "data/test_coverage.py",
    "data/reread": "diagnosis/preparation/test_record_errors.py",
    "data/sensitivity": "data/test_coverage.py",
    "diagnosis/diagnose": "diagnosis/actuators/test_identify.py",
    "diagnosis/preparation/base": "diagnosis/preparation/test_apparent_wind.py",
    "diagnosis/preparation/log_dropout": "checking/test_speed_log.py",
    "diagnosis/preparation/time_offsets": "estimation/test_budget.py",
    "diagnosis/result": "diagnosis/test_candidates.py",
    "diagnosis/thresholds": "test_thresholds.py",
    "estimation/beside": "predictors/physics_model/test_correction.py",
    "estimation/actuator_fit": "predictors/test_physics.py",
    "estimation/baseline": "estimation/test_gauss_newton.py",
    "estimation/coefficients": "estimation/test_robust_prior.py",
    "estimation/eq2_rollout": "estimation/test_robust_prior.py",
    "importing/blocks": "importing/test_order.py",
    "importing/channels": "importing/test_import_parts.py",
    "importing/mapping": "importing/test_cells.py",
    "importing/numerals": "importing/test_cells.py",
    "importing/ordering": "importing/test_order.py",
    "importing/position": "importing/test_import_parts.py",
    "importing/recordings": "importing/test_order.py",
    "importing/resample": "importing/test_import_parts.py",
    "importing/speeds": "importing/test_import_parts.py",
    "importing/steps": "importing/test_order.py",
    "importing/tables": "importing/test_headerless.py",
    "importing/writer": "importing/test_hostile.py",
    "leaderboard/series": "leaderboard/test_pictures.py",
    "metrics/base": "metrics/test_metrics.py",
}
"""Modules without a test of their name, and a test file that imports them."""
THROUGH = {
    "estimation/gears": "estimation/test_extension.py",
    "estimation/intervals": "estimation/test_extension.py",
    "diagnosis/selection/form_columns": "diagnosis/selection/test_unknown.py",
    "bench/answering": "bench/test_isolate.py",
    "bench/entry": "bench/test_isolate.py",
    "bench/lock": "bench/test_study_folder.py",
    "bench/memory": "bench/test_isolate.py",
    "bench/models": "bench/test_runner.py",
    "bench/notebook_bar": "test_api.py",
    "bench/scoring": "bench/test_runner.py",
    "bench/supervise": "bench/test_isolate.py",
    "checking/actuators": "scenarios/test_planted.py",
    "checking/north": "scenarios/test_planted.py",
    "checking/reading": "scenarios/test_planted.py",
    "checking/response": "scenarios/test_planted.py",
    "checking/rudder_side": "scenarios/test_planted.py",
    "checking/samples": "scenarios/test_planted.py",
    "checking/selection": "scenarios/test_planted.py",
    "checking/spikes": "scenarios/test_planted.py",
    "checking/statistics": "scenarios/test_planted.py",
    "checking/track_findings": "scenarios/test_planted.py",
    "checking/wind": "scenarios/test_planted.py",
    "checking/wind_reading": "scenarios/test_planted.py",
    "data/harbour90": "data/test_datasets.py",
    "diagnosis/evaluation/series": "reports/diagnosis/test_diagnosis_page.py",
    "importing/coordinates": "importing/test_import.py",
    "importing/entries": "importing/test_import.py",
    "importing/excel": "importing/test_import.py",
    "importing/fixes": "importing/test_import.py",
    "importing/importer": "importing/test_import.py",
    "importing/matlab": "importing/test_matlab73.py",
    "importing/propose/assign": "importing/propose/test_propose.py",
    "importing/propose/clock": "importing/propose/test_propose.py",
    "importing/propose/columns": "importing/propose/test_propose.py",
    "importing/propose/evidence": "importing/propose/test_propose.py",
    "importing/propose/groups": "importing/propose/test_propose.py",
    "importing/propose/headless": "importing/propose/test_propose.py",
    "importing/propose/layout": "importing/propose/test_propose.py",
    "importing/propose/partial": "importing/propose/test_propose_logs.py",
    "importing/propose/proposal": "importing/propose/test_propose.py",
    "importing/propose/source": "importing/propose/test_propose.py",
    "importing/propose/stamps": "importing/propose/test_propose.py",
    "importing/propose/text": "importing/propose/test_propose.py",
    "importing/propose/trial": "importing/propose/test_propose.py",
    "importing/propose/units": "importing/propose/test_propose.py",
    "importing/runs": "importing/test_import.py",
    "importing/stamps": "importing/test_import.py",
    "importing/table": "importing/test_import.py",
    "importing/track": "importing/test_import.py",
    "importing/values": "importing/test_import.py",
    "leaderboard/curves": "reports/test_pages_browser.py",
    "leaderboard/verify": "bench/test_submissions.py",
    "metrics/cvdm": "metrics/test_metrics.py",
    "metrics/ed": "metrics/test_metrics.py",
    "metrics/edh": "metrics/test_metrics.py",
    "metrics/final_displacement": "metrics/test_metrics.py",
    "metrics/heading_error": "metrics/test_metrics.py",
    "metrics/position_rmse": "metrics/test_metrics.py",
    "metrics/signal_rmse": "metrics/test_metrics.py",
}
"""Modules that no test imports, and the test file of the command or function that calls them."""


def _public(path: Path) -> bool:
    """Whether a module has a public function."""
    return any(isinstance(n, ast.FunctionDef) and n.name[0] != "_" for n in ast.parse(path.read_text("utf-8")).body)


@cache
def _imported(test: str) -> set[str]:
    """Dotted names of what a test file imports."""
    nodes = ast.walk(ast.parse((TESTS / test).read_text("utf-8")))
    found = [n for n in nodes if isinstance(n, ast.ImportFrom)]
    return {f"{n.module}.{a.name}" for n in found for a in n.names} | {str(n.module) for n in found}


def _unmirrored() -> set[str]:
    """Modules that decide something and have no test file of their name (`test_a_b.py` where `b` alone is taken)."""
    found = set()
    for path in (p for part in DECIDING for p in (PACKAGE / part).rglob("*.py") if p.name[0] != "_" and _public(p)):
        module = path.relative_to(PACKAGE)
        beside = TESTS / module.parent
        names = (f"test_{module.stem}.py", f"test_{module.parent.name}_{module.stem}.py")
        if not any((beside / name).exists() for name in names):
            found.add(module.with_suffix("").as_posix())
    return found


def test_every_module_that_decides_has_a_test_of_its_name_or_is_listed() -> None:
    assert _unmirrored() == ELSEWHERE.keys() | THROUGH.keys()


@pytest.mark.parametrize("module", ELSEWHERE)
def test_the_file_that_tests_a_module_instead_imports_it(module: str) -> None:
    assert f"shipbench.{module.replace('/', '.')}" in _imported(ELSEWHERE[module])


def test_the_files_through_which_others_are_tested_exist() -> None:
    assert all((TESTS / test).exists() for test in THROUGH.values())
    assert not ELSEWHERE.keys() & THROUGH.keys()


def test_every_folder_of_tests_but_that_of_the_stories_mirrors_one_of_the_package() -> None:
    folders = {p.parent.relative_to(TESTS) for p in TESTS.rglob("test_*.py")} - {Path("scenarios")}
    assert not [f for f in folders if not (PACKAGE / f).is_dir()]
