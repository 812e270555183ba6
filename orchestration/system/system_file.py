"""Reads and writes system files (TOML), and gives the JSON schema that editors complete them from."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import pydantic

from orchestration.basics.documents import read_toml
from orchestration.basics.errors import UsageError, no_such_key
from orchestration.basics.typed_tables import telling
from orchestration.system.model import (
    Align,
    Clock,
    Component,
    Connection,
    Criterion,
    Distribution,
    Hold,
    Interpolation,
    Order,
    Sampling,
    Source,
    System,
)
from orchestration.system.parameters import flattened, parameters_in
from orchestration.system.paths import changed, for_each
from orchestration.system.requirements import require


class _Table(pydantic.BaseModel):
    """A table of the file: keys that are not named here are refused."""

    model_config = pydantic.ConfigDict(extra="forbid", strict=True, populate_by_name=True, frozen=True)


def _says(text: str, **options: Any) -> Any:
    return pydantic.Field(description=text, **options)


class SamplingTable(_Table):
    """When a digital task runs."""

    period: Annotated[float, _says("Sampling period in the component's own seconds; instant k is offset + k·period.")]
    offset: Annotated[float, _says("Time of the first sample, in the component's own seconds.")] = 0.0
    jitter: Annotated[float, _says("Each instant is late by up to this [s]; less than the period.")] = 0.0
    jitter_distribution: Annotated[Distribution, _says("How the lateness is distributed between 0 and `jitter`.")] = (
        "uniform"
    )
    clock_ratio: Annotated[float, _says("Seconds that the component believes pass per true second.")] = 1.0
    clock: Annotated[
        Clock, _says("Who decides when it samples: the master, or the FMU itself, by its parameter sample_period.")
    ] = "master"


class ComponentTable(_Table):
    """An FMU, its parameters, and how it is stepped."""

    fmu: Annotated[str, _says("The path of an .fmu, relative to this file, or the name of one of this project's FMUs.")]
    parameters: Annotated[dict[str, Any], _says("Values of parameters, by their names in the FMU.")] = {}
    step: Annotated[float | None, _says("The communication step [s] of a component in continuous time.")] = None
    sampling: Annotated[
        SamplingTable | None, _says("When a digital task runs; a component has either this or `step`.")
    ] = None
    tolerance: Annotated[
        float | None,
        _says("Relative tolerance of the FMU's own solver; without it, that of the experiment that the FMU declares."),
    ] = None
    align: Annotated[
        Align,
        _says("Of an FMU that takes steps of one length only: an instant between its points is an error, or moves on."),
    ] = "exact"
    record: Annotated[
        tuple[str, ...] | None,
        _says("Variables to record beside what is exchanged; without it, all outputs and local Reals."),
    ] = None


class ConnectionTable(_Table):
    """One message: its signals travel together."""

    start: Annotated[tuple[str, ...], _says("Outputs of one component, as COMPONENT.VARIABLE.", alias="from")]
    end: Annotated[tuple[str, ...], _says("As many inputs of one other component.", alias="to")]
    name: Annotated[str | None, _says("The name that paths and events use; without one, its index in the file.")] = None
    order: Annotated[
        Order | None,
        _says(
            "Whether a message is there when it is computed (gauss-seidel), or at its sender's next instant (jacobi)."
        ),
    ] = None
    delay: Annotated[float, _says("Time from sending to arrival [s]; it may exceed a period.")] = 0.0
    delay_jitter: Annotated[float, _says("Largest random addition to the delay [s].")] = 0.0
    jitter_distribution: Annotated[Distribution, _says("How the delay's jitter is distributed.")] = "uniform"
    loss: Annotated[float, _says("Probability that a message is lost.")] = 0.0
    burst_length: Annotated[
        float | None, _says("Mean number of losses in a row; without it, each loss is independent of the others.")
    ] = None
    hold: Annotated[
        Hold,
        _says(
            "What the receiver has between arrivals: the last value (zero), or the line through the last two (first)."
        ),
    ] = "zero"
    noise: Annotated[
        float | dict[str, Any],
        _says("Standard deviation of Gaussian noise: a number for all signals, or a table by variable."),
    ] = {}
    quantisation: Annotated[
        float | dict[str, Any],
        _says("Values are rounded to multiples of this: a number for all signals, or a table by variable."),
    ] = {}
    scale: Annotated[
        float | None,
        _says("What arrives is scale · value + offset; without either of them, units must be the same."),
    ] = None
    offset: Annotated[float | None, _says("What is added after the scale.")] = None


class SourceTable(_Table):
    """What drives inputs from outside."""

    to: Annotated[tuple[str, ...], _says("The inputs that it drives, as COMPONENT.VARIABLE.")] = ()
    constant: Annotated[float | None, _says("A value that never changes.")] = None
    file: Annotated[
        str | None, _says("The path of a CSV file with `time` and a column for each input, or with way-points.")
    ] = None
    interpolation: Annotated[
        Interpolation,
        _says(
            "Between the rows of the file: linear, the row before (previous), or a curve through way-points (spline)."
        ),
    ] = "linear"
    columns: Annotated[
        tuple[str, ...] | None, _says("The columns of the file, if they are not named as the inputs.")
    ] = None
    noise: Annotated[float | None, _says("The intensity of white noise [unit² s].")] = None
    period: Annotated[float | None, _says("How long each value of the noise is held [s].")] = None
    signal: Annotated[str | None, _says("The name of a motion, or of gusts of wind.")] = None
    parameters: Annotated[
        dict[str, float], _says("What the signal is told, or how fast way-points without times are flown.")
    ] = {}
    scale: Annotated[float, _says("A factor on the values of the file or the signal.")] = 1.0
    trajectory: Annotated[
        str | None, _says("The component whose parameters trajectory.* say what the built-in trajectory is.")
    ] = None


class CriterionTable(_Table):
    """What a good run is."""

    good: Annotated[str | None, _says("When a run is good: an expression over objectives, at its end.")] = None
    diverged: Annotated[
        str | None, _says("When a run ends early: an expression over signals, looked at at every instant.")
    ] = None
    outcomes: Annotated[
        tuple[str, str],
        _says("The names of two outcomes: of a run that is good, and of one that is neither good nor diverged."),
    ] = Criterion.outcomes


class SystemTable(_Table):
    """A system of FMUs under a digital clock."""

    stop_time: Annotated[float, _says("The end of a run [s].")]
    seed: Annotated[int, _says("The seed of all random numbers.")] = 0
    order: Annotated[Order, _says("The order of every connection that does not have one of its own.")] = "gauss-seidel"
    components: Annotated[
        dict[str, ComponentTable],
        _says("The FMUs, by a name of yours; of those that could step next, the first in the file does."),
    ]
    connections: Annotated[tuple[ConnectionTable, ...], _says("What is connected to what.")] = ()
    sources: Annotated[dict[str, SourceTable], _says("What drives inputs from outside, by name.")] = {}
    objectives: Annotated[dict[str, str], _says("What a run comes to: expressions, by name.")] = {}
    optional: Annotated[
        tuple[str, ...],
        _says(
            "Objectives that have no value, instead of being an error, where an FMU lacks a variable that they name."
        ),
    ] = ()
    criterion: Annotated[CriterionTable, _says("When a run is good, and when it has diverged.")] = CriterionTable()
    streams: Annotated[dict[str, int], _says("Random streams that are numbered instead of named.")] = {}
    operating_point: Annotated[
        dict[str, Any], _says("Values by path with which the system is at rest; the local limit is taken there.")
    ] = {}


def schema() -> dict[str, Any]:
    """The JSON schema of a system file."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **SystemTable.model_json_schema(by_alias=True),
        "title": "quadcosim system",
    }


