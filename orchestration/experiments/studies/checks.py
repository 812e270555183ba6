"""Checks a whole design before any run: names, types and ranges against the FMUs' descriptions."""

from collections.abc import Hashable, Mapping
from typing import Any

from orchestration.experiments.studies.store_columns import expect_columns
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import warn
from orchestration.simulation.engines.batch.shape import outline
from orchestration.simulation.engines.resolved import check_against_fmus, other_periods_in_words, table_columns
from orchestration.systems.signals.table_file import read_table
from orchestration.systems.signals.waypoints import read_waypoints
from orchestration.systems.system.check import check_parameter, connect_references
from orchestration.systems.system.files import Files
from orchestration.systems.system.input_files import distributions_in
from orchestration.systems.system.model import System
from orchestration.systems.system.request import errors_in_own_terms


def check_design(study: Study, files: Files) -> tuple[str, ...]:
    """The references of its runs and the components that follow them.

    Raises `UsageError` for the first invalid run of `study`, with the number of further ones.
    """
    expect_columns(study.metric_names)
    first, invalid = "", 0
    starts, longest, checks = files.start_values_of(study.origin), study.origin, _SystemChecks(files)
    for index in range(len(study.points)):
        try:
            with errors_in_own_terms(study.base):
                system = study.system(index, starts)
                checks.expect(system)
            longest = max(longest, system, key=lambda one: one.stop_time)
        except UsageError as error:
            first = first or f"{describe_run(index, study.points[index])}: {error}"
            invalid += 1
    if invalid:
        raise UsageError(first + (f" ({invalid - 1} more runs are invalid)" if invalid > 1 else ""))
    with errors_in_own_terms(study.base):
        expect_tables(connect_references(longest, files.models_of(longest)))
    for remark in checks.remarks:
        warn(remark)
    return tuple(filter(None, checks.follows))


class _SystemChecks:
    """Checks systems against their FMUs: the first of each structure fully, later ones only for new values."""

    def __init__(self, files: Files) -> None:
        self._files = files
        self._known: dict[Hashable, set[tuple[str, str, Any]]] = {}
        self._periods: set[tuple[float | None, ...]] = set()
        self.remarks: dict[str, None] = {}
        """Words on what the periods of some runs mean"""
        self.follows: dict[str, None] = {}
        """References and their followers, in order of occurrence"""

    def expect(self, system: System) -> None:
        """Raise `UsageError` for parameters that the FMUs do not have, or values that they do not allow."""
        parameters = [
            (name, key, value) for name, one in system.components.items() for key, value in one.parameters.items()
        ]
        signals = tuple((source.signal, source.file) for source in system.sources.values())
        structure = outline(system), signals, tuple((name, key) for name, key, _ in parameters)
        if structure not in self._known:
            self.follows[check_against_fmus(system, self._files.models_of(system)).follows] = None
            self._known[structure] = set(parameters)
            self._expect_believed(system)
            return
        self._expect_believed(system)
        known, models = self._known[structure], None
        for name, key, value in parameters:
            if (name, key, value) not in known:
                models = models or self._files.models_of(system)
                check_parameter(system, models, name, key)
                known.add((name, key, value))

    def _expect_believed(self, system: System) -> None:
        """Note components whose code believes another sampling period."""
        periods = tuple(one.sampling.period if one.sampling else None for one in system.components.values())
        if periods not in self._periods:
            self._periods.add(periods)
            self.remarks |= dict.fromkeys(other_periods_in_words(system, self._files.models_of(system)))


def expect_tables(system: System) -> None:
    """Raise `UsageError` for a trace or a source's table that cannot be read or is too short."""
    for _, each in distributions_in(system):
        _ = each.highest
    for source in system.sources.values():
        if source.file is not None and source.is_motion:
            read_waypoints(source.file, source.parameters)
        elif source.file is not None:
            read_table(source.file, table_columns(source), system.stop_time)


def describe_run(index: int, settings: Mapping[str, Any]) -> str:
    """A run in a few words: its index and first settings."""
    shown = [f"{name} = {value}" for name, value in list(settings.items())[:4]]
    return f"run {index} ({', '.join(shown)}{', ...' if len(settings) > 4 else ''})"
