"""Continuous states in a description: what model exchange adds to that of a slave for co-simulation."""

from __future__ import annotations

import itertools
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias
from xml.etree.ElementTree import Element, SubElement

from fmu_kit.variables import Variable
from fmu_kit.write_description import add_units, attributes, type_attributes

if TYPE_CHECKING:
    from fmu_kit.compiler.emit.standards import Standard
    from fmu_kit.compiler.trace.tracing import Program

_COMMON = ("modelIdentifier", "needsExecution", "canBeInstantiated", "canNotUseMemory", "canGetAnd", "canSerialize")
"""Beginnings of attributes that model exchange and co-simulation have in common"""
_NO_CALL_AFTER_STEPS = {
    2: ("completedIntegratorStepNotNeeded", "true"),
    3: ("needsCompletedIntegratorStep", "false"),
}
_RATE_UNITS = {"m": "m/s", "m/s": "m/s2", "rad": "rad/s", "rad/s": "rad/s2", "1": "1/s"}


@dataclass(frozen=True, kw_only=True)
class ContinuousState:
    """A continuous state and its derivative."""

    place: int
    """index in the memory"""
    rate: int
    """the place of its derivative among the results of the function that computes them"""
    variable: Variable
    reference: int
    derivative: Variable
    derivative_reference: int
    is_kept: bool
    """whether it is none of the slave's variables"""


Added: TypeAlias = tuple[Variable, int, ContinuousState | None]
"""A variable, its reference, and of a derivative its state"""


def continuous_states(program: Program) -> tuple[ContinuousState, ...]:
    """The continuous states of a program, with their value references."""
    return tuple(_continuous_states(program))


def _continuous_states(program: Program) -> Iterator[ContinuousState]:
    variables = program.slave.variables
    first = len(variables)
    free = itertools.count(first + len(program.states))
    for k, (rate, place) in enumerate(program.states):
        if place.reference is None:
            name, reference = place.name.removeprefix("self.").lstrip("_"), next(free)
            state = _local(name, f"State of the model: {name}", None)
        else:
            state, reference = variables[place.reference], place.reference
        unit = _RATE_UNITS.get(state.unit or "")
        yield ContinuousState(
            place=program.places.index(place),
            rate=rate,
            variable=state,
            reference=reference,
            derivative=_local(f"der({state.name})", f"Derivative of {state.name}", unit),
            derivative_reference=first + k,
            is_kept=place.reference is None,
        )


def _local(name: str, description: str, unit: str | None) -> Variable:
    return Variable(name=name, description=description, causality="local", variability="continuous", unit=unit)


def described(program: Program, standard: Standard) -> Element:
    """The description of a program: of its slave, and of model exchange if it has continuous states."""
    root = standard.describe(program.slave, standard.main)
    states = continuous_states(program)
    if not states:
        return root
    slave = root[0]
    model = Element("ModelExchange", {key: value for key, value in slave.items() if key.startswith(_COMMON)})
    model.extend(slave)
    model.set(*_NO_CALL_AFTER_STEPS[standard.version])
    root.insert(0, model)
    known = {unit.get("name") for unit in root.iterfind("UnitDefinitions/Unit")}
    units = tuple(state.derivative for state in states if state.derivative.unit not in known)
    root.find("UnitDefinitions").extend(add_units(Element("Added"), units))  # type: ignore[union-attr]
    added: list[Added] = [(state.derivative, state.derivative_reference, state) for state in states]
    added += [(state.variable, state.reference, None) for state in states if state.is_kept]
    (_add_to_2 if standard.version == 2 else _add_to_3)(root, states, added)
    return root


def _add_to_2(root: Element, states: Sequence[ContinuousState], added: Sequence[Added]) -> None:
    """Add variables at the end; FMI 2.0 refers to them by their position in the list, from 1."""
    variables, structure = root.find("ModelVariables"), root.find("ModelStructure")
    assert variables is not None
    assert structure is not None
    outputs, initial = structure
    positions = {reference: str(len(variables) + k) for k, (_, reference, _) in enumerate(added, start=1)}
    positions = {state.reference: str(state.reference + 1) for state in states} | positions
    for variable, reference, state in added:
        scalar = SubElement(variables, "ScalarVariable", attributes(variable, reference))
        of = {} if state is None else {"derivative": positions[state.reference]}
        SubElement(scalar, variable.type, {**type_attributes(variable), **of})
        SubElement(initial, "Unknown", index=positions[reference])
    _depend_on_states(outputs, "index", {positions[state.reference] for state in states})
    derivatives = Element("Derivatives")
    for state in states:
        SubElement(derivatives, "Unknown", index=positions[state.derivative_reference])
    structure.insert(1, derivatives)


def _add_to_3(root: Element, states: Sequence[ContinuousState], added: Sequence[Added]) -> None:
    variables, structure = root.find("ModelVariables"), root.find("ModelStructure")
    assert variables is not None
    assert structure is not None
    for place, later in enumerate(variables[added[0][1] :], added[-1][1] + 1):  # time and clock
        later.set("valueReference", str(place))
    for variable, reference, state in added:
        of = {} if state is None else {"derivative": str(state.reference)}
        number = Element("Float64", {**attributes(variable, reference), **type_attributes(variable), **of})
        variables.insert(reference, number)
        SubElement(structure, "InitialUnknown", valueReference=str(reference))
    outputs = structure.findall("Output")
    _depend_on_states(outputs, "valueReference", {str(state.reference) for state in states})
    for state in reversed(states):
        rate = Element("ContinuousStateDerivative", valueReference=str(state.derivative_reference))
        structure.insert(len(outputs), rate)


def _depend_on_states(outputs: Iterable[Element], key: str, states: Container[str | None]) -> None:
    """Outputs that are states depend on themselves; others may depend on all states and inputs, as no list says."""
    for output in outputs:
        if output.get(key) in states:
            output.set("dependencies", output.get(key, ""))
        else:
            output.attrib.pop("dependencies")
