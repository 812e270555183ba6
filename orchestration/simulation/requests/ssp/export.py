"""The part of a system that an SSP carries: FMUs with their parameters, connections, and one step for all."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path

from orchestration.components.building import fmus
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.components.fmi.read_description import Model, Variable, called, read_model
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.resolved import source_values
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.check import AT_REST, check, connect_references
from orchestration.systems.system.component import Component, Parameter, Sampling
from orchestration.systems.system.connection import Connection, Source, component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request, errors_in_own_terms


@dataclass(frozen=True, kw_only=True)
class Part:
    """One FMU of the system."""

    name: str
    fmu: Path
    model: Model
    parameters: dict[str, Parameter]
    """all parameters with a start value, and inputs that have a value"""
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    """the connected ones"""

    def variable(self, name: str) -> Variable:
        """The declaration of a variable."""
        return self.model.variables[name]


@dataclass(frozen=True, kw_only=True)
class Export:
    """A system for third-party masters."""

    system: System
    parts: tuple[Part, ...]
    """sampled ones first, each kind in the order of this project's master at one instant: so a tool that steps them in
    order exchanges the same values"""
    step: float
    """communication step of all [s]"""
    unsupported: tuple[str, ...]
    """a line for each feature that an SSP lacks, with its place"""


def export_of(request: Request, announce: Callable[[str], None] | None = None) -> Export:
    """The part of a system that an SSP carries, and the features that it lacks.

    Those are: faults and noise, sources that are no constant, and different steps. A sampled component needs the common
    step as its period, or an FMU with its own clock by `sample_period`.
    """
    with errors_in_own_terms(request):
        system = request.as_system()
        located = fmus.of_components(system.fmus, announce)
        models = {name: read_model(path) for name, path in located.items()}
        check(system, models)
        system = _with_constants_at_rest(connect_references(system, models))
        plan = Plan(system)
        step, unequal = _common_step(system, models)
        unsupported = (*_unsupported(system, models), *unequal)
        return Export(
            system=system,
            parts=tuple(_part(system, name, located[name], models[name]) for name in plan.sampled + plan.continuous),
            step=step,
            unsupported=tuple(map(request.in_own_terms, unsupported)),
        )


def _with_constants_at_rest(system: System) -> System:
    """The system with a constant for each input that is fed a motion at rest."""
    sources: dict[str, Source] = {}
    for name, source in system.sources.items():
        if source.signal != AT_REST or not source.to:
            sources[name] = source
            continue
        values = source_values(system, name, {}, Streams(system.seed, system.streams)).at(0.0)
        sources |= {
            f"{name}_{i}": Source(constant=float(value), to=(end,))
            for i, (end, value) in enumerate(zip(source.to, values, strict=True))
        }
    return replace(system, sources=sources)


def complete_export(request: Request, announce: Callable[[str], None] | None) -> Export:
    """As `export_of`; raises `UsageError` for the first feature that an SSP lacks."""
    export = export_of(request, announce)
    if export.unsupported:
        raise UsageError(export.unsupported[0])
    return export


def _unsupported(system: System, models: Mapping[str, Model]) -> Iterator[str]:
    for name, component in system.components.items():
        interface = called(models[name], component.access).interface
        if interface != "co-simulation":
            yield f"components.{name}.interface = {interface}: an SSP is written of co-simulation alone; expected that"
        yield from _unsupported_fields(f"components.{name}", component, ("start_time", "points"))
        if component.sampling is not None:
            yield from _unsupported_fields(f"components.{name}.sampling", component.sampling, ("jitter", "clock_ratio"))
    for table in ("computers", "networks"):
        for name in getattr(system, table):
            yield f"{table}.{name}: an SSP cannot express that; expected none"
    for x in system.connections:
        yield from _unsupported_fields(f"connections.{x.name}", x, FAULTS)
    for name, source in system.sources.items():
        if source.to and source.constant is None:
            kind = next(kind for kind in ("file", "noise", "signal") if getattr(source, kind) is not None)
            yield f"sources.{name}.{kind}: an SSP cannot feed one; expected a constant"


FAULTS = ("delay", "delay_jitter", "loss", "hold", "noise", "quantisation")
"""The fields of a connection that an SSP lacks"""


def _unsupported_fields(place: str, of: Component | Sampling | Connection, keys: tuple[str, ...]) -> Iterator[str]:
    defaults = {f.name: f.default for f in fields(of)}
    for key in keys:
        value = getattr(of, key)
        if isinstance(value, Mapping):
            if any(value.values()):
                yield f"{place}.{key}: an SSP cannot express that; expected none"
        elif value != defaults[key]:
            yield f"{place}.{key} = {value}: an SSP cannot express that; expected {defaults[key]}"


def _common_step(system: System, models: Mapping[str, Model]) -> tuple[float, list[str]]:
    """The first step of the components in continuous time, or else the first period; and a line for each other."""
    steps = {f"components.{name}.step": c.step for name, c in system.components.items() if c.step is not None}
    by_master = {
        name: c.sampling
        for name, c in system.components.items()
        if c.sampling is not None and not models[name].has_clock
    }
    periods = {f"components.{name}.sampling.period": sampling.period for name, sampling in by_master.items()}
    own = [c.sampling.period for c in system.components.values() if c.sampling is not None]
    first = next(iter((*steps.values(), *periods.values(), *own)))
    unsupported = [
        f"{place} = {step}: an SSP has one step for all; expected {first}"
        for place, step in (steps | periods).items()
        if step != first
    ]
    unsupported += [
        f"components.{name}.sampling.offset = {sampling.offset}: an SSP cannot express that; expected 0"
        for name, sampling in by_master.items()
        if sampling.offset != 0.0
    ]
    return first, unsupported


def _part(system: System, name: str, path: Path, model: Model) -> Part:
    component = system.components[name]
    return Part(
        name=name,
        fmu=path,
        model=model,
        parameters=_values(component, model, _constants(system, name)),
        inputs=tuple(variable_of(end) for x in system.connections for end in x.end if x.receiver == name),
        outputs=_outputs(system, name, model),
    )


def _outputs(system: System, name: str, model: Model) -> tuple[str, ...]:
    found = tuple(dict.fromkeys(variable_of(s) for x in system.connections for s in x.start if x.sender == name))
    for output in found:
        if model.variables[output].causality != "output":
            raise UsageError(f"{name}.{output}: is a local of its FMU; an SSP connects outputs only")
    return found


def _constants(system: System, name: str) -> dict[str, Parameter]:
    """The values of inputs that constants feed."""
    return {
        variable_of(end): source.constant
        for source in system.sources.values()
        for end in source.to
        if component_of(end) == name and source.constant is not None
    }


def _values(component: Component, model: Model, constants: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """The values of a component in the order of the FMU: all numeric parameters, and others with a value."""
    values = {**component.parameters, **constants}
    if component.sampling is not None and model.has_clock:
        values |= {SAMPLE_PERIOD: component.sampling.period, SAMPLE_OFFSET: component.sampling.offset}
    found: dict[str, Parameter] = {}
    for variable in model.variables.values():
        if variable.is_constant:
            continue
        if variable.name in values:
            value = _typed(values[variable.name], variable)
            # A Boolean only if it is not the start value: fmpy reads the text false as true.
            if variable.kind != "Boolean" or str(value).lower() != variable.start:
                found[variable.name] = value
        elif variable.causality == "parameter" and variable.kind in ("Real", "Integer") and variable.start is not None:
            found[variable.name] = int(variable.start) if variable.kind == "Integer" else float(variable.start)
    return found


def _typed(value: Parameter, variable: Variable) -> Parameter:
    if variable.kind == "Real":
        return float(value)
    if variable.kind in ("Integer", "Enumeration") and isinstance(value, float):
        return round(value)  # from a source, or from the command line
    return bool(value) if variable.kind == "Boolean" and not isinstance(value, str) else value
