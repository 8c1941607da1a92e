"""FMU of a ship with three degrees of freedom, compiled for the tests: FMI 2 or 3, co-simulation and model exchange."""

from __future__ import annotations

import platform
import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from shipbench.records import Dataset, Run
from shipbench.ship import Ship
from shipbench.signals import COMMANDS

HAS_COMPILER = shutil.which("gcc") is not None and platform.system() == "Linux"
NO_COMPILER = "needs gcc on Linux to compile its FMU"
STATES = ("x", "y", "psi", "u", "v", "r", "n", "delta")
TRUE = {"Xnn": 1.2e-6, "Xuu": -4.0e-4, "Xvr": 0.6, "Xdd": -2.0e-3, "Yv": -0.010, "Yr": -0.30, "Yd": 4.0e-4,
        "Nv": -8.0e-5, "Nr": -0.012, "Nrr": -3.0, "Nd": -6.0e-5, "lag": 3.0}  # fmt: skip
"""Parameters of the FMU and their values."""
TEN = tuple(name for name in TRUE if name not in ("Xdd", "lag"))
"""Ten of them, which runs of 120 s can tell apart."""
_UNITS = {"x": "m", "y": "m", "psi": "rad", "u": "m/s", "v": "m/s", "r": "rad/s", "n": "rpm", "delta": "rad"}
_DEFINED = """<UnitDefinitions>
<Unit name="m"><BaseUnit m="1"/></Unit><Unit name="rad"><BaseUnit rad="1"/></Unit>
<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit><Unit name="rad/s"><BaseUnit rad="1" s="-1"/></Unit>
<Unit name="rpm"><BaseUnit rad="1" s="-1" factor="0.10471975511965977"/></Unit>
</UnitDefinitions>"""
_UNUSED = {
    2: "GetTypesPlatform GetVersion SetDebugLogging GetInteger GetBoolean GetString SetInteger SetBoolean SetString "
    "GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate "
    "GetDirectionalDerivative GetEventIndicators GetNominalsOfContinuousStates SetRealInputDerivatives "
    "GetRealOutputDerivatives CancelStep GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus",
    3: "GetVersion SetDebugLogging InstantiateScheduledExecution GetFloat32 GetInt8 GetUInt8 GetInt16 GetUInt16 "
    "GetInt32 GetUInt32 GetInt64 GetUInt64 GetBoolean GetString GetBinary GetClock SetFloat32 SetInt8 SetUInt8 "
    "SetInt16 SetUInt16 SetInt32 SetUInt32 SetInt64 SetUInt64 SetBoolean SetString SetBinary SetClock "
    "GetNumberOfVariableDependencies GetVariableDependencies GetFMUState SetFMUState FreeFMUState "
    "SerializedFMUStateSize SerializeFMUState DeserializeFMUState GetDirectionalDerivative GetAdjointDerivative "
    "EnterConfigurationMode ExitConfigurationMode GetIntervalDecimal GetIntervalFraction GetShiftDecimal "
    "GetShiftFraction SetIntervalDecimal SetIntervalFraction SetShiftDecimal SetShiftFraction "
    "EvaluateDiscreteStates GetEventIndicators GetNominalsOfContinuousStates GetNumberOfEventIndicators "
    "GetNumberOfContinuousStates EnterStepMode GetOutputDerivatives ActivateModelPartition",
}
"""Functions that FMI requires and no test calls."""


