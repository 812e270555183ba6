"""Rules on the model structure (FMI 2.0.4, section 2.2.8; FMI 3.0, section 2.4.8).

fmpy checks the lists, too, but does not name what is missing or listed twice.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from xml.etree.ElementTree import Element

from fmpy.model_description import ModelVariable, Unknown

from orchestration.components.checks.validation.excitation import PLAIN
from orchestration.components.checks.validation.fmu import Fmu, is_clocked
from orchestration.components.checks.validation.probe import Probe
from orchestration.components.fmi.archive import version_of


def indices(root: Element) -> Iterator[str]:
    """Every index, in FMI 3.0 every value reference, is that of one variable, for a dimension of a whole number.

    A description in which one is not cannot be read further.
    """
    variables = root.findall("ModelVariables/*")
    if version_of(root) == 2:
        key, entries, expected = "index", "ModelStructure/*/Unknown", f"1 to {len(variables)}"
        known = {str(place): v for place, v in enumerate(variables, start=1)}
        parents = {entry: parent.tag for parent in root.iterfind("ModelStructure/*") for entry in parent}
    else:
        key, entries, expected = "valueReference", "ModelStructure/*", "that of a variable"
        known = {v.get(key, ""): v for v in variables}
        parents = {}
        for reference, count in Counter(v.get(key) for v in variables).items():
            if count > 1:
                names = ", ".join(v.get("name", "") for v in variables if v.get(key) == reference)
                yield f"{names}: value reference {reference} for all of them, but FMI 3.0 has one for each variable"
    for entry in root.iterfind(entries):
        for found in (entry.get(key, ""), *entry.get("dependencies", "").split()):
            if found not in known:
                yield f"{parents.get(entry, entry.tag)}: {key} {found}, expected {expected}"
    for v in variables:
        for what, found in _named(v):
            if found not in known:
                yield f"{v.get('name')}: {what} of {key} {found}, expected {expected}"
            elif what == "dimension" and "Int" not in known[found].tag:
                size = f"{known[found].get('name')} of {known[found].tag}"
                yield f"{v.get('name')}: its dimension is {size}: expected a structural or constant UInt64"


def _named(v: Element) -> Iterator[tuple[str, str]]:
    """What a variable says of others, and by which index or value reference."""
    for element in (v, *v):
        for what in ("derivative", "clocks", "previous"):
            yield from ((what, found) for found in element.get(what, "").split())
    yield from (("dimension", found) for each in v.iterfind("Dimension") if (found := each.get("valueReference")))


def outputs(fmu: Fmu) -> Iterator[str]:
    """Outputs lists each output once, and nothing else."""
    yield from _compared(_list(fmu, "Output"), fmu.description.outputs, (v for v in fmu.variables if _is_output(v)))


def initial_unknowns(fmu: Fmu) -> Iterator[str]:
    """InitialUnknowns lists the variables that initialisation calculates and others may read, in FMI 2.0 in order.

    Of variables with a derivative only those whose derivative is under Derivatives are states (FMI 2.0.4, section
    2.2.8). Clocked variables have no value before they tick.
    """
    where, unknowns = _list(fmu, "InitialUnknown"), fmu.description.initialUnknowns
    derivatives = {unknown.variable for unknown in fmu.description.derivatives}
    read = derivatives | {v.derivative for v in derivatives}
    expected = [
        v
        for v in fmu.variables
        if v.causality == "calculatedParameter"
        or (v.initial in ("approx", "calculated") and (_is_output(v) or v in read) and not is_clocked(v))
    ]
    yield from _compared(where, unknowns, expected)
    if fmu.version == 2 and not _is_in_order(fmu, [unknown.variable for unknown in unknowns]):
        yield f"{where}: expected the entries in the order of their indices"


def known_dependencies(fmu: Fmu) -> Iterator[str]:
    """Outputs depend on variables known in that mode, in FMI 2.0 listed in the order of the indices.

    Derivatives are not checked: for co-simulation they mean nothing, and the FMI project's own FMUs list parameters.
    """
    description = fmu.description
    for name, unknowns in (("Output", description.outputs), ("InitialUnknown", description.initialUnknowns)):
        where, initially = _list(fmu, name), unknowns is description.initialUnknowns
        for unknown in unknowns:
            listed, dependent = unknown.dependencies or (), unknown.variable.name
            if fmu.version == 2 and (len(set(listed)) < len(listed) or not _is_in_order(fmu, listed)):
                yield f"{where}: {dependent}: expected its dependencies once each, in the order of their indices"
            for known in listed:
                is_known = known.causality in ("input", "independent") or known in fmu.states or is_clocked(known)
                if not (is_known or (known.initial == "exact" if initially else _is_kept(fmu, known))):
                    yield f"{where}: {dependent} depends on {known.name}, a {known.causality}: expected an input"


def _list(fmu: Fmu, entry: str) -> str:
    """The name of a list of the structure, by that of its entries in FMI 3.0."""
    return f"{entry}s" if fmu.version == 2 else entry


def _is_output(v: ModelVariable) -> bool:
    return bool(v.causality == "output")


def _is_in_order(fmu: Fmu, variables: Iterable[ModelVariable]) -> bool:
    order = [fmu.places[v] for v in variables]
    return order == sorted(order)


def _is_kept(fmu: Fmu, variable: ModelVariable) -> bool:
    """Whether FMI 3.0 takes it for known at a communication point: parameters, and states in discrete time."""
    parameter = variable.causality in ("parameter", "structuralParameter")
    return fmu.version > 2 and (parameter or variable.variability == "discrete")


def _compared(where: str, unknowns: Iterable[Unknown], expected: Iterable[ModelVariable]) -> Iterator[str]:
    found, needed = Counter(unknown.variable for unknown in unknowns), dict.fromkeys(expected)
    for v in needed:
        if found[v] != 1:
            yield f"{where}: {v.name} is there {found[v]} times, expected once"
    yield from (f"{where}: {v.name} is there, expected it not to be" for v in found if v not in needed)


def derivatives(fmu: Fmu) -> Iterator[str]:
    """Each of the listed derivatives names its state, a continuous one of the same dimensions, by `derivative`."""
    where = "Derivatives" if fmu.version == 2 else "ContinuousStateDerivative"
    for unknown in fmu.description.derivatives:
        v = unknown.variable
        if v.derivative is None:
            yield f"{where}: {v.name} has no attribute derivative: expected the state that it is the derivative of"
        elif v.shape != v.derivative.shape:
            yield f"{where}: {v.name} has other dimensions than its state {v.derivative.name}"


def numbers_of_states(probe: Probe) -> Iterator[str]:
    """One for model exchange has as many continuous states and event indicators as its description lists."""
    if probe.model.interface != "model-exchange":
        return
    described = probe.fmu.description
    states = sum(math.prod(each.variable.shape or ()) for each in described.derivatives)
    if probe.fmu.version == 2:
        indicators = int(described.numberOfEventIndicators or 0)
    else:
        indicators = sum(math.prod(each.variable.shape or ()) for each in described.eventIndicators)
    with probe.instance() as instance:
        probe.begin(instance, PLAIN)
        found = instance.numbers_of_states()
    for what, has, listed in zip(("continuous states", "event indicators"), found, (states, indicators)):
        if has != listed:
            yield f"it has {has} {what}, its description says {listed}"


RULES = (outputs, initial_unknowns, known_dependencies, derivatives)
OF_RUNS = (numbers_of_states,)
