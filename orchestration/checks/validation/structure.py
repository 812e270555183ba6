"""Rules on the model structure (FMI 2.0.4, section 2.2.8)."""

from collections import Counter
from collections.abc import Iterable, Iterator

from orchestration.checks.validation.fmu import Fmu, Unknown, Variable


def indices(fmu: Fmu) -> Iterator[str]:
    """Every index is that of a variable."""
    for where, unknowns in _lists(fmu):
        for unknown in unknowns:
            for index in (unknown.index, *(unknown.dependencies or ())):
                if fmu.variable(index) is None:
                    yield f"{where}: index {index}, expected 1 to {len(fmu.variables)}"
    for v in fmu.variables:
        if v.derivative_of is not None and fmu.variable(v.derivative_of) is None:
            yield f"{v.name}: derivative of index {v.derivative_of}, expected 1 to {len(fmu.variables)}"


def outputs(fmu: Fmu) -> Iterator[str]:
    """Outputs lists each output once, and nothing else."""
    yield from _compared(fmu, "Outputs", fmu.outputs, fmu.of_causality("output"))


def initial_unknowns(fmu: Fmu) -> Iterator[str]:
    """InitialUnknowns lists, in order, what initialisation calculates and others may ask for.

    Of what has a derivative only that of a derivative under Derivatives is a state (FMI 2.0.4, section 2.2.8).
    """
    listed_derivatives = {unknown.index for unknown in fmu.derivatives}
    states = {v.derivative_of for v in map(fmu.variable, listed_derivatives) if v is not None}
    expected = [
        v
        for v in fmu.variables
        if v.causality == "calculatedParameter"
        or (
            (v.initial in ("approx", "calculated"))
            and (v.causality == "output" or v.index in states or v.index in listed_derivatives)
        )
    ]
    yield from _compared(fmu, "InitialUnknowns", fmu.initial_unknowns, expected)
    order = [unknown.index for unknown in fmu.initial_unknowns]
    if order != sorted(order):
        yield "InitialUnknowns: expected the entries in the order of their indices"


def known_dependencies(fmu: Fmu) -> Iterator[str]:
    """Outputs depend on what is known in that mode, listed in the order of the indices.

    Derivatives are not looked at: for co-simulation they mean nothing, and the FMI project's own FMUs list parameters.
    """
    states = {v.derivative_of for v in fmu.variables if v.derivative_of is not None}
    for where, unknowns in (("Outputs", fmu.outputs), ("InitialUnknowns", fmu.initial_unknowns)):
        for unknown in unknowns:
            listed = unknown.dependencies or ()
            name = _name(fmu, unknown.index)
            if list(listed) != sorted(set(listed)):
                yield f"{where}: {name}: expected its dependencies once each, in the order of their indices"
            for known in filter(None, map(fmu.variable, listed)):
                exact = where == "InitialUnknowns" and known.initial == "exact"
                if not (exact or known.causality in ("input", "independent") or known.index in states):
                    yield f"{where}: {name} depends on {known.name}, a {known.causality}: expected an input"


def _lists(fmu: Fmu) -> tuple[tuple[str, tuple[Unknown, ...]], ...]:
    return ("Outputs", fmu.outputs), ("Derivatives", fmu.derivatives), ("InitialUnknowns", fmu.initial_unknowns)


def _compared(fmu: Fmu, where: str, unknowns: Iterable[Unknown], expected: Iterable[Variable]) -> Iterator[str]:
    found = Counter(unknown.index for unknown in unknowns)
    needed = {v.index: v.name for v in expected}
    for index, name in needed.items():
        if found[index] != 1:
            yield f"{where}: {name} is there {found[index]} times, expected once"
    for index in found:
        if index not in needed and fmu.variable(index) is not None:
            yield f"{where}: {_name(fmu, index)} is there, expected it not to be"


def _name(fmu: Fmu, index: int) -> str:
    variable = fmu.variable(index)
    return f"index {index}" if variable is None else variable.name


RULES = (indices, outputs, initial_unknowns, known_dependencies)
