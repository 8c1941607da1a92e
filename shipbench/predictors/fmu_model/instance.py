"""Instance of an FMU in this process: reset before every run, stepped with arrays, no dictionaries and no lists.

FMPy loads the library and makes the instance; the functions of a step are called by their addresses. It runs in
worker processes only (`worker`): an FMU can crash or hang its process.

Source: FMI 2.0.4, sections 3.2.3 and 4.2.4; FMI 3.0.1, sections 3.2 and 4.2 (state machines and calling sequences).
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Callable
from ctypes import CFUNCTYPE, byref, c_bool, c_double, c_int, c_size_t, c_void_p
from typing import Any

import numpy as np

from .description import CO_SIMULATION
from .plan import Plan

_WARNING = 1
_MOST_STATUS = 9
"""Status above every one of FMI: no status is a failure."""
_MOST_EVENTS = 100
"""Most iterations of one event."""
_KEPT = 3
"""Last messages of the FMU that a reason quotes."""


class Failed(Exception):  # noqa: N818 - a result, not an error of ours
    """Failure that the FMU itself reports."""


class Instance(ABC):
    """Instance of one version of FMI.

    Args:
        plan: the FMU.
        at: array (1,) into which the simulated time [s] is written, for whoever watches this process.
    """

    prefix: str

    def __init__(self, plan: Plan, at: np.ndarray) -> None:
        self.plan, self.at = plan, at
        self.messages: list[str] = []
        self.remake = False
        """Whether the library is loaded anew for every run, since a reset leaves something behind."""
        self._fresh = True
        self._refs = [
            np.ascontiguousarray(r, dtype=np.uint32) for r in (plan.set_refs, plan.input_refs, plan.output_refs)
        ]
        self._make()

    def run(self, values: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, str]:
        """Outputs (K + 1, outputs) under the start values and inputs (K, inputs), from the start on, and the reason of
        a failure, after which they are NaN."""
        found = np.full((len(inputs) + 1, len(self.plan.output_refs)), np.nan)
        try:
            self._restart()
            self._run(np.ascontiguousarray(values, dtype=float), np.ascontiguousarray(inputs, dtype=float), found)
            return found, ""
        except Failed as error:
            self._make_again()
            return found, " ".join([f"{error}.", *self.messages[-_KEPT:]])[:400]

    def close(self) -> None:
        """Free the instance and unload the library."""
        self.fmu.freeInstance()

    def _restart(self) -> None:
        """Bring the instance into the state after instantiation."""
        if self._fresh:
            self._fresh = False
        elif self.remake:
            self.close()
            self._make()
            self._fresh = False
        else:
            self._call("Terminate", self.component, least=_MOST_STATUS)
            if self._call("Reset", self.component, least=_MOST_STATUS) > _WARNING:
                self._make_again()
                self._fresh = False

    def _make_again(self) -> None:
        """Make a new instance; the failed one is left, since freeing it may crash."""
        self._instantiate()
        self._fresh = True

    def _make(self) -> None:
        plan = self.plan
        self._functions: dict[str, Callable[..., int]] = {}
        self.fmu = self._fmu(
            guid=plan.token, modelIdentifier=plan.identifier, unzipDirectory=plan.folder, instanceName="ship"
        )
        self._instantiate()
        self._fresh = True

    def _instantiate(self) -> None:
        try:
            self._made()
        except Exception as error:  # FMPy raises plain exceptions
            raise Failed(" ".join([f"it cannot be instantiated: {error}", *self.messages[-_KEPT:]])[:400]) from None
        self.component = c_void_p(self.fmu.component) if isinstance(self.fmu.component, int) else self.fmu.component

    @abstractmethod
    def _fmu(self, **parts: Any) -> Any:
        """Loaded library of FMPy."""

    @abstractmethod
    def _made(self) -> None:
        """Instantiate with a logger that keeps the messages."""

    def _logged(self, status: int, message: bytes | None) -> None:
        if status > 0 and message:
            self.messages = [*self.messages[-_KEPT:], " ".join(message.decode("utf-8", "replace").split())[:200]]

    def _function(self, name: str, *types: Any) -> Callable[..., int]:
        if name not in self._functions:
            self._functions[name] = CFUNCTYPE(c_int, *types)((self.prefix + name, self.fmu.dll))
        return self._functions[name]

    def _call(self, name: str, *arguments: Any, types: tuple[Any, ...] | None = None, least: int = _WARNING) -> int:
        """Call a function once; a status above `least` is a failure."""
        status = self._function(name, *(types or (c_void_p,)))(*arguments)
        if status > least:
            raise Failed(f"{self.prefix}{name} returned status {status} at t = {self.at[0]:.4g} s")
        return status

    def _run(self, values: np.ndarray, inputs: np.ndarray, found: np.ndarray) -> None:
        plan, (set_refs, input_refs, output_refs) = self.plan, self._refs
        component, address = self.component, inputs.ctypes.data
        setter, getter = self._accessors()
        u_refs, y_refs, n_u, n_y = input_refs.ctypes.data, output_refs.ctypes.data, len(input_refs), len(output_refs)
        self.at[0] = 0.0
        self._begin(lambda: self._check(setter(component, set_refs.ctypes.data, len(set_refs), values.ctypes.data)
                                        if len(set_refs) else 0, "setting start values"),
                    lambda: self._check(setter(component, u_refs, n_u, address), "setting inputs"))  # fmt: skip
        step = self._stepper() if plan.kind == CO_SIMULATION else self._integrator()
        wide, high, target = inputs.strides[0], found.strides[0], found.ctypes.data
        self._check(getter(component, y_refs, n_y, target), "getting outputs")
        h = plan.dt / plan.substeps
        dt, substeps, at = plan.dt, range(plan.substeps), self.at
        for k in range(len(inputs)):
            if (status := setter(component, u_refs, n_u, address + k * wide)) > _WARNING:
                self._check(status, "setting inputs")
            for j in substeps:
                t = k * dt + j * h
                at[0] = t
                step(t, h, j == 0)
            if (status := getter(component, y_refs, n_y, target + (k + 1) * high)) > _WARNING:
                self._check(status, "getting outputs")
        lost = ~np.isfinite(found).all(axis=1)
        if lost.any():
            k = int(np.argmax(lost))
            found[k:] = np.nan
            raise Failed(f"its outputs are not finite at t = {k * plan.dt:.4g} s")

    def _check(self, status: int, what: str) -> None:
        if status > _WARNING:
            raise Failed(f"{what} failed with status {status} at t = {self.at[0]:.4g} s")

    @abstractmethod
    def _accessors(self) -> tuple[Callable[..., int], Callable[..., int]]:
        """Functions (component, references, count, address) that set and get reals."""

    @abstractmethod
    def _begin(self, set_start: Callable[[], None], set_inputs: Callable[[], None]) -> None:
        """Initialise, up to the mode in which steps are made."""

    @abstractmethod
    def _stepper(self) -> Callable[[float, float, bool], None]:
        """Function of a communication step (t, h, whether the inputs may have changed)."""

    @abstractmethod
    def _event(self, t: float) -> float:
        """Event iteration from continuous-time mode and back; the time of the next time event, or infinity."""

    @abstractmethod
    def _completed(self) -> bool:
        """Whether `CompletedIntegratorStep` asks for an event."""

    derivatives: str
    """Name of the function of the derivatives."""

    def _integrator(self) -> Callable[[float, float, bool], None]:
        """Function of a Runge-Kutta step of order 4 (t, h, whether the inputs may have changed).

        Events are handled at the end of the step in which they occur.
        """
        n, c, events = self.plan.states, self.component, self.plan.events
        vector = (c_void_p, c_void_p, c_size_t)
        get_x, set_x = self._function("GetContinuousStates", *vector), self._function("SetContinuousStates", *vector)
        rates, set_time = self._function(self.derivatives, *vector), self._function("SetTime", c_void_p, c_double)
        indicators = self._function("GetEventIndicators", *vector)
        x, moved, k1, k2, k3, k4 = rows = np.zeros((6, n))
        at_x, at_moved, *at_k = (row.ctypes.data for row in rows)  # looked up once: it takes longer than a call
        before, after = np.zeros(events), np.zeros(events)
        at_before, at_after = before.ctypes.data, after.ctypes.data
        next_event = self._event(0.0)
        indicators(c, at_before, events) if events else None

        def rate(t: float, at: int, into: int) -> None:
            if (status := set_time(c, t) | set_x(c, at, n) | rates(c, into, n)) > _WARNING:
                self._check(status, "getting derivatives")

        def step(t: float, h: float, inputs_changed: bool) -> None:
            nonlocal next_event
            if inputs_changed and t > 0.0:
                set_time(c, t)
                next_event = self._event(t)
            self._check(get_x(c, at_x, n), "getting continuous states")
            rate(t, at_x, at_k[0])
            np.add(x, (0.5 * h) * k1, out=moved)
            rate(t + 0.5 * h, at_moved, at_k[1])
            np.add(x, (0.5 * h) * k2, out=moved)
            rate(t + 0.5 * h, at_moved, at_k[2])
            np.add(x, h * k3, out=moved)
            rate(t + h, at_moved, at_k[3])
            np.add(x, (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4), out=moved)
            self._check(set_time(c, t + h) | set_x(c, at_moved, n), "setting continuous states")
            wanted = self._completed() if self.plan.completes else False
            if events:
                indicators(c, at_after, events)
                wanted |= bool(((after > 0.0) != (before > 0.0)).any())
                before[:] = after
            if wanted or t + h >= next_event:
                next_event = self._event(t + h)

        return step


class Instance2(Instance):
    """Instance of FMI 2."""

    prefix, derivatives = "fmi2", "GetDerivatives"

    def _fmu(self, **parts: Any) -> Any:
        from fmpy.fmi2 import FMU2Model, FMU2Slave

        return (FMU2Slave if self.plan.kind == CO_SIMULATION else FMU2Model)(**parts)

    def _made(self) -> None:
        from fmpy import calloc, fmi2, free
        from fmpy.logging import addLoggerProxy

        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(
            lambda _, __, status, ___, text: self._logged(status, text)
        )
        self._callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(byref(self._callbacks))
        self.fmu.instantiate(callbacks=self._callbacks)

    def _accessors(self) -> tuple[Callable[..., int], Callable[..., int]]:
        types = (c_void_p, c_void_p, c_size_t, c_void_p)
        return self._function("SetReal", *types), self._function("GetReal", *types)

    def _begin(self, set_start: Callable[[], None], set_inputs: Callable[[], None]) -> None:
        set_start()
        experiment = (c_void_p, c_int, c_double, c_double, c_int, c_double)
        self._call("SetupExperiment", self.component, 0, 0.0, 0.0, 0, 0.0, types=experiment)
        self._call("EnterInitializationMode", self.component)
        set_inputs()
        self._call("ExitInitializationMode", self.component)

    def _stepper(self) -> Callable[[float, float, bool], None]:
        component, do_step = self.component, self._function("DoStep", c_void_p, c_double, c_double, c_int)

        def step(t: float, h: float, _: bool) -> None:
            if (status := do_step(component, t, h, 1)) > _WARNING:
                self._check(status, "doStep")

        return step

    def _event(self, t: float) -> float:
        from fmpy.fmi2 import fmi2EventInfo

        info = fmi2EventInfo()
        if t > 0.0:
            self._call("EnterEventMode", self.component)
        for _ in range(_MOST_EVENTS):
            self._call("NewDiscreteStates", self.component, byref(info), types=(c_void_p, c_void_p))
            if info.terminateSimulation:
                raise Failed(f"it ended the simulation at t = {t:.4g} s")
            if not info.newDiscreteStatesNeeded:
                break
        self._call("EnterContinuousTimeMode", self.component)
        return info.nextEventTime if info.nextEventTimeDefined else float("inf")

    def _completed(self) -> bool:
        enter, end = c_int(0), c_int(0)
        types = (c_void_p, c_int, c_void_p, c_void_p)
        self._call("CompletedIntegratorStep", self.component, 1, byref(enter), byref(end), types=types)
        if end.value:
            raise Failed(f"it ended the simulation at t = {self.at[0]:.4g} s")
        return bool(enter.value)


class Instance3(Instance):
    """Instance of FMI 3."""

    prefix, derivatives = "fmi3", "GetContinuousStateDerivatives"

    def _fmu(self, **parts: Any) -> Any:
        from fmpy.fmi3 import FMU3Model, FMU3Slave

        return (FMU3Slave if self.plan.kind == CO_SIMULATION else FMU3Model)(**parts)

    def _made(self) -> None:
        self.fmu.instantiate(logMessage=lambda _, status, __, text: self._logged(status, text))

    def _accessors(self) -> tuple[Callable[..., int], Callable[..., int]]:
        types = (c_void_p, c_void_p, c_size_t, c_void_p, c_size_t)
        setter, getter = self._function("SetFloat64", *types), self._function("GetFloat64", *types)
        return (lambda c, refs, n, at: setter(c, refs, n, at, n)), (lambda c, refs, n, at: getter(c, refs, n, at, n))

    def _begin(self, set_start: Callable[[], None], set_inputs: Callable[[], None]) -> None:
        set_start()
        types = (c_void_p, c_bool, c_double, c_double, c_bool, c_double)
        self._call("EnterInitializationMode", self.component, False, 0.0, 0.0, False, 0.0, types=types)
        set_inputs()
        self._call("ExitInitializationMode", self.component)

    def _stepper(self) -> Callable[[float, float, bool], None]:
        flags, last = (c_bool * 3)(), c_double(0.0)
        event, end, early = (ctypes.addressof(flags) + i for i in range(3))
        at = ctypes.addressof(last)
        types = (c_void_p, c_double, c_double, c_bool, c_void_p, c_void_p, c_void_p, c_void_p)
        component, do_step = self.component, self._function("DoStep", *types)

        def step(t: float, h: float, _: bool) -> None:
            if (status := do_step(component, t, h, True, event, end, early, at)) > _WARNING:
                self._check(status, "doStep")
            if flags[1]:
                raise Failed(f"it ended the simulation at t = {t:.4g} s")

        self._kept = flags, last
        return step

    def _event(self, t: float) -> float:
        flags, next_time = (c_bool * 5)(), c_double(0.0)
        at = [ctypes.addressof(flags) + i for i in range(5)]
        if t > 0.0:
            self._call("EnterEventMode", self.component)
        for _ in range(_MOST_EVENTS):
            self._call("UpdateDiscreteStates", self.component, *at, byref(next_time), types=(c_void_p,) * 7)
            if flags[1]:
                raise Failed(f"it ended the simulation at t = {t:.4g} s")
            if not flags[0]:
                break
        self._call("EnterContinuousTimeMode", self.component)
        return next_time.value if flags[4] else float("inf")

    def _completed(self) -> bool:
        flags = (c_bool * 2)()
        at = ctypes.addressof(flags)
        types = (c_void_p, c_bool, c_void_p, c_void_p)
        self._call("CompletedIntegratorStep", self.component, True, at, at + 1, types=types)
        if flags[1]:
            raise Failed(f"it ended the simulation at t = {self.at[0]:.4g} s")
        return bool(flags[0])


def instance_of(plan: Plan, at: np.ndarray) -> Instance:
    """Instance of the FMU of a plan.

    Raises:
        Failed: it cannot be instantiated.
        Exception: FMPy cannot load the library.
    """
    return (Instance2 if plan.version == 2 else Instance3)(plan, at)
