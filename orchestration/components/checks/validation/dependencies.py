"""Rules on declared dependencies: each input is moved, and the outputs that move with it are compared."""

import contextlib
import itertools
import math
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from fmpy.model_description import Unknown

from orchestration.components.checks.validation.excitation import ExcitationPlan, around
from orchestration.components.checks.validation.instance import CheckedInstance, Row, Value, Values
from orchestration.components.checks.validation.probe import Probe
from orchestration.components.checks.validation.run_comparison import same
from orchestration.components.fmi.instance import start_value
from orchestration.components.fmi.read_description import Variable
from orchestration.foundation.basics.errors import SimulatorError

MAX_SWITCHES = 16
"""Boolean parameters that are inverted, each with all inputs moved"""
MAX_PARAMETERS = 200
"""parameters that are moved, of an FMU with more"""
MAX_REFUSED = 10
"""moves that may be refused before the others are left out: each costs an instance"""
_POINTS = (0, 3)
"""communication points, in steps, at which the inputs are moved"""

_FAR = tuple(sign * 10.0**k for k in range(5) for sign in (1.0, -1.0))
"""moves of an input without effect when it is moved a little"""

Moved = dict[str, set[str]]
"""outputs that move, by the input that they move with; arrays count as one"""


@dataclass(frozen=True)
class Mode:
    """Declared and observed dependencies of the outputs in a mode."""

    where: str
    declared: dict[str, set[str] | None]
    """inputs by output; None: all"""
    moved: Moved = field(default_factory=lambda: defaultdict(set))


def undeclared_dependency(probe: Probe) -> Iterator[str]:
    """No output moves with an input, nor at initialisation with a parameter, without a declared dependency."""
    for mode in _modes(probe):
        for name, outputs in mode.moved.items():
            for output in sorted(outputs):
                declared = mode.declared.get(output)
                if declared is not None and name not in declared:
                    yield f"{output} moves with {name} {mode.where}: expected {name} among its dependencies"


def idle_dependency(probe: Probe) -> Iterator[str]:
    """Rule of this project: an input with declared dependencies moves one of these outputs."""
    if not probe.fmu.is_ours:
        return
    for mode in _modes(probe):
        for v in probe.inputs:
            declaring = {output for output, inputs in mode.declared.items() if inputs is not None and v.whole in inputs}
            if declaring and not declaring & (mode.moved[v.whole] or _moving_far(probe, v)):
                names = ", ".join(sorted(declaring))
                yield f"{v.name} moves none of {names} {mode.where}: expected it not to be among their dependencies"


def _modes(probe: Probe) -> Iterator[Mode]:
    """The observations in initialisation mode and, of our FMUs, at communication points, in every configuration.

    At a communication point FMI allows no reading between setting an input and the next step; FMUs of this project
    support it nevertheless, as they declare.
    """
    initial = Mode("in initialisation mode", _declared(probe.fmu.description.initialUnknowns))
    later = Mode("at a communication point", _declared(probe.fmu.description.outputs))
    for values in _configurations(probe):
        with contextlib.suppress(SimulatorError):  # a refused configuration shows nothing
            _move(probe, probe.inputs, values, None, initial.moved)
            parameters = [v for v in _parameters(probe) if v.name not in values]
            _move(probe, parameters, values, None, initial.moved, most_refused=MAX_REFUSED)
            for steps in _POINTS if probe.fmu.is_ours else ():
                _move(probe, probe.inputs, values, steps, later.moved)
    yield initial
    if probe.fmu.is_ours:
        yield later


def _configurations(probe: Probe) -> Iterator[dict[str, Value]]:
    """Inputs a little away from their starts; and with these each Boolean parameter inverted."""
    inputs = probe.inputs_at(0)
    yield inputs
    switches = [v for v in probe.elements_of("parameter") if v.kind == "Boolean"]
    for v in switches[:MAX_SWITCHES]:
        yield {**inputs, v.name: not start_value(v)}


def _parameters(probe: Probe) -> list[Variable]:
    """Parameters that may be set in initialisation mode and moved a little; a text may be a path, which cannot."""
    found = [v for v in probe.elements_of("parameter") if v.kind not in ("String", "Binary")]
    return found[:MAX_PARAMETERS]


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
            before = instance.row(probe.outputs)
            with contextlib.suppress(SimulatorError):
                while waiting:
                    v = waiting.popleft()
                    moved[v.whole] |= _moving(probe, instance, v, before)


def _moving(probe: Probe, instance: CheckedInstance, v: Variable, before: Row) -> set[str]:
    """The outputs that move with a variable, which is then reset."""
    value, *near = around(v, probe.inputs_at(0))
    outputs = set()
    for other in near:
        instance.put({v.name: other})
        outputs |= _changed(probe, before, instance.row(probe.outputs))
    instance.put({v.name: value})
    return outputs


def _moving_far(probe: Probe, v: Variable) -> set[str]:
    """The outputs that move in initialisation mode with a Real input that is moved far: a switch has a threshold.

    Also with parameters that are zero moved a little, as are the coefficients by which it acts.
    """
    outputs: set[str] = set()
    usual = probe.inputs_at(0)
    zero = {p.name: around(p, usual)[1] for p in _parameters(probe) if p.kind == "Real" and start_value(p) == 0.0}
    for values, move in itertools.product((usual, {**usual, **zero}), _FAR if v.kind == "Real" else ()):
        with probe.instance() as instance, contextlib.suppress(SimulatorError):
            instance.begin(values, probe.start)
            before = instance.row(probe.outputs)
            instance.put({v.name: float(values[v.name]) + move})
            outputs |= _changed(probe, before, instance.row(probe.outputs))
    return outputs


def _changed(probe: Probe, before: Row, after: Row) -> set[str]:
    """The outputs that have changed; an array has if any of its elements has."""
    return {v.whole for v in probe.outputs if not same(before[v.name], after[v.name])}


def _prepare(probe: Probe, instance: CheckedInstance, values: Values, steps: int | None) -> None:
    if steps is None:
        instance.begin(values, probe.start)
        return
    instance.start(values, probe.start)
    for t, h in probe.points(ExcitationPlan(steps=steps))[:steps]:
        instance.advance(t, h)


def _declared(unknowns: Iterable[Unknown]) -> dict[str, set[str] | None]:
    return {
        unknown.variable.name: None if unknown.dependencies is None else {v.name for v in unknown.dependencies}
        for unknown in unknowns
        if unknown.variable.causality == "output"
    }


RULES = (undeclared_dependency, idle_dependency)
