"""Checks a whole design before anything is flown: names, types and ranges against the FMUs' descriptions."""

import difflib
import math
from collections.abc import Mapping
from typing import Any

from orchestration import wiring
from orchestration.errors import UsageError
from orchestration.scenario import Scenario
from orchestration.stepping.channel import expand
from orchestration.stepping.table_file import read_table
from orchestration.studies.study import Fmus, Study


def expect_flyable(study: Study, fmus: Fmus) -> None:
    """Raise `UsageError` for the first run of `study` that cannot be, saying how many more there are."""
    first, wrong, longest = "", 0, 0.0
    for index, point in enumerate(study.points):
        try:
            scenario = study.scenario(index, fmus.starts)
            expect_possible(scenario, fmus)
            longest = max(longest, scenario.stop_time)
        except UsageError as error:
            first = first or f"{described(index, point)}: {error}"
            wrong += 1
    if wrong:
        raise UsageError(first + (f" ({wrong - 1} more runs cannot be)" if wrong > 1 else ""))
    if study.base.reference.file is not None:
        read_table(study.base.reference.file, wiring.REFERENCE, longest)


def expect_possible(scenario: Scenario, fmus: Fmus) -> None:
    """Raise `UsageError` for a parameter, a measurement or a record that a run of `scenario` would be refused for."""
    for side in ("plant", "controller"):
        for name, value in getattr(scenario, side).parameters.items():
            if name in wiring.MEASUREMENT + wiring.COMMAND:
                raise UsageError(f"{side}.{name}: expected a parameter; the FMUs are connected here")
            _expect_value(f"{side}.{name}", value, fmus)
        for name in getattr(scenario.record, side) or ():
            _variable(f"{side}.{name}", fmus)
    for kind in ("noise", "quantisation"):
        expand(f"timing.{kind}", getattr(scenario.timing, kind), wiring.MEASUREMENT)


def described(index: int, settings: Mapping[str, Any]) -> str:
    """A run in a few words."""
    shown = [f"{name} = {value}" for name, value in list(settings.items())[:4]]
    return f"run {index} ({', '.join(shown)}{', ...' if len(settings) > 4 else ''})"


def _expect_value(target: str, value: Any, fmus: Fmus) -> None:
    variable = _variable(target, fmus)
    if variable.causality not in ("parameter", "input"):
        raise UsageError(f"{target}: expected a parameter or an input, it is {variable.causality}")
    expected, kinds = _KINDS.get(variable.type, ("a number", (int, float)))
    fits = isinstance(value, kinds) and (isinstance(value, bool) == (variable.type == "Boolean"))
    if not fits:
        raise UsageError(f"{target} = {value}: expected {expected}")
    if not math.isfinite(value):
        raise UsageError(f"{target} = {value}: expected a finite number")
    for bound, outside, word in ((variable.min, -1.0, "least"), (variable.max, 1.0, "most")):
        if bound is not None and (value - float(bound)) * outside > 0.0:
            raise UsageError(f"{target} = {value}: expected at {word} {bound}")


_KINDS: dict[str, tuple[str, tuple[type, ...]]] = {
    "Boolean": ("true or false", (bool,)),
    "Integer": ("a whole number", (int,)),
    "String": ("nothing: texts cannot be set", ()),
}


def _variable(target: str, fmus: Fmus) -> Any:
    if target in fmus.variables:
        return fmus.variables[target]
    side = target.partition(".")[0]
    names = [name for name, v in fmus.variables.items() if name.startswith(f"{side}.") and v.causality == "parameter"]
    close = difflib.get_close_matches(target, names, n=3) or names[:3]
    model = fmus.descriptions[side].modelName
    raise UsageError(f"{target}: {model} has no such variable; expected one like {', '.join(close)}")
