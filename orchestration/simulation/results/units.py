"""The units of columns and metrics of a run, from what its FMUs declare; errors for units that do not fit."""

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from orchestration.components.fmi.read_description import Model, items_text
from orchestration.foundation.basics.errors import prefixed
from orchestration.foundation.basics.unit_algebra import METRE, NUMBER, SECOND, Operand, Unit, agreed
from orchestration.systems.expressions import syntax
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.over_run import STOP_TIME, TIME
from orchestration.systems.expressions.reductions import REDUCTIONS
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System

OF_EVERY_RUN = dict.fromkeys(("horizon", "divergence_time"), str(SECOND))
"""Units of the metrics that every run has beside its objectives"""


def units(system: System, models: Mapping[str, Model]) -> dict[str, str]:
    """The units of the objectives of a checked system, by name, where all their operands have one.

    Raises `UsageError`, naming the expression, where values of different units are added or compared.
    """
    sources = tuple((s.signals(name), s.to, not s.to) for name, s in system.sources.items())
    criterion = (system.criterion.good, system.criterion.diverged)
    return dict(_units(tuple(system.objectives.items()), criterion, sources, tuple(models.items())))


Sources = tuple[tuple[tuple[str, ...], tuple[str, ...], bool], ...]
"""Signals, their destinations, and whether they are positions without a destination, of each source"""


@functools.lru_cache(maxsize=256)
def _units(
    objectives: tuple[tuple[str, str], ...],
    criterion: tuple[str | None, str | None],
    sources: Sources,
    models: tuple[tuple[str, Model], ...],
) -> dict[str, str]:
    """Cached by all that it depends on, which the runs of a study, checked one by one, share."""
    expressions = [each for _, each in objectives] + [each for each in criterion if each is not None]
    known = _of_signals(expressions, sources, dict(models))
    for name, expression in objectives:
        known[name] = _unit(f"objectives.{name}", expression, known)
    for place, condition in zip(("good", "diverged"), criterion):
        if condition is not None:
            _unit(f"criterion.{place}", condition, known)
    return OF_EVERY_RUN | {name: str(unit) for name, _ in objectives if (unit := known[name]) is not None}


def _unit(place: str, expression: str, known: Mapping[str, Unit | None]) -> Unit | None:
    with prefixed(f"{place}: "):
        return unit_of(syntax.parse(expression), known)


def _of_signals(expressions: Sequence[str], sources: Sources, models: Mapping[str, Model]) -> dict[str, Unit | None]:
    """The units of all names in expressions, by COMPONENT.VARIABLE and SOURCE.VARIABLE."""
    named = {name for expression in expressions for name in syntax.names(syntax.parse(expression))}
    units: dict[str, Unit | None] = {}
    for name, model in models.items():
        for variable in model.variables:
            signal = f"{name}.{variable}"
            if signal in named or signal.rpartition(".")[0] in named:
                units[signal] = model.units.get(variable)
    for signals, to, are_positions in sources:
        fed = [models[component_of(end)].units.get(variable_of(end)) for end in to]
        units |= zip(signals, [METRE] * len(signals) if are_positions else fed, strict=True)
    return units


Units: TypeAlias = Mapping[str, Unit | None]
"""Units by name; None: it has none, or an unknown one"""


def unit_of(node: syntax.Node, units: Units) -> Unit | None:
    """The unit of an expression of names in `units`; None where one of these has none.

    Raises `UsageError` for values in different units that are added or compared, and for functions of a ratio with
    other arguments. A number has no unit and fits any other: also `x + 2 * v`.
    """
    match node:
        case syntax.Number():
            return NUMBER
        case syntax.JobMeasure(what):
            return SECOND if what == "response" else NUMBER
        case syntax.Name(name):
            return _named(name, units)
        case syntax.Sampled(_, argument):
            return unit_of(argument, units)
        case syntax.Call(function, arguments) if syntax.is_over_run(node):
            return REDUCTIONS[function].unit(function, [_operand(argument, units) for argument in arguments])
        case syntax.Operation(word, operands) | syntax.Call(word, operands):
            return OPERATORS[word].unit(word, [_operand(operand, units) for operand in operands])


def _operand(node: syntax.Node, units: Units) -> Operand:
    return Operand(text=syntax.text(node), unit=unit_of(node, units), number=_constant(node))


def _named(name: str, units: Units) -> Unit | None:
    if syntax.names_job_measure(name):
        return unit_of(syntax.parse_job_measures(name), units)
    if name in (TIME, STOP_TIME):
        return SECOND
    if name in units:
        return units[name]
    parts = [f"{name}.{axis}" for axis in "xyzw" if f"{name}.{axis}" in units]
    return agreed(name, [Operand(text=part, unit=units[part]) for part in parts]) if parts else None


def _constant(node: syntax.Node) -> Fraction | None:
    """The value of an expression that consists of numbers only, as 1 / 2."""
    match node:
        case syntax.Number(value):
            return Fraction(value).limit_denominator(1000)
        case syntax.Operation("neg", (operand,)):
            inner = _constant(operand)
            return None if inner is None else -inner
        case syntax.Operation("/", (above, below)):
            one, other = _constant(above), _constant(below)
            return one / other if one is not None and other else None
    return None


@dataclass(frozen=True, kw_only=True)
class ColumnInfo:
    """Unit and description of one column."""

    unit: str | None = None
    """Unit as FMI writes it, N.m for instance"""
    text: str | None = None
    """the FMU's description, with the items of an Enumeration"""

    def as_metadata(self) -> dict[str, str]:
        """Those that exist, by `unit` and `description`, as in the metadata of a Parquet column."""
        named = {"unit": self.unit, "description": self.text}
        return {name: text for name, text in named.items() if text}


def column_infos(system: System, models: Mapping[str, Model], columns: Iterable[str]) -> dict[str, ColumnInfo]:
    """By column; a source has those of the input that it feeds, a trajectory is a position in metres."""
    fed = {
        signal: end
        for name, source in system.sources.items()
        if source.to
        for signal, end in zip(source.signals(name), source.to, strict=True)
    }
    infos = {"time": ColumnInfo(unit="s", text="time")}
    for column in columns:
        if column in fed:
            infos[column] = _of(models, fed[column])
        elif component_of(column) in models:
            infos[column] = _of(models, column)
        elif column != "time":
            infos[column] = ColumnInfo(unit="m", text="desired position")
    return infos


def _of(models: Mapping[str, Model], signal: str) -> ColumnInfo:
    variable = models[component_of(signal)].variables.get(variable_of(signal))
    if variable is None:
        return ColumnInfo()
    text = ": ".join(filter(None, (variable.description, items_text(variable.choices))))
    return ColumnInfo(unit=variable.unit, text=text or None)
