"""Checks a whole design before anything is flown: names, types and ranges against the FMUs' descriptions."""

from collections.abc import Mapping
from typing import Any

from orchestration.errors import UsageError
from orchestration.master.table_file import read_table
from orchestration.quadrotor.translation import in_its_own_words
from orchestration.simulation import checked
from orchestration.studies.files import Files
from orchestration.studies.store import expect_columns
from orchestration.studies.study import Study
from orchestration.system.model import System, variable_of


def expect_flyable(study: Study, files: Files) -> None:
    """Raise `UsageError` for the first run of `study` that cannot be, saying how many more there are."""
    expect_columns(study.origin.objectives)
    first, wrong = "", 0
    starts, longest = files.starts_of(study.origin), study.origin
    for index, point in enumerate(study.points):
        try:
            with in_its_own_words(study.base):
                system = study.system(index, starts)
                checked(system, files.models_of(system))
            longest = max(longest, system, key=lambda one: one.stop_time)
        except UsageError as error:
            first = first or f"{described(index, point)}: {error}"
            wrong += 1
    if wrong:
        raise UsageError(first + (f" ({wrong - 1} more runs cannot be)" if wrong > 1 else ""))
    with in_its_own_words(study.base):
        expect_tables(longest)


def expect_tables(system: System) -> None:
    """Raise `UsageError` for a table of a source that cannot be read, or does not last."""
    for source in system.sources.values():
        if source.file is not None:
            read_table(source.file, [variable_of(end) for end in source.to], system.stop_time)


def described(index: int, settings: Mapping[str, Any]) -> str:
    """A run in a few words."""
    shown = [f"{name} = {value}" for name, value in list(settings.items())[:4]]
    return f"run {index} ({', '.join(shown)}{', ...' if len(settings) > 4 else ''})"
