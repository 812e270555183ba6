"""A request resolved against its FMUs, for any engine: its system checked, its sources, and its columns."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from fmu_kit.trajectory import Trajectory
from orchestration.components.building import fmus
from orchestration.components.fmi.access import SCHEDULED
from orchestration.components.fmi.instance import number_of
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD, TRAJECTORY
from orchestration.components.fmi.read_description import NUMERIC, DeclaredClock, Model, called, read_model
from orchestration.foundation.basics.errors import UsageError, prefixed, told_apart
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import Grid, exact_nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.simulation.engines import sources
from orchestration.simulation.engines.algebraic_loops import describe_loops
from orchestration.simulation.results import objectives
from orchestration.simulation.results.units import ColumnInfo, column_infos, units
from orchestration.systems.expressions.over_run import job_terms
from orchestration.systems.schedule.plan import FixedStep
from orchestration.systems.schedule.streams import VALUE, Streams
from orchestration.systems.signals.library import make_signal
from orchestration.systems.system.check import check, connect_references, describe_references, recorded_variables
from orchestration.systems.system.component import (
    OWN_PERIOD,
    Component,
    OwnPeriod,
    Sampling,
    has_scheduled_instants,
    instance_of,
)
from orchestration.systems.system.connection import MOTION, Source, component_of, variable_of
from orchestration.systems.system.model import System, expressions
from orchestration.systems.system.placement import tasks_of
from orchestration.systems.system.request import Request, errors_in_own_terms

PERIOD = "period"
"""The parameter by which a law usually has the period that it is programmed for"""
Announce = Callable[[str], None]
"""Receives a line for each thing that is done before the run begins."""


@dataclass(frozen=True, kw_only=True)
class CheckedSystem:
    """A system that has been checked against its FMUs."""

    system: System
    """System with the objectives whose variables exist, and with each reference connected to the component that follows
    it"""
    parameters: dict[str, float]
    """the numeric ones of all components, as COMPONENT.NAME"""
    units: dict[str, str]
    """Units of the metrics that have one"""
    follows: str
    """Text of which component follows which reference; empty where none does"""
    loops: Sequence[str]
    """Text of each algebraic loop of wires, and how it is closed"""
    events: Sequence[str]
    """Text of each component whose FMU handles its events itself, though it offers that the importer does"""
    of_jobs: Mapping[str, float]
    """Numbers of the run that do not depend on signals: terms about jobs in expressions, by their text"""


@dataclass(frozen=True, kw_only=True)
class ResolvedRequest(CheckedSystem):
    """A request whose system has been checked against its FMUs."""

    request: Request
    """Request as the user wrote it"""
    models: Mapping[str, Model]
    """Models of the FMUs, by component"""

    @property
    def foreign(self) -> list[str]:
        """Components whose FMUs were not built here from this project's sources."""
        return [name for name, model in self.models.items() if not model.is_own]

    @property
    def described(self) -> dict[str, ColumnInfo]:
        """The unit and the description of each column."""
        return column_infos(self.system, self.models, ("time", *signals_of(self.system, self.models)))

    def sources(self, streams: Streams) -> dict[str, sources.SourceValues]:
        """The values of the sources in a run, by name."""
        return {name: source_values(self.system, name, self.parameters, streams) for name in self.system.sources}


def resolve(request: Request, announce: Announce | None = None) -> ResolvedRequest:
    """Find the FMUs of a request, build them if need be, and check its system against them.

    Raises `UsageError` for what the FMUs do not have.
    """
    with errors_in_own_terms(request):
        system = request.as_system()
        if not system.components:
            raise UsageError("components = none: expected at least one to run; computers and networks alone have none")
        paths = fmus.of_components(system.fmus, announce)
    return resolve_with_models(request, {name: read_model(path) for name, path in paths.items()})


def resolve_with_models(request: Request, models: Mapping[str, Model]) -> ResolvedRequest:
    """As `resolve`, with FMUs whose models have been read."""
    with errors_in_own_terms(request):
        system = request.as_system()
        models = _as_asked(system, models)
        fits = check_against_fmus(system, models)
    return ResolvedRequest(request=request, models=models, **vars(fits))


def _as_asked(system: System, models: Mapping[str, Model]) -> dict[str, Model]:
    """The FMUs, each called in the way that its component asks for."""
    found = {}
    for name, model in models.items():
        with prefixed(f"components.{name}."):
            found[name] = called(model, system.components[name].access)
    return found


