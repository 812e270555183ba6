"""CVODE, in fmpy's copy of it, as the solver of an FMU for model exchange: for stiff models."""

import ctypes
from collections.abc import Callable
from typing import Any

from fmpy import sundials
from fmpy.fmi1 import FMICallException

from orchestration.components.fmi.slaves import WARNING

_AT_ROOT = 2
"""Code that CVode returns where an event indicator has changed its sign"""
_MOST_STEPS = 1_000_000
"""Its own steps from one communication point to the next, at most"""
SOLVE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, ctypes.POINTER(ctypes.c_bool))
"""The type of `solve`, for C"""


class Cvode:
    """The solver of one instance, which begins anew at each step of a run, so that a state has no history."""

    def __init__(self, fmu: Any, adapter: Any, version: int, follow: Callable[[int, float], int]) -> None:
        """`follow` sets the inputs of an adapter that follow lines."""
        self._fmu, self._adapter, self._follow, self._solver = fmu, adapter, follow, None
        self._failure: str | None = None
        self._derivatives = fmu.getDerivatives if version == 2 else fmu.getContinuousStateDerivatives
        self.function = SOLVE(self.solve)
        self._stop = sundials.libraries.sundials_cvode.CVodeSetStopTime
        self._stop.argtypes = (ctypes.c_void_p, ctypes.c_double)

    @property
    def failure(self) -> str | None:
        """Why it has failed; None: it has not."""
        return self._failure

    def solve(self, until: float, crosses: Any) -> int:
        """Solve up to a time [s], or to the first event before; the status of FMI. No exception goes through C."""
        try:
            return self._solve(until, crosses)
        except Exception as error:
            self._failure = f"CVODE: {error}"
            return 3

    def _solve(self, until: float, crosses: Any) -> int:
        a, solver = self._adapter, self._solver or self._created()
        if a.fresh:
            solver.reset(a.now)
            a.fresh = 0
        self._stop(solver.cvode_mem, until)
        reached = sundials.realtype(0.0)
        flag = sundials.CVode(solver.cvode_mem, until, solver.x, ctypes.byref(reached), sundials.CV_NORMAL)
        if self._failure is not None:
            return 3
        if flag < 0:
            raise RuntimeError(solver.error_info[-1] if solver.error_info else f"code {flag}")
        crosses[0] = flag == _AT_ROOT
        a.now = reached.value if flag == _AT_ROOT and reached.value < until else until
        self._set_time(a.now)
        if a.states:
            self._call(self._fmu.setContinuousStates)(solver.px, a.states)
        return 0 if self._failure is None else 3

    def _created(self) -> Any:
        fmu, a = self._fmu, self._adapter
        self._solver = sundials.CVodeSolver(
            nx=a.states, nz=a.crossings, get_x=self._call(fmu.getContinuousStates),
            set_x=self._call(fmu.setContinuousStates), get_dx=self._call(self._derivatives),
            get_z=self._call(fmu.getEventIndicators), get_nominals=self._call(fmu.getNominalsOfContinuousStates),
            set_time=self._set_time, input=self, startTime=a.now, relativeTolerance=a.tolerance,
            maxNumSteps=_MOST_STEPS,
        )  # fmt: skip
        return self._solver

    def apply(self, time: float) -> None:
        """Inputs are set with the time, for the derivatives too, where fmpy does not call this."""

    def _set_time(self, time: float) -> None:
        self._call(self._fmu.setTime)(time)
        if self._follow(ctypes.addressof(self._adapter), time) > WARNING:
            self._failure = f"its inputs at {time:g} s are refused"

    def _call(self, function: Callable[..., Any]) -> Callable[..., None]:
        """The function, whose failure is kept: CVODE would not see an exception."""

        def call(*arguments: Any) -> None:
            try:
                function(*arguments)
            except FMICallException as error:
                self._failure = f"{error.function}: status {error.status}"

        return call
