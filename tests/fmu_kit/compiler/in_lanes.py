"""A slave in lanes beside instances of it, one for each lane: what they hold, to the last bit."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from fmu_kit.compiler.emit.c_code import ERRORS
from fmu_kit.compiler.pack.lanes import Lanes
from tests.fmu_kit.compiler.twins import GUID

_BEFORE_THE_MEMORY = 136
"""Bytes of an instance's state that identify its FMU."""

Values = Mapping[int, float | int | bool]
"""By value reference"""


@dataclass
class Alone:
    """An instance of the FMU; it remembers how its last call has failed."""

    fmu: Any
    places: int
    types: Sequence[str]
    """by value reference"""
    status: int = 0
    messages: list[str] = field(default_factory=list)

    @classmethod
    def made(cls, library: Path, places: int, types: Sequence[str], guid: str = GUID) -> "Alone":
        """An instance of a library."""
        messages: list[str] = []

        def log(_: Any, __: bytes, status: int, category: bytes | None, message: bytes) -> None:
            messages.append((category or b"").decode())

        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(log)
        fmu = fmi2.FMU2Slave(
            guid=guid, unzipDirectory=str(library.parent), modelIdentifier="lane", libraryPath=str(library)
        )
        fmu.instantiate(callbacks=callbacks, loggingOn=True)
        return cls(fmu, places, types, messages=messages)

    def put(self, values: Values) -> None:
        """Set variables."""
        for reference, value in values.items():
            getattr(self.fmu, f"set{self.types[reference]}")([reference], [value])

    def initialise(self, start: float) -> None:
        """From instantiation to the first step."""
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        self._try(self.fmu.exitInitializationMode)

    def step(self, t: float, h: float) -> None:
        """A step."""
        self._try(self.fmu.doStep, t, h)

    def memory(self) -> NDArray[np.float64]:
        """All that it holds."""
        state = self.fmu.getFMUState()
        held = self.fmu.serializeFMUState(state)
        self.fmu.freeFMUState(state)
        return np.frombuffer(held, np.float64, self.places, _BEFORE_THE_MEMORY)

    def _try(self, call: Any, *given: float) -> None:
        self.messages.clear()
        try:
            call(*given)
            self.status = 0
        except FMICallException:
            self.status = 1 + ERRORS.index("DivergenceError" if self.messages[-1] == "divergence" else "FmuError")


class Together:
    """The same in lanes."""

    def __init__(self, library: Path) -> None:
        self.lanes = Lanes(library)
        self.count = self.lanes.lanes
        self.memory = self._aligned(self.lanes.places * self.count).reshape(self.lanes.places, self.count)
        self.status = np.zeros(self.count, np.int32)

    def begin(self) -> None:
        """As new, all lanes."""
        self.status[:] = 0
        self.lanes.begin(self.memory.ctypes.data)

    def held(self) -> list[bytes]:
        """What each lane holds."""
        return [values.tobytes() for values in self.memory.T]

    def put(self, lane: int, values: Values) -> None:
        """Set variables of a lane."""
        for reference, value in values.items():
            self.memory[reference, lane] = value

    def initialise(self, active: NDArray[np.bool_], start: NDArray[np.float64]) -> None:
        """Compute outputs at the start time."""
        given = (self.memory, self._mask(active), start, self.status)
        self.lanes.initialise(*(a.ctypes.data for a in given))

    def step(
        self,
        active: NDArray[np.bool_],
        t: NDArray[np.float64],
        h: NDArray[np.float64],
        wanted: NDArray[np.bool_] | None = None,
    ) -> None:
        """A step; `wanted`: for each variable, whether it is read."""
        given = (self.memory, self._mask(active), t, h, self.status)
        memory, live, begin, length, status = (a.ctypes.data for a in given)
        self.lanes.do_step(memory, live, begin, length, status, None if wanted is None else wanted.ctypes.data)

    def several(
        self, active: NDArray[np.bool_], times: NDArray[np.float64], h: float, between: Callable[[], bool]
    ) -> int:
        """Steps that begin at some times; `between` is asked whether to go on. The number of those that are done."""
        back = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)
        do_steps = ctypes.CFUNCTYPE(
            ctypes.c_int64, *[ctypes.c_void_p] * 3, ctypes.c_double, ctypes.c_int64, ctypes.c_void_p, back,
            ctypes.c_void_p,
        )(self.lanes.steps)  # fmt: skip
        begin, live = np.append(times, [times[-1]] * self.count), self._mask(active)
        given = (self.memory.ctypes.data, live.ctypes.data, begin.ctypes.data, h, len(times))
        done: int = do_steps(*given, None, back(lambda _: between()), None)
        return done

    def _mask(self, active: NDArray[np.bool_]) -> NDArray[np.uint64]:
        return np.where(active, ~np.uint64(0), np.uint64(0))

    @staticmethod
    def _aligned(size: int) -> NDArray[np.float64]:
        room = np.zeros(size + 8)
        return room[-room.ctypes.data % 64 // 8 :][:size]


def bits(values: NDArray[np.float64]) -> bytes:
    """Values to the last bit; what is not a number has no bits that count."""
    return np.where(np.isnan(values), np.nan, values).tobytes()
