"""The units of the metrics of a run, from those that its FMUs declare."""

import functools
from collections.abc import Mapping, Sequence

from orchestration.components.fmi.model import Model
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.units import METRE, SECOND, Unit
from orchestration.systems.expressions.syntax import names, parse
from orchestration.systems.expressions.units import unit_of
from orchestration.systems.system.model import System
from orchestration.systems.system.variable_names import component_of, variable_of

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
"""Of each: its signals, their destinations, and whether they are positions without a destination"""


@functools.lru_cache(maxsize=256)
def _units(
    objectives: tuple[tuple[str, str], ...],
    criterion: tuple[str | None, str | None],
    sources: Sources,
    models: tuple[tuple[str, Model], ...],
) -> dict[str, str]:
    """Cached by all that it depends on, which the runs of a study, checked one by one, share."""
    texts = [text for _, text in objectives] + [text for text in criterion if text is not None]
    known = _of_signals(texts, sources, dict(models))
    for name, text in objectives:
        known[name] = _unit(f"objectives.{name}", text, known)
    for place, expression in zip(("good", "diverged"), criterion):
        if expression is not None:
            _unit(f"criterion.{place}", expression, known)
    return OF_EVERY_RUN | {name: str(unit) for name, _ in objectives if (unit := known[name]) is not None}


def _unit(place: str, expression: str, known: Mapping[str, Unit | None]) -> Unit | None:
    try:
        return unit_of(parse(expression), known)
    except UsageError as error:
        raise UsageError(f"{place}: {error}") from error


def _of_signals(texts: Sequence[str], sources: Sources, models: Mapping[str, Model]) -> dict[str, Unit | None]:
    """The units of all names in expressions, by COMPONENT.VARIABLE and SOURCE.VARIABLE."""
    named = {name for expression in texts for name in names(parse(expression))}
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