def load_system(path: str | Path) -> System:
    """Read a system file; paths in it are relative to its folder.

    Raises `UsageError` in one line that names the place and what is valid there.
    """
    path = Path(path)
    tables = read_toml(path, "system file")
    try:
        return system_from_tables(tables, path.parent)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def is_system(tables: Mapping[str, Any]) -> bool:
    """Whether a TOML document is a system file rather than a scenario of the quadrotor."""
    return "components" in tables


def system_from_tables(tables: Mapping[str, Any], folder: Path) -> System:
    """The system of a TOML document whose relative paths start at `folder`; raises `UsageError`."""
    try:
        table = SystemTable.model_validate_json(json.dumps(tables, default=str))
    except (pydantic.ValidationError, RecursionError) as error:
        raise UsageError(_first_problem(error, tables)) from None
    system = System(
        stop_time=table.stop_time,
        seed=table.seed,
        components={name: _component(name, value, folder) for name, value in table.components.items()},
        connections=tuple(_connection(i, value, table.order) for i, value in enumerate(table.connections)),
        sources={name: _source(name, value, folder) for name, value in table.sources.items()},
        objectives=table.objectives,
        optional=table.optional,
        criterion=_made("criterion", Criterion, table.criterion.model_dump()),
        streams=table.streams,
        operating_point=dict(flattened(table.operating_point)),
    )
    for name in system.optional:
        known = ", ".join(system.objectives) or "no objectives"
        require(name in system.objectives, "optional", name, f"one of {known}")
    try:
        changed(system, system.operating_point)
    except UsageError as error:
        raise UsageError(f"operating_point: {error}") from error
    return system


