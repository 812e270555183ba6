"""The units of what a run comes to, from those that its FMUs declare."""

from collections.abc import Mapping

from orchestration.errors import UsageError
from orchestration.expressions.syntax import names, parse
from orchestration.expressions.units import unit_of
from orchestration.fmi.model import Model
from orchestration.system.model import System, component_of, variable_of
from orchestration.system.system_file import expressions
from orchestration.units import METRE, SECOND, Unit

OF_EVERY_RUN = dict.fromkeys(("horizon", "divergence_time"), str(SECOND))
"""Units of what every run comes to beside its objectives"""


def units(system: System, models: Mapping[str, Model]) -> dict[str, str]:
    """The units of the objectives of a system that has been checked, by name, where all that they name has one.

    Raises `UsageError`, naming the expression, where values of different units are added or compared.
    """
    known = _of_signals(system, models)
    for name, text in system.objectives.items():
        known[name] = _unit(f"objectives.{name}", text, known)
    for place, expression in (("good", system.criterion.good), ("diverged", system.criterion.diverged)):
        if expression is not None:
            _unit(f"criterion.{place}", expression, known)
    return OF_EVERY_RUN | {name: str(unit) for name in system.objectives if (unit := known[name]) is not None}


def _unit(place: str, expression: str, known: Mapping[str, Unit | None]) -> Unit | None:
    try:
        return unit_of(parse(expression), known)
    except UsageError as error:
        raise UsageError(f"{place}: {error}") from error


def _of_signals(system: System, models: Mapping[str, Model]) -> dict[str, Unit | None]:
    """Of all that expressions name, by COMPONENT.VARIABLE and SOURCE.VARIABLE."""
    wanted = {name for _, expression in expressions(system) for name in names(parse(expression))}
    found: dict[str, Unit | None] = {}
    for name, model in models.items():
        for variable in model.variables:
            signal = f"{name}.{variable}"
            if signal in wanted or signal.rpartition(".")[0] in wanted:
                found[signal] = model.units.get(variable)
    for name, source in system.sources.items():
        fed = [models[component_of(end)].units.get(variable_of(end)) for end in source.to]
        signals = source.signals(name)
        found |= zip(signals, fed if source.trajectory is None else [METRE] * len(signals), strict=True)
    return found