def description(
    fmi: int = 2,
    *,
    extra: str = "",
    rename: dict[str, str] | None = None,
    values: Mapping[str, float] | None = None,
) -> str:
    """Text of modelDescription.xml. `extra` stands among the variables, `rename` maps names to others, `values` are
    start values of parameters."""
    parameters = TRUE | {"trouble": 0.0} | dict(values or {})
    names = ["n_c", "delta_c", *STATES, *parameters]
    variables = []
    for reference, name in enumerate(names):
        kind = "input" if name.endswith("_c") else "output" if name in STATES else "parameter"
        unit = _UNITS.get(name.removesuffix("_c"), "")
        start = parameters.get(name, 0.0)
        bounds = f' min="{min(3 * start, start / 3)!r}" max="{max(3 * start, start / 3)!r}"' if name in TRUE else ""
        initial = "" if kind == "input" else ' initial="exact"'
        varies = "fixed" if kind == "parameter" else "continuous"
        shown = quoteattr((rename or {}).get(name, name))
        head = f'name={shown} valueReference="{reference}" causality="{kind}" variability="{varies}"{initial}'
        number = f'start="{start!r}"{bounds}' + (f" unit={quoteattr(unit)}" if unit else "")
        variables.append(
            f"<ScalarVariable {head}><Real {number}/></ScalarVariable>" if fmi == 2 else f"<Float64 {head} {number}/>"
        )
    derivatives = [f'<Unknown index="{i}"/>' for i in range(3, 11)]
    structure = (
        f"<Derivatives>{''.join(derivatives)}</Derivatives>" if fmi == 2
        else "".join(f'<ContinuousStateDerivative valueReference="{i}"/>' for i in range(2, 10))
    )  # fmt: skip
    version, token = ("2.0", "guid") if fmi == 2 else ("3.0", "instantiationToken")
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="{version}" modelName="ship" {token}="{{ship}}">
<ModelExchange modelIdentifier="ship"/><CoSimulation modelIdentifier="ship"
 canHandleVariableCommunicationStepSize="true"/>
{_DEFINED}<DefaultExperiment stepSize="0.25"/><ModelVariables>{"".join(variables)}{extra}</ModelVariables>
<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"""


def write_archive(path: Path, files: Mapping[str, str | bytes]) -> Path:
    """Write a ZIP file with these members."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in files.items():
            packed.writestr(name, content)
    return path


def source(fmi: int = 2) -> str:
    """C source of the FMU."""
    stubs = "".join(f"int fmi{fmi}{name}(void) {{ return 3; }}\n" for name in _UNUSED[fmi].split())
    return (Path(__file__).parent / "made_fmu.c").read_text().replace("STUBS\n", stubs)


def library(folder: Path, fmi: int = 2) -> bytes:
    """Compile the library of the FMU."""
    (folder / "ship.c").write_text(source(fmi))
    command = ["gcc", "-O2", "-shared", "-fPIC", "-w", f"-DFMI={fmi}", "-o", "ship.so", "ship.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return (folder / "ship.so").read_bytes()


def members(content: bytes, fmi: int = 2) -> dict[str, bytes]:
    """Members of the archive with the library."""
    machine = platform.machine()
    name = f"linux{platform.architecture()[0][:2]}" if fmi == 2 else f"{machine}-linux"
    return {f"binaries/{name}/ship.so": content}


def sail_fmu(runs: int, seconds: int, noise: float = 0.0) -> Dataset:
    """Runs of the FMU's equations under steps of rudder and shaft speed, integrated here by the same rule."""
    rng = np.random.default_rng(7)
    made = []
    for i in range(runs):
        C = np.zeros((seconds + 1, 4))
        C[:, 0] = np.repeat(rng.uniform(60.0, 120.0, seconds // 30 + 1), 30)[: seconds + 1]
        C[:, 1] = np.repeat(rng.uniform(-0.5, 0.5, seconds // 15 + 1), 15)[: seconds + 1]
        S = np.zeros((seconds + 1, 10))
        S[0, :8] = *rng.uniform(-100, 100, 2), rng.uniform(-3, 3), rng.uniform(4, 7), *rng.uniform(-0.2, 0.2, 1), \
            *rng.uniform(-0.01, 0.01, 1), 90.0, 0.0  # fmt: skip
        for k in range(seconds):
            S[k + 1, :8] = _step(S[k, :8], C[k, :2])
        S[1:, :2] += noise * rng.standard_normal((seconds, 2))
        made.append(Run(f"r{i:02d}", np.arange(seconds + 1.0), S, C, COMMANDS))
    return Dataset("fmu-trial", Ship(name="toy", L=50.0, B=8.0, T=3.0, mass=9e5), 1.0, tuple(made))


def _step(s: np.ndarray, c: np.ndarray) -> np.ndarray:
    for _ in range(4):
        s = s + 0.25 * _rates(s + 0.125 * _rates(s, c), c)
    return s


def _rates(s: np.ndarray, c: np.ndarray) -> np.ndarray:
    p = TRUE
    _, _, psi, u, v, r, n, d = s
    return np.array([
        u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), r,
        p["Xnn"] * n * abs(n) + p["Xuu"] * u * abs(u) + p["Xvr"] * v * r + p["Xdd"] * u * u * d * d,
        p["Yv"] * u * v + p["Yr"] * u * r - p["Yd"] * u * u * d,
        p["Nv"] * u * v + p["Nr"] * u * r + p["Nrr"] * r * abs(r) - p["Nd"] * u * u * d,
        (c[0] - n) / p["lag"], (c[1] - d) / p["lag"],
    ])  # fmt: skip