def _component(name: str, table: ComponentTable, folder: Path) -> Component:
    place = f"components.{name}"
    parameters = parameters_in(table.parameters, f"{place}.parameters")
    sampling = None if table.sampling is None else _made(f"{place}.sampling", Sampling, table.sampling.model_dump())
    fmu = str(folder / table.fmu) if table.fmu.endswith(".fmu") else table.fmu
    rest = {key: getattr(table, key) for key in ("step", "tolerance", "align", "record")}
    return _made(place, Component, {"fmu": fmu, "parameters": parameters, "sampling": sampling, **rest})


def _connection(index: int, table: ConnectionTable, order: Order) -> Connection:
    keys = table.model_dump()
    keys["name"] = table.name if table.name is not None else str(index)
    keys["order"] = table.order or order
    conversion = {key: keys.pop(key) for key in ("scale", "offset")}
    given = {key: value for key, value in conversion.items() if value is not None}
    keys |= {**given, "stated": bool(given)}
    for what in ("noise", "quantisation"):
        keys[what] = for_each(table.start, keys[what])
        for variable, value in keys[what].items():
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise UsageError(f"connections.{keys['name']}.{what}.{variable} = {value!r}: expected a number")
    return _made(f"connections.{keys['name']}", Connection, keys)


def _source(name: str, table: SourceTable, folder: Path) -> Source:
    file = None if table.file is None else folder / table.file
    return _made(f"sources.{name}", Source, {**table.model_dump(), "file": file})


Made = TypeVar("Made")


def _made(place: str, kind: type[Made], keys: Mapping[str, Any]) -> Made:
    try:
        return kind(**keys)
    except UsageError as error:
        raise UsageError(f"{place}.{error}") from error


def _first_problem(error: Exception, tables: Mapping[str, Any]) -> str:
    """The first thing wrong with a document, in one line that names the place and what is valid there."""
    if not isinstance(error, pydantic.ValidationError):
        return "nested too deeply; expected the tables of a system file"
    problem = telling(error)
    place = ".".join(str(part) for part in problem["loc"] if not str(part).startswith(("float", "dict[")))
    if problem["type"] == "extra_forbidden":
        key = str(problem["loc"][-1])
        return no_such_key(place.removesuffix(key), key, _keys_at(problem["loc"][:-1]))
    if problem["type"] == "missing":
        return f"{place}: expected to be given"
    message = problem["msg"]
    shown = str(problem["input"])
    shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
    return f"{place} = {shown}: expected {message.removeprefix('Input should be ').removeprefix('Input should ')}"


def _keys_at(place: tuple[Any, ...]) -> list[str]:
    tables: dict[str, Any] = {
        "components": ComponentTable, "connections": ConnectionTable, "sources": SourceTable,
        "criterion": CriterionTable,
    }  # fmt: skip
    table: Any = tables.get(str(place[0]), SystemTable) if place else SystemTable
    if len(place) > 2 and place[2] == "sampling":
        table = SamplingTable
    return [info.alias or name for name, info in table.model_fields.items()]
