"""Suite of the diagnosis (`shipbench suite diagnosis`): hide effects in simulated trials, diagnose them, keep one row
per case; a crash loses no finished case."""

from __future__ import annotations

import inspect
import json
import math
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from ...bench.progress import Progress, Silent
from ...bench.provenance import code_version, machine
from ...diagnosis.result import Diagnosis
from ...errors import InputError, ShipbenchError, unknown_name
from ...processes import process_pool
from ...records import Dataset
from ...simulate.trials import Trials
from ...storage import write_json
from .cases import KINDS, Case, count, draw_case

Diagnose = Callable[..., Diagnosis]
SCHEMA = 1
_FAILURES = (
    ShipbenchError,
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
)


@dataclass(frozen=True)
class Job:
    """Case and its treatment. oracle: diagnose once more with the true effects as the only candidates; baselines: run
    both of them."""

    kind: str
    index: int
    seed: int
    which: str
    diagnose: Diagnose
    gain: bool = True
    oracle: bool = True
    baselines: bool = True
    plan: Trials = field(default_factory=Trials)

    @property
    def key(self) -> str:
        """Name of the job in file names."""
        return f"{self.which}-{self.kind}-{self.seed}-{self.index:04d}"

    def signature(self) -> dict[str, Any]:
        """Signature that a finished row must have to be kept on resuming."""
        named = f"{self.diagnose.__module__}.{self.diagnose.__qualname__}"
        options = {
            "diagnose": named,
            "gain": self.gain,
            "oracle": self.oracle,
            "baselines": self.baselines,
            "plan": repr(self.plan),
        }
        return {"schema": SCHEMA, "source": code_version()["source"], **options}


@threadpool_limits.wrap(limits=1)  # workers share the cores, and sums in another number of threads round differently
def run_case(job: Job) -> dict[str, Any]:
    """Row of one case; an exception becomes the reason of its row."""
    row: dict[str, Any] = {
        "key": job.key,
        "kind": job.kind,
        "index": job.index,
        "seed": job.seed,
        "which": job.which,
        "signature": job.signature(),
    }
    try:
        case = draw_case(job.kind, job.index, job.seed, job.which, job.plan)
        row |= _case_row(case)
        dataset = case.dataset()
        found = job.diagnose(dataset, gain=job.gain, seed=job.seed)
        row |= _found_row(found) | {"status": "ok", "reason": ""}
        if job.oracle and job.gain and case.truth and case.kind in ("single", "pair"):
            row["oracle_gain"] = _oracle_gain(job, dataset, case.truth)
        if case.truth and case.kind in ("single", "pair"):
            row["bound"] = _bound(case, dataset)
        if job.baselines:
            row["baselines"] = _baselines(dataset)
    except _FAILURES as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        row |= {
            "status": "failed",
            "reason": f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})",
        }
    return row


def _case_row(case: Case) -> dict[str, Any]:
    return {
        "ship": case.ship.name, "truth": list(case.truth), "size": [round(s, 4) for s in case.size],
        "values": case.values(),
        "variables": sorted(case.variables), "detail": case.detail,
    }  # fmt: skip


def _found_row(found: Diagnosis) -> dict[str, Any]:
    causes = found.document()["causes"]  # without NaN
    estimates = {c["effect"]: {k: [e["value"], *e["ci95"]] for k, e in c["parameters"].items()} for c in causes}
    return {
        "verdict": found.verdict, "named": [c.effect for c in found.causes],
        "confused": {c.effect: list(c.confused_with) for c in found.causes},
        "scores": {c.effect: c.score for c in found.causes}, "p_values": {c.effect: c.p_value for c in found.causes},
        "evidence": {c.effect: c.evidence for c in found.causes}, "estimates": estimates, "unknown": found.unknown,
        "gain": None if found.gain is None else found.gain.relative, "warnings": list(found.warnings),
        "seconds": round(found.seconds, 2),
    }  # fmt: skip


def _oracle_gain(job: Job, dataset: Dataset, truth: tuple[str, ...]) -> float | None:
    """Gain of the oracle's model, with the true causes given: the upper bound of a diagnosis. None where the diagnosing
    function cannot be given them."""
    if "only" not in inspect.signature(job.diagnose).parameters:
        return None
    found = job.diagnose(dataset, gain=True, seed=job.seed, only=truth)
    return None if found.gain is None else found.gain.relative


def _bound(case: Case, dataset: Dataset) -> float:
    """Power of the likelihood-ratio test in which only the presence of the effect is unknown."""
    from .oracle_bound import bound

    return bound(dataset, [(item.effect, item.q) for item in case.effects])


def _baselines(dataset: Dataset) -> dict[str, Any]:
    from .baselines import derivative_regression, white_residual_test

    methods = {"white residuals": white_residual_test, "derivative regression": derivative_regression}
    found = {name: method(dataset) for name, method in methods.items()}
    return {
        name: {"named": list(r.named), "best": [[n, round(s, 2)] for n, s in r.ranking[:3]]}
        for name, r in found.items()
    }


