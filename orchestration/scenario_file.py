"""Checks the types and keys of a scenario file; values are checked where they mean something."""

import dataclasses
from dataclasses import dataclass, field
from typing import Any, ClassVar

import pydantic

from orchestration.errors import UsageError
from orchestration.scenario import Record, ReferenceChoice, Scenario
from orchestration.timing import Timing


@dataclass(frozen=True, kw_only=True)
class ScenarioFile:
    """The tables of a scenario file; parameters of the FMUs are still as the file nests them."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    stop_time: float = Scenario.stop_time
    seed: int = Scenario.seed
    controller: dict[str, Any] = field(default_factory=dict)
    plant: dict[str, Any] = field(default_factory=dict)
    timing: Timing = field(default_factory=Timing)
    reference: ReferenceChoice = field(default_factory=ReferenceChoice)
    record: Record = field(default_factory=Record)


def parse(tables: dict[str, Any]) -> ScenarioFile:
    """The typed form of a TOML document; raises `UsageError` in one line for the first thing wrong."""
    try:
        return pydantic.TypeAdapter(ScenarioFile).validate_python(tables)
    except pydantic.ValidationError as error:
        raise UsageError(_first_problem(error)) from error


def _first_problem(error: pydantic.ValidationError) -> str:
    problem = error.errors()[0]
    place = ".".join(str(part) for part in problem["loc"])
    if problem["type"] == "unexpected_keyword_argument":
        table: Any = ScenarioFile
        for part in problem["loc"][:-1]:
            table = next(f.type for f in dataclasses.fields(table) if f.name == part)
        keys = ", ".join(f.name for f in dataclasses.fields(table))
        return f"{place}: no such key; expected one of {keys}"
    message = problem["msg"]
    return f"{place} = {problem['input']!r}: {message[:1].lower()}{message[1:]}"
