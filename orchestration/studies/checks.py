"""Checks a whole design before anything is flown: names, types and ranges against the FMUs' descriptions."""

from collections.abc import Hashable, Mapping
from typing import Any

from orchestration.basics.errors import UsageError
from orchestration.building.inputs import Files
from orchestration.engines.batch.shape import outline
from orchestration.engines.wiring import check_against_fmus, table_columns
from orchestration.signals.table_file import read_table
from orchestration.signals.waypoints import read_waypoints
from orchestration.studies.store_columns import expect_columns
from orchestration.studies.study import Study
from orchestration.system.check import check_parameter
from orchestration.system.input_files import distributions_in
from orchestration.system.model import System
from orchestration.system.references import connect_references
from orchestration.system.request import errors_in_own_terms


def expect_flyable(study: Study, files: Files) -> tuple[str, ...]:
    """What is followed in its runs, and by whom.

    Raises `UsageError` for the first run of `study` that cannot be, saying how many more there are.
    """
    expect_columns(study.judged)
    first, wrong = "", 0
    starts, longest, alike = files.start_values_of(study.origin), study.origin, _Alike(files)
    for index in range(len(study.points)):
        try:
            with errors_in_own_terms(study.base):
                system = study.system(index, starts)
                alike.expect(system)
            longest = max(longest, system, key=lambda one: one.stop_time)
        except UsageError as error:
            first = first or f"{described(index, study.points[index])}: {error}"
            wrong += 1
    if wrong:
        raise UsageError(first + (f" ({wrong - 1} more runs cannot be)" if wrong > 1 else ""))
    with errors_in_own_terms(study.base):
        expect_tables(connect_references(longest, files.models_of(longest)))
    return tuple(filter(None, alike.follows))


class _Alike:
    """Holds systems to what their FMUs say: of those of one structure the first, of others what is new in them."""

    def __init__(self, files: Files) -> None:
        self._files = files
        self._known: dict[Hashable, set[tuple[str, str, Any]]] = {}
        self.follows: dict[str, None] = {}
        """What is followed, and by whom, in the order in which it was found."""

    def expect(self, system: System) -> None:
        """Raise `UsageError` for what the FMUs do not have, or cannot take."""
        given = [(name, key, value) for name, one in system.components.items() for key, value in one.parameters.items()]
        signals = tuple((source.signal, source.file) for source in system.sources.values())
        structure = outline(system), signals, tuple((name, key) for name, key, _ in given)
        if structure not in self._known:
            self.follows[check_against_fmus(system, self._files.models_of(system)).follows] = None
            self._known[structure] = set(given)
            return
        known, models = self._known[structure], None
        for name, key, value in given:
            if (name, key, value) not in known:
                models = models or self._files.models_of(system)
                check_parameter(system, models, name, key)
                known.add((name, key, value))


def expect_tables(system: System) -> None:
    """Raise `UsageError` for a trace or a table of a source that cannot be read, or does not last."""
    for _, each in distributions_in(system):
        _ = each.highest
    for source in system.sources.values():
        if source.file is not None and source.is_motion:
            read_waypoints(source.file, source.parameters)
        elif source.file is not None:
            read_table(source.file, table_columns(source), system.stop_time)


def described(index: int, settings: Mapping[str, Any]) -> str:
    """A run in a few words."""
    shown = [f"{name} = {value}" for name, value in list(settings.items())[:4]]
    return f"run {index} ({', '.join(shown)}{', ...' if len(settings) > 4 else ''})"
