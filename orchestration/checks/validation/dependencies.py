"""Rules on what is declared of outputs and inputs: each input is moved, and what moves with it is looked at."""

import contextlib
import math
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from orchestration.checks.validation.declared import Unknown, Variable
from orchestration.checks.validation.fmu import Fmu
from orchestration.checks.validation.instance import Instance, RefusedError, Row, Value, Values, same
from orchestration.checks.validation.probe import Plan, Probe

MOST_SWITCHES = 16
"""Boolean parameters that are tried the other way round, each with all inputs"""
MOST_PARAMETERS = 200
"""Parameters that are moved, of an FMU that has many more"""
MOST_REFUSED = 10
"""Moves that may be refused before the others are left: each takes an instance with it"""
_POINTS = (0, 3)
"""Communication points, in steps, at which the inputs are moved"""

_FAR = tuple(sign * 10.0**k for k in range(5) for sign in (1.0, -1.0))
"""By how much an input is moved that moves nothing when it is moved a little"""

Moved = dict[str, set[str]]
"""Outputs that move, by the input that they move with; arrays are one"""


@dataclass(frozen=True)
class Mode:
    """What is declared of the outputs in a mode, and what was seen."""

    where: str
    declared: dict[str, set[str] | None]
    """Inputs by output; None: all"""
    moved: Moved = field(default_factory=lambda: defaultdict(set))


def undeclared_dependency(probe: Probe) -> Iterator[str]:
    """No output moves with an input, nor at initialisation with a parameter, that it is declared not to depend on."""
    for mode in _modes(probe):
        for name, outputs in mode.moved.items():
            for output in sorted(outputs):
                declared = mode.declared.get(output)
                if declared is not None and name not in declared:
                    yield f"{output} moves with {name} {mode.where}: expected {name} among its dependencies"


def idle_dependency(probe: Probe) -> Iterator[str]:
    """Rule of this project: an input that outputs are declared to depend on moves one of them in some way or other."""
    if not probe.fmu.is_ours:
        return
    for mode in _modes(probe):
        for v in probe.inputs:
            declaring = {output for output, inputs in mode.declared.items() if inputs is not None and v.whole in inputs}
            if declaring and not declaring & (mode.moved[v.whole] or _moving_far(probe, v)):
                names = ", ".join(sorted(declaring))
                yield f"{v.name} moves none of {names} {mode.where}: expected it not to be among their dependencies"


def _modes(probe: Probe) -> Iterator[Mode]:
    """What is seen in initialisation mode and, of our FMUs, at communication points, in every configuration.

    At a communication point FMI allows no value to be asked for between setting an input and the next step;
    the FMUs of this project answer nevertheless, with what they declare.
    """
    initial = Mode("in initialisation mode", _declared(probe.fmu, probe.fmu.initial_unknowns))
    later = Mode("at a communication point", _declared(probe.fmu, probe.fmu.outputs))
    for values in _configurations(probe):
        with contextlib.suppress(RefusedError):  # a configuration that is refused shows nothing
            _move(probe, probe.inputs, values, None, initial.moved)
            parameters = [v for v in _parameters(probe) if v.name not in values]
            _move(probe, parameters, values, None, initial.moved, most_refused=MOST_REFUSED)
            for steps in _POINTS if probe.fmu.is_ours else ():
                _move(probe, probe.inputs, values, steps, later.moved)
    yield initial
    if probe.fmu.is_ours:
        yield later


def _configurations(probe: Probe) -> Iterator[dict[str, Value]]:
    """Inputs a little away from their starts; and with them each Boolean parameter the other way round."""
    inputs = probe.inputs_at(0)
    yield inputs
    switches = [v for v in probe.of("parameter") if v.kind == "Boolean"]
    for v in switches[:MOST_SWITCHES]:
        yield {**inputs, v.name: not v.start_value}


def _parameters(probe: Probe) -> list[Variable]:
    """Those that may be set in initialisation mode and moved a little; a text may be a path, which has no beside."""
    found = [v for v in probe.of("parameter") if v.initial == "exact" and v.kind not in ("String", "Binary")]
    return found[:MOST_PARAMETERS]


def _move(
    probe: Probe,
    variables: Iterable[Variable],
    values: Values,
    steps: int | None,
    moved: Moved,
    most_refused: float = math.inf,
) -> None:
    """Move each variable a little, one after another, and note what moves with it.

    After `steps` steps; None: in initialisation mode. A value that is refused shows nothing, and ends its instance.
    """
    waiting, refused = deque(variables), -1
    while waiting and refused < most_refused:
        refused += 1
        with probe.instance() as instance:
            _prepare(probe, instance, values, steps)
            before = instance.get(probe.outputs)
            with contextlib.suppress(RefusedError):
                while waiting:
                    v = waiting.popleft()
                    moved[v.whole] |= _moving(probe, instance, v, before)


def _moving(probe: Probe, instance: Instance, v: Variable, before: Row) -> set[str]:
    """The outputs that move with a variable, which is put back."""
    value, *near = probe.around(v)
    outputs = set()
    for other in near:
        instance.set({v.name: other})
        outputs |= _other(probe, before, instance.get(probe.outputs))
    instance.set({v.name: value})
    return outputs


def _moving_far(probe: Probe, v: Variable) -> set[str]:
    """The outputs that move in initialisation mode with a Real input that is moved far: a switch has a threshold."""
    outputs: set[str] = set()
    for move in _FAR if v.kind == "Real" else ():
        with probe.instance() as instance, contextlib.suppress(RefusedError):
            values = probe.inputs_at(0)
            instance.begin(values, probe.start)
            before = instance.get(probe.outputs)
            instance.set({v.name: float(values[v.name]) + move})
            outputs |= _other(probe, before, instance.get(probe.outputs))
    return outputs


def _other(probe: Probe, before: Row, after: Row) -> set[str]:
    """The outputs that are not what they were, an array if any of its elements is not."""
    return {v.whole for v in probe.outputs if not same(before[v.name], after[v.name])}


def _prepare(probe: Probe, instance: Instance, values: Values, steps: int | None) -> None:
    if steps is None:
        instance.begin(values, probe.start)
        return
    instance.initialise(values, probe.start)
    for t, h in probe.points(Plan(steps=steps))[:steps]:
        instance.step(t, h)


def _declared(fmu: Fmu, unknowns: Iterable[Unknown]) -> dict[str, set[str] | None]:
    declared: dict[str, set[str] | None] = {}
    for unknown in unknowns:
        output = fmu.variable(unknown.handle)
        if output is not None and output.causality == "output":
            listed = unknown.dependencies
            known = None if listed is None else {v.name for v in map(fmu.variable, listed) if v is not None}
            declared[output.name] = known
    return declared


RULES = (undeclared_dependency, idle_dependency)
