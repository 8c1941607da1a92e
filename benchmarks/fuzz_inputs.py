"""Fuzzing of the command line: small valid inputs are mutated, and each is given to its commands in a process with
limits.

    python benchmarks/fuzz_inputs.py --each 130 --seed 0 [--only "saved model"] [--keep FOLDER]

Kinds: data set, ship, csv, mapping, mat, xlsx, task, results, saved model, diagnosis. Mutations: bytes flipped, cut,
doubled; values of other types, huge, not finite, nested without end; names with separators and escapes; wrong shapes.
Per kind it counts what came: ok (exit 0), refused (2), failed (1, work that failed), and what must never come:
traceback, crash (ended by a signal), hang (over 60 s), memory (over 2 GB), outside (written elsewhere than --out). A
case at fault is kept, and printed with its command. POSIX only: processes are forked, so that libraries are loaded
once.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import importlib
import io
import json
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

SECONDS, MEMORY = 60.0, 2 << 30
FAULTS = ("traceback", "crash", "hang", "memory", "outside")
COUNTED = ("ok", "refused", "failed", *FAULTS)
Rng = np.random.Generator

DEEP = "[" * 3000 + "]" * 3000
TEXTS = [
    "../../evil",
    "/etc/passwd",
    "a/b\\c",
    ".hidden",
    "\x1b[31mred",
    "a\x00b",
    "=1+1",
    "<script>alert(1)</script>",
    "\u202eabc",
    "x" * 5000,
    "",
    "%s%n",
    "NaN",
]
TOML = ["nan", "inf", "-inf", "1e308", "-1", "0", "1e-320", "9" * 30, "0x" + "f" * 5000, "true", "[]", "{}",
    "[[1, 2], [3]]", "[1e308, nan]", DEEP,
        "1979-05-27T07:32:00Z", '"text"', "{a = {b = {c = 1}}}", "[true, \"1\"]",
        *(json.dumps(t) for t in TEXTS)]  # fmt: skip
JSON = [
    None,
    float("nan"),
    float("inf"),
    1e308,
    -1,
    0,
    10**30,
    True,
    [],
    {},
    [[1, 2], [3]],
    {"a": {"b": [1]}},
    "text",
    [None],
    *TEXTS,
]
CELLS = [
    "nan",
    "inf",
    "1e308",
    "-1e308",
    "",
    "text",
    "9" * 400,
    "1,5",
    '"',
    "\x00",
    "0x10",
    "2024-01-01",
    "true",
    "-",
    "1e",
    *TEXTS,
]


def flipped(content: bytes, rng: Rng) -> bytes:
    """Bytes flipped, cut, doubled, put in or zeroed."""
    data = bytearray(content)
    at = int(rng.integers(len(data) + 1))
    length = int(rng.integers(1, 64))
    match int(rng.integers(6)):
        case 0:
            for _ in range(int(rng.integers(1, 9))):
                if data:
                    data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
        case 1:
            del data[at:]
        case 2:
            data[at:at] = data[at : at + length]
        case 3:
            data[at:at] = rng.bytes(length)
        case 4:
            data[at : at + length] = bytes(len(data[at : at + length]))
        case _:
            del data[at : at + length]
    return bytes(data)


def toml(content: bytes, rng: Rng) -> bytes:
    """A value, key or line of TOML changed."""
    lines = content.decode().splitlines()
    keyed = [k for k, line in enumerate(lines) if " = " in line or "=" in line]
    k = int(rng.choice(keyed))
    key, _, value = lines[k].partition("=")
    match int(rng.integers(6)):
        case 0 | 1 | 2:
            lines[k] = f"{key}= {rng.choice(TOML)}"
        case 3:
            lines[k] = f"{json.dumps(str(rng.choice(TEXTS)))} ={value}"
        case 4:
            lines.insert(k, lines[int(rng.integers(len(lines)))])
        case _:
            del lines[k]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def document(content: bytes, rng: Rng) -> bytes:
    """A value or key of JSON changed, at a random place."""
    return json.dumps(_replaced(json.loads(content), rng)).encode("utf-8", "surrogatepass")


def _replaced(value: object, rng: Rng) -> object:
    """`value` with something inside exchanged, renamed or left out."""
    if isinstance(value, dict | list) and value and rng.random() < 0.85:
        keys = list(value) if isinstance(value, dict) else list(range(len(value)))
        key = keys[int(rng.integers(len(keys)))]
        roll = rng.random()
        if roll < 0.1:
            del value[key]  # type: ignore[arg-type]
        elif roll < 0.15 and isinstance(value, dict):
            value[TEXTS[int(rng.integers(len(TEXTS)))]] = value.pop(key)
        else:
            value[key] = _replaced(value[key], rng)  # type: ignore[index]
        return value
    return JSON[int(rng.integers(len(JSON)))]


def table(content: bytes, rng: Rng) -> bytes:
    """A cell, column, row or the encoding of CSV changed."""
    rows = [line.split(",") for line in content.decode().splitlines()]
    i, j = int(rng.integers(len(rows))), int(rng.integers(len(rows[0])))
    match int(rng.integers(8)):
        case 0 | 1 | 2:
            rows[i][j] = str(rng.choice(CELLS))
        case 3:
            for row in rows:
                del row[j]
        case 4:
            for row in rows[1:]:
                row[j] = str(rng.choice(CELLS))
        case 5:
            rows.insert(i, rows[int(rng.integers(len(rows)))])
        case 6:
            rows[0][j] = rows[0][int(rng.integers(len(rows[0])))]
        case _:
            text = "\n".join(",".join(row) for row in rows)
            return (
                text.replace("\n", "\r").encode()
                if rng.random() < 0.5
                else text.encode(str(rng.choice(["utf-16", "utf-32", "latin-1", "cp500"])), "replace")
            )
    return "\n".join(",".join(row) for row in rows).encode()


def arrays(content: bytes, rng: Rng) -> bytes:
    """An array of a .npz file with another shape, kind or values, or a header that promises more."""
    with np.load(io.BytesIO(content)) as file:
        found = {name: file[name] for name in file.files}
    if not found:
        found = {"a": np.zeros(3)}
    name = str(rng.choice(list(found)))
    array = np.asarray(found[name])
    changes: list[Callable[[], object]] = [
        lambda: array[..., None], lambda: array.ravel()[:1], lambda: np.full(array.shape, np.nan),
        lambda: np.full(array.shape, 1e308),
        lambda: array.astype(str), lambda: np.zeros((0, *array.shape)), lambda: np.zeros(array.shape, dtype=complex),
        lambda: np.float64(3.0),
    ]  # fmt: skip
    roll = int(rng.integers(len(changes) + 2))
    if roll == len(changes):
        del found[name]
    elif roll < len(changes):
        found[name] = changes[roll]()
    made = io.BytesIO()
    np.savez(made, **found)
    if roll < len(changes) + 1:
        return made.getvalue()
    with zipfile.ZipFile(made) as packed, zipfile.ZipFile(huge := io.BytesIO(), "w") as other:
        for part in packed.namelist():
            other.writestr(part, re.sub(rb"\((\d*)", rb"(9000000000, \1", packed.read(part), count=1))
    return huge.getvalue()


def parquet(content: bytes, rng: Rng) -> bytes:
    """A column of Parquet of another kind, renamed, doubled, left out or emptied; or its metadata."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    found = pq.read_table(io.BytesIO(content))
    j = int(rng.integers(found.num_columns))
    name, n = found.column_names[j], found.num_rows
    match int(rng.integers(8)):
        case 0:
            found = found.drop_columns([name])
        case 1:
            found = found.set_column(j, name, pa.array([str(rng.choice(TEXTS))] * n))
        case 2:
            found = found.set_column(j, name, pa.array([float(rng.choice([np.nan, np.inf, 1e308, -1.0]))] * n))
        case 3:
            found = found.append_column(name, found.column(j))
        case 4:
            found = found.rename_columns(
                [str(rng.choice(TEXTS)) if k == j else c for k, c in enumerate(found.column_names)]
            )
        case 5:
            found = found.slice(0, int(rng.integers(n)))
        case 6:
            found = found.set_column(j, name, pa.array([[1.0]] * n) if rng.random() < 0.5 else pa.nulls(n))
        case _:
            found = found.replace_schema_metadata(
                {
                    "pandas": str(
                        rng.choice(["{", "[]", '{"index_columns": [3]}', '{"columns": 1}', '{"index_columns": ["t"]}'])
                    )
                }
            )
    pq.write_table(found, made := io.BytesIO())
    return made.getvalue()