def check_against_fmus(system: System, models: Mapping[str, Model]) -> CheckedSystem:
    """Check a system against its FMUs; raises `UsageError` for what they do not have or do not accept."""
    models = _as_asked(system, models)
    check(system, models)
    words, system = describe_references(system, models), connect_references(system, models)
    for name, component in system.components.items():
        _expect_clock(name, component, models[name])
    for source in system.sources.values():
        _expect_exact(source, models)
    parameters = numeric_parameters(system, models)
    of_jobs: dict[str, float] = {}
    if job_terms(text for _, text in expressions(system)):
        from orchestration.simulation.engines.job_numbers import job_numbers  # not before: loads the scheduler

        of_jobs = job_numbers(system)
    system = objectives.with_available_objectives(system, signals_of(system, models), {*parameters, *of_jobs})
    loops = describe_loops(
        system,
        lambda name, output: models[name].depends_on(output),
        lambda name, output: models[name].follows_at_once(output),
    )
    return CheckedSystem(
        system=system, parameters=parameters, units=units(system, models), follows=words, loops=loops, of_jobs=of_jobs,
        events=[f"{name}: {_HANDLED}" for name, model in models.items() if model.handles_events],
    )  # fmt: skip


_HANDLED = 'the FMU handles its events itself, in its steps; interface = "event-mode" has them handled here and noted'


def columns_of(system: System) -> tuple[str, ...]:
    """The columns that every run of `system` has, whatever else is recorded."""
    exchanged = [start for x in system.connections for start in x.start]
    applied = [end for x in system.connections for end in x.end if system.components[x.receiver].sampling is None]
    of_sources = [signal for name, source in system.sources.items() for signal in source.signals(name)]
    return ("time", *dict.fromkeys((*applied, *exchanged, *of_sources)))


def _expect_exact(source: Source, models: Mapping[str, Model]) -> None:
    """Raise `UsageError` for a number in the file of a source that a 64-bit integer would have rounded."""
    if source.file is None or source.is_motion:
        return
    types = [models[component_of(end)].variables[variable_of(end)].type for end in source.to]
    wide = [
        column
        for column, type in zip(source.columns or [variable_of(end) for end in source.to], types)
        if type in ("Int64", "UInt64")
    ]
    if wide:
        from orchestration.systems.signals.table_file import read_rows

        rows = read_rows(source.file, wide)
        for column in wide:
            rows.expect_exact(column)


def _expect_clock(name: str, component: Component, model: Model) -> None:
    """Raise `UsageError` for a clock that the FMU does not have, or for parameters of it that the master sets."""
    sampling = component.sampling
    if model.interface == SCHEDULED and not model.ticking:
        names = ", ".join(clock.name for clock in model.clocks)
        raise UsageError(
            f"components.{name}.partition: expected one of {names}: {model.name} is for scheduled execution, in which "
            "each component is a partition"
        )
    if model.ticking:
        _expect_ticks(name, sampling, model.ticking[0])
    if sampling is None or not model.has_clock:
        if sampling is not None and sampling.clock == "fmu":
            raise UsageError(f"components.{name}.sampling.clock = fmu: expected an FMU with {SAMPLE_PERIOD}")
        return
    for parameter in (SAMPLE_PERIOD, SAMPLE_OFFSET):
        if parameter in component.parameters:
            raise UsageError(
                f"components.{name}.parameters.{parameter}: expected sampling instead; the master sets it, to 0 "
                "with clock master (the master decides when to sample) and to that of sampling with clock fmu"
            )


def _expect_ticks(name: str, sampling: Sampling | None, clock: DeclaredClock) -> None:
    """Raise `UsageError` for samples at which a clock of an FMU cannot tick."""
    place = f"components.{name}.sampling"
    if sampling is None:
        raise UsageError(
            f'{place}: expected {{ fmu_clock = "{clock.name}" }}: the FMU has clocks, which tick at samples'
        )
    if clock.variability == "constant" and not has_scheduled_instants(sampling):
        for key, value, fixed in (
            ("period", sampling.period, clock.interval),
            ("offset", sampling.offset, clock.shift),
        ):
            if fixed is not None and value != float(fixed):
                given, expected = told_apart(value, float(fixed))
                raise UsageError(f"{place}.{key} = {given}: expected {expected}, that of the constant {clock.name}")


