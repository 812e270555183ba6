"""Checks a system against the model descriptions of its FMUs, and connects its references, before any is loaded."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from orchestration.components.fmi.instance import convert_value
from orchestration.components.fmi.kit import TRAJECTORY, USE_REFERENCE_INPUTS
from orchestration.components.fmi.read_description import NUMERIC, Model, Variable
from orchestration.foundation.basics.errors import UsageError, did_you_mean, expected_name, listed
from orchestration.systems.expressions.syntax import Name, names, parse, parts
from orchestration.systems.system.component import OWN_PERIOD, OwnPeriod, Parameter
from orchestration.systems.system.connection import MOTION, Connection, Source, component_of, variable_of
from orchestration.systems.system.conversion import BECOMES, OtherQuantity, conversion
from orchestration.systems.system.model import System, expressions
from orchestration.systems.system.requirements import is_finite


def check(system: System, models: Mapping[str, Model]) -> None:
    """Raise `UsageError` for the first thing that is invalid, in one line that names the place and what is valid."""
    for name, component in system.components.items():
        place = f"components.{name}"
        for parameter in component.parameters:
            check_parameter(system, models, name, parameter)
        for recorded in component.record or ():
            variable = models[name].variables.get(recorded)
            if variable is None:
                recordable = [
                    v.name
                    for v in models[name].variables.values()
                    if v.causality in ("output", "local") and v.name not in models[name].for_solvers
                ]
                has_no = f"{place}.record: {models[name].name} has no variable {recorded}"
                raise UsageError(f"{has_no}; {expected_name(recorded, recordable)}")
            if variable.kind not in NUMERIC:
                raise UsageError(f"{place}.record: {recorded} is a {variable.kind}: only numbers can be recorded")
            if variable.causality not in ("output", "local", "input"):
                is_other = f"{recorded} is {variable.role}"
                raise UsageError(f"{place}.record: {is_other}; expected an output, a local or an input")
    for x in system.connections:
        for end_key, ends, causality in (("from", x.start, "output"), ("to", x.end, "input")):
            model = models[component_of(ends[0])]
            missing = [variable_of(end) for end in ends if variable_of(end) not in model.variables]
            unfit = [variable_of(end) for end in ends if not _has_causality(model, variable_of(end), causality)]
            if missing or len(unfit) == len(ends) > 1:
                missing = missing or unfit
                raise UsageError(f"connections.{x.name}.{end_key}: {_missing_variables(model, causality, missing)}")
        for start, end in zip(x.start, x.end):
            _check_pair(f"connections.{x.name}", x, _end(models, start), _end(models, end))
    for name, source in system.sources.items():
        if not (source.to or source.trajectory or source.is_motion):
            raise UsageError(f"sources.{name}.to = nothing: expected inputs; only a motion may feed none")
        for end in source.to:
            _expect_input(f"sources.{name}.to", end, found := _end(models, end))
            if source.within_steps:
                _expect_solved(f"sources.{name}.within_steps = true", found)
        if source.trajectory is not None and source.trajectory not in system.components:
            known = ", ".join(system.components)
            raise UsageError(f"sources.{name}.trajectory = {source.trajectory}: expected one of the components {known}")
    if system.criterion.diverged is not None:
        _check_divergence(system.criterion.diverged, models)


def check_parameter(system: System, models: Mapping[str, Model], name: str, parameter: str) -> None:
    """Raise `UsageError` for a parameter that the FMU of a component does not have, or for an invalid value."""
    value, fed = system.components[name].parameters[parameter], f"{name}.{parameter}"
    is_fed, place = any(fed in x.end for x in system.connections), f"components.{name}.parameters.{parameter}"
    variable = models[name].variables.get(parameter)
    if variable is not None and variable.kind == "Real" and isinstance(value, str | OwnPeriod):
        written = OWN_PERIOD if isinstance(value, OwnPeriod) else value
        number = f"{place} = {written}: expected a number{f' in {variable.unit}' if variable.unit else ''}"
        if variable.unit not in (None, "s"):
            raise UsageError(number if isinstance(value, str) else f"{number}; {OWN_PERIOD} is in s")
        if isinstance(value, str):
            raise UsageError(f'{number}, or "{OWN_PERIOD}": that of its component')
    expect_parameter(place, models[name], parameter, value, is_fed=is_fed)


def _check_divergence(condition: str, models: Mapping[str, Model]) -> None:
    """Raise `UsageError` for a Real signal as a part of the condition: it would hold wherever it is not zero."""
    for part in parts(parse(condition)):
        name = part.text if isinstance(part, Name) else ""
        model = models.get(component_of(name))
        variable = None if model is None else model.variables.get(variable_of(name))
        if variable is not None and variable.kind == "Real":
            raise UsageError(f"criterion.diverged: {name} is a Real; expected a condition, as in {name} > 1")


def recorded_variables(system: System, models: Mapping[str, Model]) -> dict[str, tuple[str, ...]]:
    """The variables to record of each component beside exchanged ones: its `record`, or all outputs and local Reals.

    Without `record`, constants are left out. A variable in an expression, by its name or as a part of a vector, is
    recorded in any case, as is an input of a sampled component, with what its last sample took.
    """
    texts = {name for _, expression in expressions(system) for name in names(parse(expression))}
    named = texts.union(f"{name}.{axis}" for name in texts for axis in "xyzw")
    found = {}
    for name, component in system.components.items():
        model = models[name]
        kinds = ("output", "local") if component.sampling is None else ("output", "local", "input")
        needed = [
            v.name
            for v in model.variables.values()
            if f"{name}.{v.name}" in named and v.kind in NUMERIC and v.causality in kinds
        ]
        if component.record is not None:
            found[name] = (*dict.fromkeys((*component.record, *needed)),)
            continue
        unnamed = {v for v in model.for_solvers if f"{name}.{v}" not in named}
        chosen = [
            v.name
            for v in model.variables.values()
            if (v.causality == "output" and v.kind in NUMERIC)
            or (v.causality == "local" and v.kind == "Real" and not v.is_constant and v.name not in unnamed)
        ]
        found[name] = (*dict.fromkeys((*chosen, *needed)),)
    return found


def _has_causality(model: Model, name: str, causality: str) -> bool:
    found = model.variables[name].causality if name in model.variables else None
    return found == causality or (found, causality) == ("local", "output")


def _end(models: Mapping[str, Model], end: str) -> tuple[str, Model, Variable | None]:
    model = models[component_of(end)]
    return end, model, model.variables.get(variable_of(end))


End = tuple[str, Model, Variable | None]


def _check_pair(place: str, x: Connection, start: End, end: End) -> None:
    _, model, output = start
    if output is None or output.causality not in ("output", "local"):
        raise UsageError(f"{place}.from: {_wrong_causality(start, 'output', model.names('output'))}")
    if output.kind not in NUMERIC:
        raise UsageError(f"{place}.from: {start[0]} is a {output.kind}; only {listed(NUMERIC)} can be connected")
    receiver = _expect_input(f"{place}.to", end[0], end)
    _check_kinds(place, start[0], output, end[0], receiver)
    if not (x.stated or x.converts or output.unit == receiver.unit):
        _check_units(place, start[0], model, output, end[0], end[1], receiver)


def _check_units(
    place: str, start: str, sender: Model, output: Variable, end: str, receiver: Model, into: Variable
) -> None:
    """Raise `UsageError`, proposing a conversion, for units that differ by more than their spelling."""
    try:
        found = conversion(sender, output, receiver, into)
    except OtherQuantity:
        needed = "; they are of different quantities"
    else:
        if found is not None and found.is_none:
            return
        needed = ", or scale and offset in the connection" if found is None else f": {found} in the connection"
    raise UsageError(f"{place}: {start} is in {output.unit}, {end} in {into.unit}; expected the same unit{needed}")


def _check_kinds(place: str, start: str, output: Variable, end: str, receiver: Variable) -> None:
    if receiver.kind not in BECOMES[output.kind]:
        expected = listed(kind for kind in NUMERIC if kind in BECOMES[output.kind])
        raise UsageError(f"{place}: {start} is a {output.kind}, {end} a {receiver.kind}; expected {expected}")


def _expect_input(place: str, end: str, found: End) -> Variable:
    _, model, variable = found
    if variable is None or variable.causality != "input":
        raise UsageError(f"{place}: {_wrong_causality(found, 'input', model.names('input'))}")
    if variable.kind not in NUMERIC:
        raise UsageError(f"{place}: {end} is a {variable.kind}; only {listed(NUMERIC)} can be connected")
    return variable


def _expect_solved(place: str, found: End) -> None:
    """Raise `UsageError` for an input that cannot change within a step."""
    name, model, variable = found
    if model.interface != "model-exchange":
        raise UsageError(f"{place}: {name} is called by {model.interface}; expected model-exchange")
    if variable is None or variable.type not in ("Real", "Float64", "Float32") or variable.variability != "continuous":
        raise UsageError(f"{place}: {name} changes at events only; expected continuous inputs")


def _missing_variables(model: Model, causality: str, missing: list[str]) -> str:
    """The variables that a model lacks as ends of a connection, with those that it has."""
    names = model.names(causality)
    listing = f"its {causality}s are {listed(names)}{did_you_mean(missing[0], names)}"
    return f"{model.name} has no {causality} {', '.join(missing)}; {listing}"


def _wrong_causality(end: End, expected: str, valid: Iterable[str]) -> str:
    name, model, variable = end
    if variable is None:
        return _missing_variables(model, expected, [variable_of(name)])
    return f"{name} is {variable.role}; expected an {expected}: {listed(valid)}"


def expect_parameter(place: str, model: Model, name: str, value: Parameter, *, is_fed: bool = False) -> None:
    """Raise `UsageError`, naming the `place`, for a parameter that a model does not have, or for an invalid value."""
    variable = model.variable(name, place)
    if not (variable.is_settable or variable.has_settable_start or variable.is_constant) or is_fed:
        expected = "a parameter, an input that nothing is connected to, or a variable whose start value can be set"
        raise UsageError(f"{place}: is {'connected' if is_fed else variable.role}; expected {expected}")
    if isinstance(convert_value(variable, value, place), float) and not is_finite(value):
        raise UsageError(f"{place} = {value}: expected a finite number")
    low, high = variable.minimum, variable.maximum
    outside = (low is not None and value < low) or (high is not None and value > high) if is_finite(value) else False
    if outside:
        bounds = " and ".join(
            f"{word} {bound:g}" for word, bound in (("at least", low), ("at most", high)) if bound is not None
        )
        raise UsageError(f"{place} = {value}: expected {bounds}")


BUILT_IN, AT_REST = "paper", "hover"
"""Signals: the built-in trajectory of this project's controllers, and the only one that needs no inputs"""


