"""The confined process that tests whether runs of an FMU repeat.

`python -m orchestration.components.fmi.repeatability_process FMU MANNER ACCESS` runs a fresh instance first, in
`MANNER` (see `instances.MANNERS`), and then the same run after other ones, with other parameters, other inputs and
longer. After each comparison it reports what it has shown.
"""

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.components.fmi.access import Access
from orchestration.components.fmi.instance import Value, start_number, within
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.read_description import Variable
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.processes.channel import Parent
from orchestration.foundation.processes.resource_limits import Limits, restrict

_STEPS = 25
_PARAMETERS = 200
"""The most that are changed"""
_FACTOR = 1.0 + 2.0**-10
"""Factor on a parameter that is changed: little, as many parameters constrain each other"""


class _Runs:
    """The test runs of one FMU in one manner."""

    def __init__(self, path: Path, manner: str, access: Access) -> None:
        self._path, self._access = path, access
        self.fresh = self.open()
        model = self.model = self.fresh.model
        self._moves = manner == "moving"
        self._step = 1e-3 if manner == "fine" else _default_step(self.fresh)
        self._inputs = [model.variables[name] for name in model.names("input")]
        self._watched = [*model.names("output", "local"), *model.names("parameter", "calculatedParameter")]

    def open(self) -> NativeInstance:
        """A new instance."""
        instance = open_here(self._path, "repeated", self._access)
        instance.reads_exactly = False
        return instance

    def reference_run(self, instance: NativeInstance, beside: Callable[[float, float], None] | None = None) -> bytes:
        """The run that must repeat: all values of all steps."""
        return self._run(instance, {}, 0.0, _STEPS, beside)

    def other_run(self, instance: NativeInstance, parameters: Sequence[Variable]) -> None:
        """Another run, with these parameters changed."""
        self._run(instance, {v.name: _moved(v) for v in parameters}, 1.0, 2 * _STEPS, None)

    def _run(
        self,
        instance: NativeInstance,
        parameters: dict[str, Value],
        phase: float,
        count: int,
        beside: Callable[[float, float], None] | None,
    ) -> bytes:
        rows = bytearray()
        into, values = np.zeros(len(self._watched)), np.zeros(len(self._inputs))
        for name, value in parameters.items():
            instance.set(name, value)
        read, write = instance.reader(self._watched, into), instance.writer([v.name for v in self._inputs], values)
        instance.enter_initialization(0.0, 2 * _STEPS * self._step)
        values[:] = self._input(0, phase)
        write()
        instance.exit_initialization()
        for k in range(count):
            read()
            rows += into.tobytes()
            values[:] = self._input(k, phase)
            write()
            instance.step(k * self._step, self._step)
            if beside is not None:
                beside(k * self._step, self._step)
        read()
        return bytes(rows + into.tobytes())

    def _input(self, k: int, phase: float) -> list[float]:
        moves = self._moves or phase > 0.0
        return [_moving(v, k, phase + i) if moves else start_number(v) for i, v in enumerate(self._inputs)]


def main(path: str, manner: str, access: str) -> None:
    """Run all tests, and report which runs are the same."""
    parent = Parent()
    restrict(Limits().size)
    runs = _Runs(Path(path), manner, Access.of(access))
    expected = runs.reference_run(runs.fresh)
    parent.send({"fresh": True})
    used = _used(runs)
    parent.send({"reset": used is not None and _is_same(runs, used, expected)})
    if not runs.model.once_per_process:
        parent.send({"second_instance": used is not None and _further_is_same(runs, expected)})


def _used(runs: _Runs) -> NativeInstance | None:
    """An instance after another run, with all parameters changed that it accepts; None if no such run succeeds."""
    settable = [v for v in runs.model.variables.values() if v.causality == "parameter"]
    movable = [v for v in settable if v.kind in ("Real", "Integer", "Boolean", "Enumeration") and v.start is not None]
    try:
        runs.fresh.reset()
        return _after_other(runs, runs.fresh, movable[:_PARAMETERS])
    except QuadcosimError:
        if runs.model.once_per_process:
            return None
    accepted = _accepted(runs, movable[:_PARAMETERS])
    for parameters in (accepted, []):
        try:
            instance = runs.open()
            return _after_other(runs, instance, parameters)
        except QuadcosimError:
            continue
    return None


def _after_other(runs: _Runs, instance: NativeInstance, parameters: Sequence[Variable]) -> NativeInstance:
    runs.other_run(instance, parameters)
    return instance


def _accepted(runs: _Runs, parameters: Sequence[Variable]) -> list[Variable]:
    """The parameters that the FMU accepts when changed, found by bisection."""
    try:
        with runs.open() as instance:
            runs.other_run(instance, parameters)
        return list(parameters)
    except QuadcosimError:
        half = len(parameters) // 2
        return _accepted(runs, parameters[:half]) + _accepted(runs, parameters[half:]) if half else []


def _is_same(runs: _Runs, used: NativeInstance, expected: bytes) -> bool:
    """Whether the run repeats after a reset, and after another reset."""
    try:
        for _ in range(2):
            used.reset()
            if runs.reference_run(used) != expected:
                return False
        return True
    except QuadcosimError:
        return False


def _further_is_same(runs: _Runs, expected: bytes) -> bool:
    """Whether it repeats in an instance beside one that takes the same steps, and in one after both."""
    try:
        with runs.open() as beside, runs.open() as instance:
            beside.initialise((), np.zeros(0))
            if runs.reference_run(instance, beside.step) != expected:
                return False
        with runs.open() as instance:
            return runs.reference_run(instance) == expected
    except QuadcosimError:
        return False


def _default_step(instance: NativeInstance) -> float:
    experiment, interface = instance.description.defaultExperiment, instance.model.capabilities
    declared: Any = getattr(interface, "fixedInternalStepSize", None) or getattr(experiment, "stepSize", None)
    try:
        step = float(declared)
    except (TypeError, ValueError):
        return 0.01
    return step if 0.0 < step < math.inf else 0.01


def _moving(variable: Variable, k: int, phase: float) -> float:
    if variable.kind == "Boolean":
        return float(int(k + phase) % 2)
    if variable.kind != "Real":
        return start_number(variable)
    return within(variable, start_number(variable) + 0.1 * math.sin(0.7 * k + phase))


def _moved(variable: Variable) -> Value:
    start = start_number(variable)
    if variable.kind == "Boolean":
        return start == 0.0
    if variable.kind == "Real":
        return within(variable, start * _FACTOR if start else _FACTOR - 1.0)
    if variable.kind == "Enumeration":
        others = [number for number in variable.choices.values() if number != start]
        return others[0] if others else int(start)
    return int(within(variable, start + 1.0))


if __name__ == "__main__":
    main(*sys.argv[1:])