def run_suite(
    out: Path, *, diagnose: Diagnose, seed: int = 0, seeds_per_effect: int = 3, which: str = "test",
    kinds: Sequence[str] = KINDS, workers: int = 2,
    resume: bool = True, gain: bool = True, oracle: bool = True, baselines: bool = True, plan: Trials | None = None,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:  # fmt: skip
    """Run all cases in processes of one thread each (in this process with `workers` of 1) and keep every row in
    `out/rows` as it is made.

    Returns:
        Rows in the order of the cases. With `resume`, rows of the same code and options are taken from `out`.

    Raises:
        InputError: an unknown kind, or no draws.
        WorkError: a worker died (memory); what is done stays done.
    """
    for kind in kinds:
        if kind not in KINDS:
            raise unknown_name("kind of case", kind, KINDS)
    if seeds_per_effect < 1 or workers < 1:
        raise InputError(f"draws per effect: {seeds_per_effect}, workers: {workers}; accepted: whole numbers from 1.")
    plan, progress = plan or Trials(), progress or Silent()
    places = [(kind, index) for kind in dict.fromkeys(kinds) for index in range(count(kind, seeds_per_effect))]
    jobs = [Job(kind, index, seed, which, diagnose, gain, oracle, baselines, plan) for kind, index in places]
    rows = {job.key: row for job in jobs if resume and (row := _kept(out, job)) is not None}
    todo = [job for job in jobs if job.key not in rows]
    progress.start(len(todo))

    def keep(job: Job, row: dict[str, Any]) -> None:
        rows[job.key] = _plain(row)
        write_json(out / "rows" / f"{job.key}.json", rows[job.key])
        progress.done(job.key, outcome(row))

    if workers == 1 or len(todo) < 2:
        for job in todo:
            progress.working(job.key)
            keep(job, run_case(job))
    else:
        _in_processes(todo, workers, keep)
    progress.finish()
    return [rows[job.key] for job in jobs]


def _in_processes(jobs: Sequence[Job], workers: int, keep: Callable[[Job, dict[str, Any]], None]) -> None:
    with process_pool(workers, "Finished cases are kept: start again with --resume.") as pool:
        waiting = {pool.submit(run_case, job): job for job in jobs}
        try:
            for future in as_completed(waiting):
                keep(waiting[future], future.result())
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _kept(out: Path, job: Job) -> dict[str, Any] | None:
    """Finished row of an earlier run of the same code and options; failed ones are run again."""
    path = out / "rows" / f"{job.key}.json"
    if not path.is_file():
        return None
    row = json.loads(path.read_text(encoding="utf-8"))
    return row if row.get("signature") == job.signature() and row.get("status") == "ok" else None


def _plain(value: Any) -> Any:
    """Value for JSON: six digits, no NaN, no numpy."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    value = value.item() if hasattr(value, "item") else value
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int) else str(value)


def outcome(row: dict[str, Any]) -> str:
    """Row in a few words."""
    if row["status"] != "ok":
        return row["reason"]
    hidden = " + ".join(row["truth"]) or row["detail"].get("name", "nothing")
    return f"ok: {hidden} -> {', '.join(row['named']) or row['verdict']}"


def suite_command(
    *, diagnose: Diagnose, seed: int = 0, per_effect: int = 3, kinds: str | None = None, development: bool = False,
    out: Path | None = None,
    resume: bool = False, workers: int = 2, page: Path | None = None, baselines: bool = True,
    plan: Trials | None = None,
    progress: Progress | None = None, command: str = "shipbench suite diagnosis", gain: bool = True,
) -> tuple[Path, list[dict[str, Any]]]:  # fmt: skip
    """Run `shipbench suite diagnosis`, save rows and page.

    Args:
        kinds: names separated by commas (default all).
        gain: with the cross-validated gain of every diagnosis and of the oracle (four times the time).
        out: folder of the rows (default runs/suite_diagnosis, with -development for that).
        page: folder of `diagnosis.md` and `diagnosis.json`; default `leaderboards` for the whole suite on test ships,
            else `out`.

    Returns:
        Path of the page, and the rows.
    """
    from .page import write_page

    which, plan = "development" if development else "test", plan or Trials()
    chosen = tuple(k.strip() for k in kinds.split(",") if k.strip()) if kinds else KINDS
    out = out or Path("runs") / ("suite_diagnosis-development" if development else "suite_diagnosis")
    folder = page or (Path("leaderboards") if set(chosen) == set(KINDS) and not development else out)
    rows = run_suite(
        out,
        diagnose=diagnose,
        seed=seed,
        seeds_per_effect=per_effect,
        which=which,
        kinds=chosen,
        workers=workers,
        resume=resume,
        gain=gain,
        oracle=gain,
        baselines=baselines,
        plan=plan,
        progress=progress,
    )
    about = {
        "runs": plan.runs, "samples": plan.samples, "command": command, "seed": seed, "per_effect": per_effect,
        "which": which, "workers": workers,
        "code": code_version(), "machine": machine(),
    }  # fmt: skip
    return write_page(folder, rows, about), rows