def numeric_parameters(system: System, models: Mapping[str, Model]) -> dict[str, float]:
    """The numeric parameters of all components, by COMPONENT.NAME: those that are set, else as the FMUs start."""
    parameters = {}
    for name, model in models.items():
        values = system.components[name].parameters
        with prefixed(f"components.{name}.parameters."):
            for variable in model.variables.values():
                value = values.get(variable.name, variable.start)
                is_one = variable.causality == "parameter" or variable.is_constant
                if is_one and variable.kind in NUMERIC and value is not None:
                    parameters[f"{name}.{variable.name}"] = number_of(variable, value)
    return parameters


def signals_of(system: System, models: Mapping[str, Model]) -> set[str]:
    """All signals that are recorded or come from a source."""
    signals = {f"{name}.{each}" for name, variables in recorded_variables(system, models).items() for each in variables}
    return signals.union(columns_of(system)) - {"time"}


def source_values(system: System, name: str, parameters: Mapping[str, float], streams: Streams) -> sources.SourceValues:
    """The values of a source in a run; `parameters` are those of the component of a trajectory, as COMPONENT.NAME."""
    source = system.sources[name]
    if source.constant is not None:
        return sources.ConstantValues([source.constant] * len(source.to))
    if source.noise is not None and source.period is not None:
        return sources.WhiteNoise(source.noise, source.period, len(source.to), streams.of(f"sources.{name}", VALUE))
    if not source.is_built_in:
        values = _of_file_or_signal(system, name, streams)
        return values if source.scale == 1.0 else sources.Scaled(values, source.scale)
    fields = {f"{source.trajectory}.{name}": field for name, field in TRAJECTORY.items()}
    values_of_fields = {field: parameters[name] for name, field in fields.items() if name in parameters}
    return sources.BuiltIn(Trajectory(**values_of_fields))


def source_signals(system: System, parameters: Mapping[str, float], t: Floats) -> dict[str, Floats]:
    """The values of the sources of a run at times t [s], by signal, each of the shape of t; `parameters` as above."""
    streams = Streams(system.seed, system.streams)
    signals: dict[str, Floats] = {}
    for name, source in system.sources.items():
        values = source_values(system, name, parameters, streams).over(t)
        signals |= dict(zip(source.signals(name), values.T))
    return signals


def _of_file_or_signal(system: System, name: str, streams: Streams) -> sources.SourceValues:
    source = system.sources[name]
    quantities = [MOTION.index(".".join(signal.split(".")[-2:])) for signal in source.signals(name) if source.is_motion]
    if source.signal is not None:
        signal = make_signal(source.signal, source.parameters)
        if source.is_motion:
            return sources.Moving(sources.motion_values(signal), quantities)
        return sources.gusts(signal, system.stop_time, streams.of(f"sources.{name}", VALUE))
    from orchestration.systems.signals.waypoints import read_waypoints

    if source.is_motion:
        assert source.file is not None
        curve = read_waypoints(source.file, source.parameters)
        return sources.Moving(lambda t: curve.at(t).reshape(len(t), -1), quantities)
    table = table_of(source, system.stop_time)
    return sources.HeldValues(*table) if source.interpolation == "previous" else sources.TableValues(*table)


def table_of(source: Source, stop_time: float) -> tuple[Floats, Floats]:
    """The table of a source's file over the time of the run, as `read_table`."""
    from orchestration.systems.signals.table_file import read_table

    assert source.file is not None
    begin, held = source.start_time or 0.0, source.outside == "held"
    columns = source.columns or [variable_of(end) for end in source.to]
    return read_table(source.file, columns, stop_time, begin=begin, held=held)


def fixed_steps(system: System, models: Mapping[str, Model]) -> dict[str, FixedStep]:
    """Components in continuous time with a fixed step, by name."""
    steps = {}
    for name, component in system.components.items():
        if component.step is not None and not models[name].varies_step:
            grid = Grid(Fraction(0), exact_nanoseconds(component.step))
            steps[name] = FixedStep(name=name, grid=grid, moves=component.align == "next")
    return steps


def never_computed(system: System, models: Mapping[str, Model]) -> frozenset[str]:
    """The connections whose first exchange has start values of clocked outputs, which are computed at ticks only."""
    return frozenset(
        x.name for x in system.connections if any(models[x.sender].is_clocked(variable_of(start)) for start in x.start)
    )