def connect_references(system: System, models: Mapping[str, Model]) -> System:
    """The `system` with each reference source connected to the inputs of the component that follows it.

    A component without a built-in trajectory is fed the paper's. Raises `UsageError` for one without inputs for its
    reference, naming them.
    """
    sources, components = dict(system.sources), dict(system.components)
    for name, source, follower in _reference_sources(system):
        model = models[follower]
        if source.is_built_in and not TRAJECTORY.keys().isdisjoint(model.variables):
            continue
        inputs = {*model.names("input")}
        to = tuple(f"{follower}.{name}.{each}" for each in MOTION if f"{name}.{each}" in inputs)
        lacking = [f"{name}.{each}" for each in MOTION[:3] if f"{name}.{each}" not in inputs]
        if lacking and (to or source.signal != AT_REST):
            held = f"{name} {AT_REST}, for one that holds a point by itself"
            raise UsageError(
                f"sources.{name}: {model.name} cannot follow it without the inputs {', '.join(lacking)}; "
                f"expected {held}"
            )
        signal = BUILT_IN if source.is_built_in else source.signal
        sources[name] = replace(source, signal=signal, trajectory=None, to=to)
        if to and USE_REFERENCE_INPUTS in model.variables:
            parameters = {**components[follower].parameters, USE_REFERENCE_INPUTS: True}
            components[follower] = replace(components[follower], parameters=parameters)
    return system if sources == system.sources else replace(system, sources=sources, components=components)


def describe_references(system: System, models: Mapping[str, Model]) -> str:
    """The references of a system and the components that follow them, as text; empty if there are none."""
    fed = connect_references(system, models)
    words = (
        _description(source, fed.sources[name], models[follower])
        for name, source, follower in _reference_sources(system)
    )
    return "; ".join(words)


def _reference_sources(system: System) -> Iterator[tuple[str, Source, str]]:
    """The sources that a component follows: name, source, and the name of the component."""
    for name, source in system.sources.items():
        if source.trajectory is not None:
            yield name, source, source.trajectory


def _description(source: Source, fed: Source, follower: Model) -> str:
    if fed.trajectory is not None:
        return f"the trajectory that {follower.name} has built in"
    what = "the paper's trajectory" if source.is_built_in else source.signal or str(source.file)
    if not fed.to:
        return f"{what}, which {follower.name} holds by itself"
    quantities = dict.fromkeys(end.split(".")[-2] for end in fed.to)
    return f"{what}, fed to {follower.name} as {', '.join(quantities)}"