def packed(content: bytes, rng: Rng) -> bytes:
    """A part of a workbook changed, and packed again."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as file, zipfile.ZipFile(made, "w") as other:
        chosen = str(rng.choice(file.namelist()))
        for part in file.namelist():
            other.writestr(part, flipped(file.read(part), rng) if part == chosen else file.read(part))
    return made.getvalue()


KNOWING = {".toml": toml, ".json": document, ".csv": table, ".npz": arrays, ".parquet": parquet, ".xlsx": packed,
           ".gz": lambda content, rng: gzip.compress(table(gzip.decompress(content), rng))}  # fmt: skip


def mutated(path: Path, rng: Rng) -> bytes:
    """The content of a file after one to three mutations, some that know its form."""
    content, knowing = path.read_bytes(), KNOWING.get(path.suffix)
    if knowing is not None and rng.random() < 0.7:
        with contextlib.suppress(ValueError, IndexError):
            content = knowing(content, rng)
        return content
    for _ in range(int(rng.integers(1, 4))):
        content = flipped(content, rng)
    return content


HOLD = ["run", "-m", "hold", "-d", "ds", "--horizon", "5", "--folds", "2", "--out", "out/r", "-q"]
IMPORT = ["data", "import", "log.csv", "--map", "mapping.toml", "--ship", "ds/ship.toml", "--out", "out/d"]
REPORT = ["report", "res", "--out", "out/r.html", "-q"]
EXPORT = ["data", "export", "ds", "--format", "csv", "--out", "out/d"]
LOADED = (
    "matplotlib.pyplot", "pyarrow.parquet", "scipy.io", "shipbench.cli.app", "shipbench.bench.runner",
    "shipbench.leaderboard.pages",
    "shipbench.reports.study.page", "shipbench.checking", "shipbench.importing.importer", "shipbench.importing.propose",
    "shipbench.data.files",
    "shipbench.predictors.physics",
)  # fmt: skip
KINDS: dict[str, tuple[list[str], list[list[str]]]] = {
    "data set": (
        ["ds/dataset.toml", "ds/trajectories.csv", "dz/trajectories.csv.gz", "dp/trajectories.parquet"],
        [HOLD, ["data", "check", "ds"], ["data", "describe", "ds"], EXPORT],
    ),
    "ship": (["ds/ship.toml"], [HOLD, ["data", "check", "ds"], EXPORT]),
    "csv": (["log.csv"], [IMPORT, ["data", "import", "log.csv", "--propose", "out/m.toml"]]),
    "mapping": (["mapping.toml"], [IMPORT]),
    "mat": (["log.mat", "set.mat"], [["MAT"]]),
    "xlsx": (
        ["log.xlsx"],
        [["data", "import", "log.xlsx", *IMPORT[3:]], ["data", "import", "log.xlsx", "--propose", "out/m.toml"]],
    ),
    "task": (["task.toml"], [["run", "--config", "task.toml", "--out", "out/r", "-q"]]),
    "results": (
        ["res/*.json", "res/*.parquet", "res/cells/*/*/*/*.*", "res/truth/*/*"],
        [["leaderboard", "res", "--verify", "--out", "out/l"], REPORT],
    ),
    "saved model": (
        ["res/cells/*/*/fold0-seed0/model/*"],
        [["predict", "MODEL", "ds", "--out", "out/p.csv"], [*HOLD[:2], "MODEL", *HOLD[3:]]],
    ),
    "diagnosis": (["diagnosis/diagnosis.json"], [[*REPORT, "--diagnosis", "diagnosis"]]),
}


def make_base(folder: Path) -> None:
    """Small valid inputs of every kind in `folder`."""
    from scipy.io import savemat

    from shipbench.data.files import write_dataset
    from shipbench.data.mat import write_mat
    from shipbench.records import Dataset, Run
    from shipbench.ship import Propeller, Rudder, Ship, Thrusters, Wind

    t = np.arange(16.0)
    runs = []
    for k, rate in enumerate((0.0, 0.01, -0.01, 0.02)):
        states = np.zeros((16, 10))
        states[:, 2], states[:, 3], states[:, 5], states[:, 6], states[:, 7] = rate * t, 4.0, rate, 90.0, 10 * rate
        states[:, 0], states[:, 1] = np.cumsum(4 * np.cos(rate * t)) - 4, np.cumsum(4 * np.sin(rate * t))
        inputs = np.column_stack([states[:, 6:8], np.zeros((16, 2)), np.full(16, 5.0), np.full(16, 0.3)])
        names = ("n_c", "delta_c", "F_b_c", "F_s_c", "wind_speed", "wind_from")
        runs.append(Run(f"run{k}", t, states, inputs, names, {"manoeuvre": "turn", "group": f"g{k}"}))
    ship = Ship(
        name="small", L=50.0, B=8.0, T=3.0, mass=9e5, Cb=0.73, propeller=Propeller(diameter=2.0, kt=(0.3, -0.3, -0.1)),
        rudder=Rudder(area=3.0, height=2.0),
        thrusters=Thrusters(x_bow=20.0, x_stern=-20.0, max_force=1e4), wind=Wind(frontal_area=60.0, lateral_area=300.0),
    )  # fmt: skip
    data = Dataset("circles", ship, 1.0, tuple(runs), source="a formula", licence="MIT")
    for name, form in (("ds", "csv"), ("dz", "csv.gz"), ("dp", "parquet")):
        write_dataset(data, folder / name, form)  # type: ignore[arg-type]
    write_mat(data, folder / "set.mat")
    with (folder / "ds" / "dataset.toml").open("a") as file:
        file.write(
            'cut = [[3.0, 4.0]]\nfill = {r = [[5.0, 6.0]]}\n[units]\nu = "m/s"\n[signs]\ndelta = "starboard"\n'
            "[scale]\nv = 1.0\n[delay]\nr = 0.0\n"
        )
    states = runs[1].states
    log = {
        "time": t, "lat": 52 + states[:, 0] / 111e3, "lon": 4 + states[:, 1] / 69e3,
        "heading": np.rad2deg(states[:, 2]) % 360,
        "rpm": states[:, 6], "rudder": np.rad2deg(states[:, 7]),
    }  # fmt: skip
    lines = [",".join(log), *(",".join(f"{v:.7f}" for v in row) for row in zip(*log.values(), strict=True))]
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    savemat(folder / "log.mat", log)
    import openpyxl

    book = openpyxl.Workbook()
    for line in lines:
        book.active.append([cell if cell.isalpha() else float(cell) for cell in line.split(",")])
    book.save(folder / "log.xlsx")
    (folder / "mapping.toml").write_text(
        'name = "trial"\ndt = 1.0\nactuators = "measured"\n[time]\ncolumn = "time"\nformat = "s"\n[file]\n'
        'decimal = "."\n'
        "[split]\ngap = 5.0\nshortest = 2.0\n"
        '[channels.lat]\ncolumn = "lat"\nunit = "deg"\n[channels.lon]\ncolumn = "lon"\nunit = "deg"\n'
        '[channels.psi]\ncolumn = "heading"\nunit = "deg"\n'
        '[channels.n]\ncolumn = "rpm"\nunit = "rpm"\n[channels.delta]\ncolumn = "rudder"\nunit = "deg"\n'
        'sign = "starboard"\n'
    )
    (folder / "task.toml").write_text(
        'dataset = "ds"\nmodels = ["hold"]\nhorizon_s = 5.0\nhistory_s = 1.0\nfolds = 2\nsplit = "folds"\n'
        "stride_s = 5.0\n"
        'seeds = [0]\nmetrics = ["ed", "edh"]\n'
        'valid_runs = 1\nmax_runs = 4\nfold_seed = 0\ntitle = "a title"\n'
    )
    code, _, said = run_alone(["run", "-m", "physics", *HOLD[1:9], "--out", "res", "-q"], folder, folder)
    if code:
        raise RuntimeError(f"the valid study ends with {code}: {said}")
    interval = {"value": 0.3, "unit": "m/s", "ci95": [0.2, 0.4]}
    gain = {"metric": "ED", "before": 3.0, "after": 1.0, "relative": 0.6, "ci95": [0.5, 0.7], "runs_better": "4/4"}
    cause = {
        "effect": "current",
        "rank": 1,
        "in_words": "A current.",
        "parameters": {"speed": interval},
        "p_value": 0.01,
        "confused_with": [],
        "gain": gain,
    }
    (folder / "diagnosis").mkdir()
    (folder / "diagnosis" / "diagnosis.json").write_text(json.dumps({
        "schema": 1, "dataset": "circles", "base_model": "physics", "verdict": "found", "causes": [cause],
        "candidates": [], "what_is_wrong": [],
        "extended_model": "physics+current", "fingerprint": data.fingerprint, "seconds": 1.0,
    }))  # fmt: skip


def run_alone(arguments: list[str], folder: Path, case: Path) -> tuple[int, float, str]:
    """Exit code (negative: the signal; 124: a hang), greatest memory [bytes] and last words of a command that runs in
    `folder`, forked."""
    said = case / "said.txt"
    process = os.fork()
    if process == 0:
        _child(arguments, folder, said)
    began = time.monotonic()
    while (found := os.wait4(process, os.WNOHANG))[0] == 0:
        if time.monotonic() - began > SECONDS:
            os.killpg(process, signal.SIGKILL)
            os.wait4(process, 0)
            return 124, 0.0, "no end"
        time.sleep(0.003)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)  # whatever it left behind
    return os.waitstatus_to_exitcode(found[1]), found[2].ru_maxrss * 1024.0, said.read_text(errors="replace")[-4000:]


def _child(arguments: list[str], folder: Path, said: Path) -> None:
    code = 99
    try:
        os.setsid()
        os.chdir(folder)
        out = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        used = (
            int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
            if Path("/proc/self/statm").exists()
            else 0
        )
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        from shipbench.cli.app import main

        sys.argv = ["shipbench", *arguments]
        main()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def files_of(case: Path) -> dict[str, tuple[int, int]]:
    """Size and time of every file of a case but those that the command may write."""
    free = (case / "work" / "out", case / "said.txt", case / "tmp")
    found = {}
    for path in case.rglob("*"):
        if not any(path == place or place in path.parents for place in free) and path.is_file():
            about = path.stat()
            found[str(path)] = (about.st_size, about.st_mtime_ns)
    return found


def one(
    base: Path, case: Path, kind: str, rng: Rng, mutate: Callable[[Path, Rng], bytes] = mutated
) -> tuple[str, list[str], str]:
    """Mutate one file of a kind in a fresh copy, run one of its commands, and tell what came, the command, and its last
    words."""
    work = case / "work"
    shutil.copytree(base, work)
    (work / "out").mkdir()
    (case / "tmp").mkdir()
    patterns, commands = KINDS[kind]
    pattern = patterns[int(rng.integers(len(patterns)))]
    places = sorted(path for path in work.glob(pattern) if path.is_file())
    path = places[int(rng.integers(len(places)))]
    path.write_bytes(mutate(path, rng))
    command = list(commands[int(rng.integers(len(commands)))])
    name = path.relative_to(work).parts[0]
    if command == ["MAT"]:
        command = ["data", "import", name, *IMPORT[3:]] if name == "log.mat" else ["data", "export", name, *EXPORT[3:]]
    command = [
        name
        if word == "ds" and name in ("dz", "dp")
        else str(path.parent.relative_to(work))
        if word == "MODEL"
        else word
        for word in command
    ]
    before, around = files_of(case), sorted(os.listdir(case.parent))
    os.environ |= {"HOME": str(case), "TMPDIR": str(case / "tmp")}
    tempfile.tempdir = None
    code, memory, said = run_alone(command, work, case)
    if files_of(case) != before or sorted(os.listdir(case.parent)) != around:
        return "outside", command, said
    if memory > MEMORY or "MemoryError" in said:
        return "memory", command, said
    if "Traceback (most recent call last)" in said or code == 99:
        return "traceback", command, said
    if code == 124:
        return "hang", command, said
    return {0: "ok", 1: "failed", 2: "refused"}.get(code, "crash"), command, said


def fuzz(
    each: int, seed: int, folder: Path, kinds: list[str] | None = None, tell: Callable[[str], None] = print
) -> dict[str, Counter[str]]:
    """Counts per kind; `folder` is empty, and keeps the cases that are at fault, of which `tell` gets a line each."""
    # What commands keep for the user, and must be able to write, lies apart from the cases.
    os.environ |= {
        "SHIPBENCH_CACHE": str(folder / "cache"),
        "MPLCONFIGDIR": str(folder / "matplotlib"),
        "SHIPBENCH_COMPILER": "none",
    }
    for library in LOADED:  # before the processes fork
        importlib.import_module(library)
    home = {name: os.environ.get(name) for name in ("HOME", "TMPDIR")}
    base, cases = folder / "base", folder / "cases"
    base.mkdir()
    cases.mkdir()
    make_base(base)
    (base / "said.txt").unlink()
    counts: dict[str, Counter[str]] = {}
    try:
        for kind in kinds or list(KINDS):
            counts[kind] = Counter()
            for k in range(each):
                case = cases / f"{kind.replace(' ', '-')}-{k}"
                case.mkdir()
                came, command, said = one(base, case, kind, np.random.default_rng([seed, list(KINDS).index(kind), k]))
                counts[kind][came] += 1
                if came in FAULTS:
                    last = said.strip().splitlines()[-1:] or [""]
                    tell(f"{came}: {case / 'work'}: shipbench {' '.join(command)}: {last[0][:300]}")
                else:
                    shutil.rmtree(case)
    finally:
        for name, value in home.items():
            os.environ.pop(name, None) if value is None else os.environ.update({name: value})
        tempfile.tempdir = None
    return counts


def main() -> None:
    """Print the counts of a run as a table; exit 1 if anything came that must not."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--each", type=int, default=130, help="inputs of each kind")
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--only", action="append", choices=list(KINDS))
    options.add_argument(
        "--keep", type=Path, help="folder for the cases at fault (default: a new one among the temporary files)"
    )
    given = options.parse_args()
    folder = given.keep or Path(tempfile.mkdtemp(prefix="fuzz-"))
    folder.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    counts = fuzz(given.each, given.seed, folder, given.only, lambda line: print(line, file=sys.stderr, flush=True))
    print(f"seed {given.seed}, {sum(c.total() for c in counts.values())} inputs, {time.monotonic() - began:.0f} s")
    print(f"| kind | {' | '.join(COUNTED)} |\n|---|{'---:|' * len(COUNTED)}")
    for kind, found in counts.items():
        print(f"| {kind} | {' | '.join(str(found[what]) for what in COUNTED)} |")
    sys.exit(any(found[what] for found in counts.values() for what in FAULTS))


if __name__ == "__main__":
    main()