def unbelieved_periods(system: System, models: Mapping[str, Model]) -> dict[str, tuple[float, float]]:
    """The components whose code believes another sampling period than theirs: theirs, also their step or that of their
    task on a computer, and what it believes [s]. Code with a parameter that follows the period is told it.
    """
    models = _as_asked(system, models)
    samplings = {name: component.sampling for name, component in system.components.items()}
    periods = {name: component.step for name, component in system.components.items() if component.step is not None}
    periods |= {name: sampling.period for name, sampling in samplings.items() if isinstance(sampling, Sampling)}
    tasks = {name: placed.task.period for name, placed in tasks_of(system).items()}
    periods |= {name: period for name, period in tasks.items() if period is not None}
    return {
        name: (period, believed)
        for name, period in periods.items()
        if not any(isinstance(value, OwnPeriod) for value in system.components[name].parameters.values())
        and (believed := models[name].believed_period) is not None
        and not math.isclose(believed, period, rel_tol=1e-6)
    }


def periods_in_words(system: System, models: Mapping[str, Model]) -> list[str]:
    """A warning for each such component."""
    return [
        f"{name} ({models[name].name}): is sampled every {period:g} s, but its code believes {believed:g} s: what it "
        f"computes of time is wrong by a factor of {max(period / believed, believed / period):.6g}"
        for name, (period, believed) in unbelieved_periods(system, models).items()
    ]


def other_periods_in_words(system: System, models: Mapping[str, Model]) -> list[str]:
    """What runs over periods mean for each such component of one of them."""
    return [
        f"{name} ({models[name].name}): its code believes {believed:g} s; at other periods this is the limit of that "
        "code, whose constants of time stay, not of a design for each period"
        for name, (_, believed) in unbelieved_periods(system, models).items()
    ]


def varied_periods_in_words(base: System, first: System, last: System, models: Mapping[str, Model]) -> list[str]:
    """Of a range of systems from `first` to `last` around `base`: a warning for each such component whose period stays,
    what it means for those whose period varies, and which components keep the period of the file as a parameter.
    """
    fixed, found = unbelieved_periods(first, models), unbelieved_periods(last, models)
    each = zip(found, periods_in_words(last, models), other_periods_in_words(last, models))
    believed = [stays if fixed.get(name) == found[name] else varies for name, stays, varies in each]
    return believed + _kept_periods_in_words(base, last, models)


def _kept_periods_in_words(base: System, varied: System, models: Mapping[str, Model]) -> list[str]:
    """What runs over periods mean for each component with a parameter `period` that is a number, that of its samples in
    the file, where another sampling period is varied.
    """
    before, now = numeric_parameters(base, models), numeric_parameters(varied, models)
    return [
        f'{name} keeps its parameter period of {quantity(kept, "s")}; with {PERIOD} = "{OWN_PERIOD}" under its '
        "parameters it follows"
        for name, one in varied.components.items()
        if one.sampling is not None
        and (kept := now.get(f"{name}.{PERIOD}")) not in (None, one.sampling.period)
        and kept == before[f"{name}.{PERIOD}"] == getattr(base.components[name].sampling, PERIOD)
        and models[name].variables[PERIOD].unit == "s"
    ]


def idle_partitions(system: System, models: Mapping[str, Model]) -> list[str]:
    """A warning for each instance with partitions that no component is, which never run."""
    found = []
    for shared in dict.fromkeys(map(instance_of, system.components.values())):
        names = [name for name, one in system.components.items() if shared and instance_of(one) == shared]
        taken = [system.components[name].partition for name in names]
        idle = [clock.name for name in names[:1] for clock in models[name].clocks if clock.name not in taken]
        if idle:
            found.append(f"{names[0]} ({models[names[0]].name}): no component is its partition {', '.join(idle)}")
    return found


def uneven_steps(system: System, models: Mapping[str, Model]) -> list[str]:
    """A warning for each sampled component whose steps differ although its FMU takes those of one length only."""
    return [
        f"{name} ({models[name].name}): its steps differ in length, as its samples are not evenly spaced; it declares "
        "that it takes steps of one length only"
        for name, sampling in ((name, component.sampling) for name, component in system.components.items())
        if sampling is not None
        and (sampling.is_random or has_scheduled_instants(sampling))
        and not models[name].varies_step
    ]
