"""One FMU alone as a system, as `fmpy simulate` runs it: its default experiment, and inputs from a file."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from fmpy.util import auto_interval

from orchestration.components.fmi.access import Access, Interface
from orchestration.components.fmi.read_description import Model, called, read_model
from orchestration.foundation.basics.errors import UsageError, did_you_mean, listed, prefixed
from orchestration.systems.signals.table_file import TIME, header_of
from orchestration.systems.system.component import Component, Parameter
from orchestration.systems.system.model import System
from orchestration.systems.system.proposal import component_names, experiment
from orchestration.systems.system.source import Source

MOST_ROWS = 1000
"""Rows above which the interval of the FMU is doubled, as fmpy does"""


def alone(
    path: Path,
    *,
    stop_time: float | None = None,
    interval: float | None = None,
    tolerance: float | None = None,
    inputs: Path | None = None,
    record: Sequence[str] = (),
    parameters: Mapping[str, Parameter] | None = None,
    interface: Interface | None = None,
) -> System:
    """The FMU at `path` as the only component, in continuous time; what is not given follows its default experiment.

    `interval` [s] is that of the communication points, `inputs` a CSV file with a column for each input that it feeds.
    Raises `UsageError` for a file that is no FMU, and for an experiment that does not begin at 0.
    """
    model = read_model(path)
    with prefixed(f"{path}: "):
        model = called(model, Access(interface=interface))
    begin = experiment(model, "startTime")
    if begin is not None:
        raise UsageError(f"{path}: its default experiment begins at {begin:g} s; expected 0, where runs begin here")
    end = stop_time or experiment(model, "stopTime") or 1.0
    step = interval or _interval(model, end)
    if stop_time is None and not model.varies_step and end > step:
        end = step * math.floor(end / step + 1e-9)  # as fmpy: no shorter step at the end
    name = component_names([model])[0]
    component = Component(
        fmu=str(path),
        step=step,
        tolerance=tolerance,
        record=_recorded(model, record),
        parameters=dict(parameters or {}),
        interface=interface,
    )
    sources = {} if inputs is None else _sources(model, name, inputs)
    return System(stop_time=end, components={name: component}, sources=sources)


def outputs(model: Model) -> list[str]:
    """What fmpy records if nothing is chosen: outputs, or else the first five states."""
    of_states = (one.variable.derivative for one in model.description.derivatives or ())
    states = [state.name for state in of_states if state is not None and state.causality in ("output", "local")]
    return list(model.names("output")) or states[:5]


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


def _sources(model: Model, name: str, inputs: Path) -> dict[str, Source]:
    """The columns of a file as inputs: continuous ones along the line between rows, all others held."""
    columns = [column for column in header_of(inputs) if column != TIME]
    known = model.names("input")
    for column in columns:
        if column not in known:
            hint = did_you_mean(column, known)
            raise UsageError(f"{inputs}: {model.name} has no input {column}; its inputs are {listed(known)}{hint}")
    sources = {}
    for interpolation, continuous in (("linear", True), ("previous", False)):
        fed = [column for column in columns if (model.variables[column].variability == "continuous") is continuous]
        if fed:
            to = tuple(f"{name}.{column}" for column in fed)
            sources[f"{interpolation}_inputs"] = Source(
                to=to, file=inputs, interpolation="linear" if continuous else "previous", columns=tuple(fed)
            )
    return sources
