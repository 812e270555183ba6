"""One FMU alone as a system, as `fmpy simulate` runs it: its default experiment, and inputs from a file."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
from fmpy.util import auto_interval

from orchestration.components.fmi.access import SCHEDULED, Access, Interface, Solver
from orchestration.components.fmi.instance import convert_value
from orchestration.components.fmi.read_description import Model, called, declared_of, read_model
from orchestration.foundation.basics.errors import UsageError, did_you_mean, listed, prefixed
from orchestration.foundation.basics.times import common_step
from orchestration.simulation.engines.resolved import table_of
from orchestration.systems.signals.table_file import TIME, header_of, read_rows, words_of
from orchestration.systems.system.component import Component, Parameter, Sampling
from orchestration.systems.system.connection import Source, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.proposal import component_names, experiment

LONG = 1e4
"""Default end [s] from which a run may take long"""
SHORTEST = Fraction(1, 100_000)
"""Shortest step [s] that a warning advises"""
MOST_ROWS = 1000
"""Rows above which the interval of the FMU is doubled, as fmpy does"""


def alone(
    path: Path,
    *,
    start_time: float | None = None,
    stop_time: float | None = None,
    interval: float | None = None,
    tolerance: float | None = None,
    inputs: Path | None = None,
    record: Sequence[str] = (),
    parameters: Mapping[str, Parameter] | None = None,
    interface: Interface | None = None,
    solver: Solver | None = None,
) -> System:
    """The FMU at `path` as the only component, in continuous time; what is not given follows its default experiment.

    `interval` [s] is that of the communication points, `inputs` a CSV file with a column for each input that it feeds,
    whose first and last row hold before and after; where one jumps, the FMU has a communication point, unless it takes
    steps of one length only. `start_time` and `stop_time` are times of the FMU; the run begins
    at 0. Periodic clocks tick, and the rows are those of the ticks of the fastest; one that states no interval has
    `interval`. Raises `UsageError` for a file that is no FMU, or that only a system can run.
    """
    model = read_model(path)
    with prefixed(f"{path}: "):
        model = called(model, Access(interface=interface, solver=solver))
    begin = (_time(model, "startTime") or 0.0) if start_time is None else start_time
    stop = _time(model, "stopTime") if stop_time is None else stop_time
    end = 1.0 if stop is None else float(Decimal(repr(stop)) - Decimal(repr(begin)))
    if end <= 0.0:
        raise UsageError(f"{path}: runs from {begin:g} s to {begin + end:g} s: expected an end after its start")
    step = interval or _interval(model, end)
    if stop_time is None and not model.varies_step and end > step:
        end = step * math.floor(end / step + 1e-9)  # as fmpy: no shorter step at the end
    name = component_names([model])[0]
    clock = _clock(model, name, record, interval)
    sources = {} if inputs is None else _sources(model, name, inputs, begin)
    has_points = clock is None and model.varies_step
    component = Component(
        fmu=str(path),
        step=step if clock is None else None,
        points=tuple(sorted({time for time, _ in _jumps(sources, end)})) if has_points else (),
        sampling=clock,
        tolerance=tolerance,
        record=_recorded(model, record),
        parameters=model.by_elements(parameters or {}, f"{model.path}: "),
        interface=interface,
        solver=solver,
        start_time=begin or None,
    )
    return System(stop_time=end, components={name: component}, sources=sources)


def outputs(model: Model) -> list[str]:
    """What fmpy records if nothing is chosen: outputs, or else the first five states."""
    of_states = (one.variable.derivative for one in model.description.derivatives or ())
    states = [state.name for state in of_states if state is not None and state.causality in ("output", "local")]
    return list(model.names("output")) or states[:5]


def remarks(system: System, *, is_default_end: bool) -> Iterator[str]:
    """What a run of one FMU does with times that the user may expect otherwise."""
    (component,) = system.components.values()
    if is_default_end and system.stop_time >= LONG and component.step is not None:
        steps = math.ceil(system.stop_time / component.step - 1e-9)
        yield (
            f"runs for {system.stop_time:g} s, as {component.fmu} declares, in {steps} steps of {component.step:g} s; "
            "--stop-time T ends sooner, --solver cvode is for stiff models by model exchange"
        )
    begin = component.start_time or 0.0
    if begin:
        yield f"its time begins at {begin:g} s, where that of the run is 0"
    for file in dict.fromkeys(source.file for source in system.sources.values() if source.file is not None):
        first, *_, last = read_rows(file, (TIME,)).columns[TIME].tolist()
        if first > begin or last < begin + system.stop_time:
            yield f"{file} covers {first:g} to {last:g} s: its first and last row hold before and after"


def late_jump(system: System) -> str | None:
    """The warning about inputs that jump between communication points: the first jump, and the step that has all."""
    (component,) = system.components.values()
    if component.step is None:
        return None  # inputs are set at ticks
    begin, step = Fraction(repr(component.start_time or 0.0)), Fraction(repr(component.step))
    jumps = _jumps(system.sources, system.stop_time)
    late = [(Fraction(repr(time)), name) for time, name in jumps if time not in component.points]
    late = [(time, name) for time, name in late if time % step]
    if not late:
        return None
    first, name = min(late)
    shorter = common_step([step, *(time for time, _ in late)])
    advice = f"; --output-interval {float(shorter):.10g} has every jump at its time" if shorter >= SHORTEST else ""
    return (
        f"input {name} jumps at {float(begin + first)} s, between steps of {float(step):.10g} s, which the FMU takes "
        f"only: it has it from {float(begin + math.ceil(first / step) * step):.10g} s on{advice}"
    )


def _jumps(sources: Mapping[str, Source], end: float) -> Iterator[tuple[float, str]]:
    """The times of a run up to `end` at which inputs jump [s], and their names."""
    for source in sources.values():
        times, values = table_of(source, end)
        may_jump = np.diff(times) == 0.0 if source.interpolation == "linear" else True
        for column, to in zip(values.T, source.to):
            jumps = times[1:][(np.diff(column) != 0.0) & may_jump].tolist()
            yield from ((time, variable_of(to)) for time in jumps if 0.0 < time < end)


def _clock(model: Model, name: str, record: Sequence[str], interval: float | None) -> Sampling | None:
    """The ticks of the fastest clock of an FMU; None: it has none that ticks.

    Raises `UsageError`, with the command that makes it a system, for one whose variables or clocks need more.
    """
    if model.interface == SCHEDULED:
        clocks = [clock.name for clock in model.clocks]
        raise UsageError(
            f"{model.path}: is for scheduled execution, in which each of its clocks has a partition: "
            f"{', '.join(clocks)}; expected a system of them, {_as_system(model)}"
        )
    if not model.ticking:
        try:
            model.expect_clocks_that_tick()
        except UsageError:
            if model.access.interface is not None or "event-mode" not in declared_of(model.description):
                raise
            model = called(model, replace(model.access, interface="event-mode"))
    if not model.ticking:
        return None
    clock, written = model.ticking[0], set(record or outputs(model))
    between = [v.name for v in model.description.modelVariables if v.name in written and not v.clocks]
    if between or (clock.interval is None and interval is None):
        ticked = [v.name for v in model.description.modelVariables if v.clocks and v.causality == "output"]
        what, needed = f"its clock {clock.name} states no interval", "--output-interval SECONDS"
        if between:
            what = f"{listed(between)} may change between the ticks of its clocks, the times of all rows"
            needed = f"--record of outputs that do not, {listed(ticked)}"
        raise UsageError(f"{model.path}: {what}; expected {needed}, or a system, {_as_system(model)}")
    period = float(clock.interval or 0) if interval is None else interval
    return Sampling(period=period, offset=float(clock.shift), fmu_clock=clock.name)


def _as_system(model: Model) -> str:
    """The command that proposes a file with what of an FMU ticks, for a message."""
    return f"of which quadcosim connect {model.path} --out FILE.toml writes the lines, and run FILE.toml"


def _time(model: Model, key: str) -> float | None:
    """A time of its default experiment [s]; None: it has none."""
    declared = getattr(model.description.defaultExperiment, key, None)
    return None if declared is None else float(declared)


def _interval(model: Model, stop_time: float) -> float:
    """The interval of the communication points [s] that fmpy takes."""
    fixed = getattr(model.description.coSimulation, "fixedInternalStepSize", None)
    interval = float(fixed) if fixed else experiment(model, "stepSize")
    if interval is None:
        return float(auto_interval(stop_time))
    while stop_time / interval > MOST_ROWS:
        interval *= 2.0
    return interval


def _recorded(model: Model, names: Sequence[str]) -> tuple[str, ...] | None:
    """The variables of these names, those of an array by its elements; None: what a system records by default."""
    elements: dict[str, list[str]] = {}
    for variable in model.variables.values():
        elements.setdefault(variable.whole, []).append(variable.name)
    return tuple(each for name in names for each in elements.get(name, [name])) or None


def _sources(model: Model, name: str, inputs: Path, begin: float) -> dict[str, Source]:
    """The columns of a file as inputs: continuous ones along the line between rows, all others held.

    A solver of this program has the line, as fmpy's; an FMU that solves itself has its values at communication points.
    """
    known, columns = model.names("input"), dict[str, str]()
    for column in header_of(inputs):
        elements = [each for each in known if model.variables[each].whole == column]
        if column in known:
            columns[column] = column
        elif elements:
            columns |= {each: f"{column}[{i}]" for i, each in enumerate(elements, 1)}
        elif column in model.names("input", kinds=("String", "Binary", "Clock")):
            kind = model.variables[column].kind
            raise UsageError(f"{inputs}: {column} is a {kind}: a file feeds numbers only, to {listed(known)}")
        elif column != TIME:
            hint = did_you_mean(column, known)
            raise UsageError(f"{inputs}: {model.name} has no input {column}; its inputs are {listed(known)}{hint}")
    if not columns:
        raise UsageError(f"{inputs}: feeds no input; expected {TIME} and columns of its inputs, {listed(known)}")
    _expect_numbers_of_type(model, inputs, columns)
    sources, solved = {}, model.interface == "model-exchange"
    for interpolation, continuous in (("linear", True), ("previous", False)):
        fed = [each for each in columns if (model.variables[each].variability == "continuous") is continuous]
        if fed:
            to = tuple(f"{name}.{each}" for each in fed)
            sources[f"{interpolation}_inputs"] = Source(
                to=to, file=inputs, interpolation="linear" if continuous else "previous",
                columns=tuple(columns[each] for each in fed), start_time=begin or None, outside="held",
                within_steps=continuous and solved,
            )  # fmt: skip
    return sources


def _expect_numbers_of_type(model: Model, inputs: Path, columns: Mapping[str, str]) -> None:
    """Raise `UsageError` for a number that its input does not have, or that may not be the one in the file."""
    for name, column in columns.items():
        if model.variables[name].choices:
            for line, word in words_of(inputs, column):
                place = f"{inputs}: line {line}: {column}"
                number = convert_value(model.variables[name], word, place)
                raise UsageError(f"{place} = {word}: expected the number of the item, {number}")
    rows = read_rows(inputs, (TIME, *columns.values()))
    for extra in rows.columns.keys() - {TIME, *columns.values()}:
        whole = extra.rpartition("[")[0]
        raise rows.error(
            0, extra, f"{sum(model.variables[each].whole == whole for each in columns)} numbers of {whole}"
        )
    for name, column in columns.items():
        variable, values = model.variables[name], rows.columns[column]
        if variable.kind == "Boolean" and ((values != 0.0) & (values != 1.0)).any():
            at = int(((values != 0.0) & (values != 1.0)).argmax())
            raise rows.error(at, column, "0 or 1, or false or true: it is a Boolean")
        if variable.kind in ("Integer", "Enumeration") and (values % 1.0).any():
            raise rows.error(int((values % 1.0 != 0.0).argmax()), column, f"a whole number: it is an {variable.type}")
        if variable.kind == "Integer":
            rows.expect_exact(column)
            for at in (int(values.argmin()), int(values.argmax())):
                convert_value(variable, float(values[at]), f"{inputs}: line {rows.lines[at]}: {column}")
