"""FMU for co-simulation, FMI 2.0 or 3.0: description, sources, and a library for this platform."""

from __future__ import annotations

import hashlib
import platform
import subprocess
import sys
import tempfile
import uuid
import zipfile
from importlib.resources import files
from pathlib import Path

from ..errors import InputError, WorkError
from ..kept_code import compiler
from ..signals import STATES
from ..storage import in_one_step
from . import c_code
from .fmi_description import build_description, model_description
from .step import Step

_SECONDS = 120
"""Time limit of the compiler [s]."""
_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
_PLATFORMS = {
    ("linux", "x86_64"): ("linux64", "x86_64-linux", ".so"), ("linux", "aarch64"): (None, "aarch64-linux", ".so"),
    ("darwin", "x86_64"): ("darwin64", "x86_64-darwin", ".dylib"),
    ("darwin", "arm64"): ("darwin64", "aarch64-darwin", ".dylib"),
    ("win32", "amd64"): ("win64", "x86_64-windows", ".dll"),
}  # fmt: skip
"""System and processor: folder of the library in FMI 2.0 and 3.0, end of its name."""
_SHARED = ("co_simulation.h",)


def write(step: Step, name: str, path: Path, fmi: int = 2) -> None:
    """Write the FMU `name` to a file.

    Raises:
        InputError: there is no C compiler, or FMI does not know this platform.
        WorkError: the compiler fails.
    """
    folder, suffix = _platform(fmi)
    sources = _sources(step, name, fmi)
    token = str(uuid.UUID(hashlib.sha256("\0".join(sources.values()).encode()).hexdigest()[:32]))
    token = token if fmi == 3 else f"{{{token}}}"
    sources["config.h"] = _config(step, name, token)
    members: dict[str, str | bytes] = {"modelDescription.xml": model_description(step, name, token, fmi)}
    members |= {f"sources/{file}": text for file, text in sources.items()}
    if fmi == 3:
        members["sources/buildDescription.xml"] = build_description(name, _compiled(fmi))
    members[f"binaries/{folder}/{name}{suffix}"] = _library(sources, _compiled(fmi))
    with in_one_step(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as file:
        for member, content in members.items():  # the same bytes for the same model: no time of day
            file.writestr(zipfile.ZipInfo(member, (2020, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)


def _compiled(fmi: int) -> tuple[str, ...]:
    """Source files that are compiled."""
    return ("model.c", f"fmi{fmi}.c")


def _platform(fmi: int) -> tuple[str, str]:
    """Folder of the library in the FMU, and the end of its name."""
    here = (sys.platform, platform.machine().lower())
    two, three, suffix = _PLATFORMS.get(here, (None, None, ""))
    folder = two if fmi == 2 else three
    if folder is None:
        raise InputError(
            f"FMI {fmi}.0 names no folder for a library of this platform ({' '.join(here)}). Give --fmi 3, or export "
            "with --format c and compile that."
        )
    return folder, suffix


def _sources(step: Step, name: str, fmi: int) -> dict[str, str]:
    """Source files by name, without config.h."""
    runtime = files(__package__) / "runtime"
    own = {"model.c": c_code.source(step, name), "model.h": c_code.header(step, name)}
    return own | {file: (runtime / file).read_text("utf-8") for file in (*_SHARED, f"fmi{fmi}.c")}


def _config(step: Step, name: str, token: str) -> str:
    """Text of config.h, which tells co_simulation.h of the model."""
    prefix, first = name.upper(), step.reference
    values = {
        "MODEL_TOKEN": f'"{token}"', "MODEL_STATES": len(STATES), "MODEL_INPUTS": len(step.inputs),
        "MODEL_MEMORY": len(step.memory), "MODEL_DT": f"{prefix}_DT", "MODEL_ANY_STEP": int(step.any_step),
        "MODEL_START": f"{name}_start", "MODEL_STEP": f"{name}_step",
        "MODEL_START_VALUES": f"{{{', '.join(repr(float(v)) for v in first.s0)}}}",
        "MODEL_INPUT_VALUES": f"{{{', '.join(repr(float(v)) for v in first.U[0])}}}",
    }  # fmt: skip
    return '#include "model.h"\n\n' + "".join(f"#define {key} {value}\n" for key, value in values.items())


def _library(sources: dict[str, str], compiled: tuple[str, ...]) -> bytes:
    """Shared library of the sources."""
    command, _ = compiler()
    if not command:
        raise InputError(
            "an FMU needs a C compiler, and none was found. Install gcc, or name one: SHIPBENCH_COMPILER=clang. "
            "Without a compiler: --format c, matlab, casadi or json."
        )
    with tempfile.TemporaryDirectory(prefix="shipbench-") as work:
        for file, text in sources.items():
            Path(work, file).write_text(text, "utf-8")
        try:
            done = subprocess.run(
                [*command, *_FLAGS, "-o", "model.lib", *compiled, "-lm"], cwd=work, capture_output=True, text=True,
                errors="replace", timeout=_SECONDS, check=False,
            )  # fmt: skip
            said = done.stderr
        except (OSError, subprocess.TimeoutExpired) as error:
            done, said = None, str(error)
        if done is None or done.returncode:
            line = next((line for line in said.splitlines() if "error" in line), said[:200])
            raise WorkError(
                f"the C compiler '{' '.join(command)}' failed: {line}. To name another: SHIPBENCH_COMPILER=gcc."
            )
        return Path(work, "model.lib").read_bytes()
