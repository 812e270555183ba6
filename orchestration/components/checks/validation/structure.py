"""Rules on the model structure (FMI 2.0.4, section 2.2.8; FMI 3.0, section 2.4.8)."""

from collections import Counter
from collections.abc import Iterable, Iterator

from orchestration.components.checks.validation.declared import Unknown, Variable
from orchestration.components.checks.validation.fmu import Fmu


def indices(fmu: Fmu) -> Iterator[str]:
    """Every index, in FMI 3.0 every value reference, is that of a variable."""
    handle = fmu.standard.handle
    expected = f"1 to {len(fmu.variables)}" if fmu.version == 2 else "that of a variable"
    for where, unknowns in fmu.lists:
        for unknown in unknowns:
            for found in (unknown.handle, *(unknown.dependencies or ())):
                if fmu.variable(found) is None:
                    yield f"{where}: {handle} {found}, expected {expected}"
    for v in fmu.variables:
        derivative = {} if v.derivative_of is None else {"derivative": (v.derivative_of,)}
        for what, named in {**derivative, **v.others}.items():
            for found in named:
                if fmu.variable(found) is None:
                    yield f"{v.name}: {what} of {handle} {found}, expected {expected}"


def outputs(fmu: Fmu) -> Iterator[str]:
    """Outputs lists each output once, and nothing else."""
    yield from _compared(fmu, fmu.standard.lists.outputs[0], fmu.outputs, fmu.of_causality("output"))


def initial_unknowns(fmu: Fmu) -> Iterator[str]:
    """InitialUnknowns lists the variables that initialisation calculates and others may read, in FMI 2.0 in order.

    Of variables with a derivative only those whose derivative is under Derivatives are states (FMI 2.0.4, section
    2.2.8). Clocked variables may be listed, and need not.
    """
    where = fmu.standard.lists.initial_unknowns[0]
    listed_derivatives = {unknown.handle for unknown in fmu.derivatives}
    states = {v.derivative_of for v in map(fmu.variable, listed_derivatives) if v is not None}
    expected = [
        v
        for v in fmu.variables
        if v.causality == "calculatedParameter"
        or (
            (v.initial in ("approx", "calculated"))
            and (v.causality == "output" or v.handle in states or v.handle in listed_derivatives)
            and not v.is_clocked
        )
    ]
    yield from _compared(fmu, where, fmu.initial_unknowns, expected, [v for v in fmu.variables if v.is_clocked])
    order = [unknown.handle for unknown in fmu.initial_unknowns]
    if fmu.version == 2 and order != sorted(order):
        yield f"{where}: expected the entries in the order of their indices"


def known_dependencies(fmu: Fmu) -> Iterator[str]:
    """Outputs depend on variables known in that mode, in FMI 2.0 listed in the order of the indices.

    Derivatives are not checked: for co-simulation they mean nothing, and the FMI project's own FMUs list parameters.
    """
    called = fmu.standard.lists
    states = {v.derivative_of for v in fmu.variables if v.derivative_of is not None}
    for (where, _), unknowns in ((called.outputs, fmu.outputs), (called.initial_unknowns, fmu.initial_unknowns)):
        initially = unknowns is fmu.initial_unknowns
        for unknown in unknowns:
            listed = unknown.dependencies or ()
            name = _name(fmu, unknown.handle)
            if fmu.version == 2 and list(listed) != sorted(set(listed)):
                yield f"{where}: {name}: expected its dependencies once each, in the order of their indices"
            for known in filter(None, map(fmu.variable, listed)):
                is_known = known.causality in ("input", "independent") or known.handle in states or known.is_clocked
                if not (is_known or (known.initial == "exact" if initially else _is_kept(fmu, known))):
                    yield f"{where}: {name} depends on {known.name}, a {known.causality}: expected an input"


def _is_kept(fmu: Fmu, variable: Variable) -> bool:
    """Whether FMI 3.0 takes it for known at a communication point: parameters, and states in discrete time."""
    parameter = variable.causality in ("parameter", "structuralParameter")
    return fmu.version > 2 and (parameter or variable.variability == "discrete")


def _compared(
    fmu: Fmu, where: str, unknowns: Iterable[Unknown], expected: Iterable[Variable], allowed: Iterable[Variable] = ()
) -> Iterator[str]:
    found = Counter(unknown.handle for unknown in unknowns)
    needed = {v.handle: v.name for v in expected}
    for handle, name in needed.items():
        if found[handle] != 1:
            yield f"{where}: {name} is there {found[handle]} times, expected once"
    may_be = {v.handle for v in allowed}
    for handle in found:
        if handle not in needed and handle not in may_be and fmu.variable(handle) is not None:
            yield f"{where}: {_name(fmu, handle)} is there, expected it not to be"


def _name(fmu: Fmu, handle: int) -> str:
    variable = fmu.variable(handle)
    return f"{fmu.standard.handle} {handle}" if variable is None else variable.name


RULES = (indices, outputs, initial_unknowns, known_dependencies)
