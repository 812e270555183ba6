"""Checks a whole design before any run: names, types and ranges against the FMUs' descriptions."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.components.fmi.read_description import Model, called
from orchestration.experiments.studies.axes import CONTROLLER, OF_ONE_LAW
from orchestration.experiments.studies.run_columns import MOST_KINDS, Kind, RunColumns
from orchestration.experiments.studies.store_columns import expect_columns
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.foundation.basics.terminal import warn
from orchestration.simulation.engines.batch.kernels import sources_of
from orchestration.simulation.engines.batch.shape import outline
from orchestration.simulation.engines.resolved import (
    check_against_fmus,
    numeric_parameters,
    other_periods_in_words,
    table_of,
)
from orchestration.simulation.runs.columns import first_differences
from orchestration.systems.signals.waypoints import read_waypoints
from orchestration.systems.system.check import check_parameter, connect_references
from orchestration.systems.system.files import Files, distributions_in
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request, errors_in_own_terms


@dataclass(frozen=True, kw_only=True)
class Checked:
    """Facts about all runs of a study."""

    follows: tuple[str, ...]
    """References and their followers"""
    no_lanes: str | None
    """why some run cannot be one of many at once; None: as far as FMUs go, all can"""


def check_design(columns: RunColumns) -> Checked:
    """Facts about its runs: the components that follow references, and whether all fly in SIMD lanes.

    Raises `UsageError` for the first invalid run of a study, with the number of further ones.
    """
    expect_columns(columns.study.metric_names)
    first, invalid, checks = "", 0, _RunChecks(columns)
    for block in columns.blocks():
        refused = columns.refused(block)
        for kind, places in block.kinds.items():
            allowed = [place for place in places if not refused[place]]
            if allowed and not checks.accepts(kind, int(block.indices[allowed[0]])):
                refused[places] = True
            elif allowed and block.parameters:
                checks.compare(block.indices[allowed], {name: x[allowed] for name, x in block.parameters.items()})
        if refused.any() and not first:
            index = int(block.indices[np.argmax(refused)])
            first = f"{describe_run(index, columns.study.points[index])}: {checks.error(index)}"
        invalid += int(np.count_nonzero(refused))
    if invalid:
        several = any(CONTROLLER & {*axis.targets} for axis in columns.study.axes)
        hint = f"; of several controllers, {OF_ONE_LAW}" if several and ": controller." in first else ""
        raise UsageError(first + hint + (f" ({invalid - 1} more runs are invalid)" if invalid > 1 else ""))
    with errors_in_own_terms(columns.study.base):
        expect_tables(connect_references(checks.longest, columns.files.models_of(checks.longest)))
    for remark in (*checks.systems.mismatches, *checks.systems.remarks):
        warn(remark)
    return Checked(follows=tuple(filter(None, checks.systems.follows)), no_lanes=checks.systems.no_lanes)


class _RunChecks:
    """Checks a run of each kind, as built for itself."""

    def __init__(self, columns: RunColumns) -> None:
        self._columns, self._accepted = columns, dict[Kind, bool]()
        self.systems = _SystemChecks(columns.files, columns.study.base)
        self.longest = columns.study.origin

    def accepts(self, kind: Kind, index: int) -> bool:
        """Whether the runs of a kind are valid, but for the parameters that it leaves open; one is at `index`."""
        if kind not in self._accepted:
            if len(self._accepted) == MOST_KINDS:
                self._accepted.clear()
            self._accepted[kind] = self.error(index) is None
        return self._accepted[kind]

    def compare(self, indices: Integers, parameters: Mapping[str, Floats]) -> None:
        """Look for mismatches among runs of one kind, which differ in these parameters."""
        origin = self._columns.study.origin
        if not self.systems.mismatches:
            usual = numeric_parameters(origin, self._columns.files.models_of(origin))
            for place in first_differences(parameters, usual):
                self.error(int(indices[place]))

    def error(self, index: int) -> UsageError | None:
        """Why a run is invalid; None if it is valid."""
        study = self._columns.study
        try:
            with errors_in_own_terms(study.base):
                system = study.system(index, self._columns.files.start_values)
                self.systems.expect(system)
        except UsageError as error:
            return UsageError(self._as_set(str(error)))
        self.longest = max(self.longest, system, key=lambda one: one.stop_time)
        return None

    def _as_set(self, text: str) -> str:
        """An error with targets that stand for several paths, such as `timing.loss`, in place of these."""
        study = self._columns.study
        targets = {target for axis in study.axes for target in axis.targets}
        targets |= {target for each in study.together for target in each.targets}
        for target in targets:
            names = {study.base.in_own_terms(path) for path in study.paths_of([target])}
            if len(names) > 1:
                for name in names - targets:
                    text = text.replace(f"{name} = ", f"{target} = ")
        return text


class _SystemChecks:
    """Checks systems against their FMUs: the first of each structure fully, later ones only for new values."""

    def __init__(self, files: Files, base: Request) -> None:
        self._files, self._base = files, base
        self._known: dict[Hashable, set[tuple[str, str, Any]]] = {}
        self._periods: set[tuple[float | None, ...]] = set()
        self.remarks: dict[str, None] = {}
        """Words on what the periods of some runs mean"""
        self.mismatches: tuple[str, ...] = ()
        """Warnings about parameters of the first run in which two components do not fit each other"""
        self.no_lanes: str | None = None
        """Reason why some system cannot be one of many at once"""
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
            models = self._files.models_of(system)
            self.follows[check_against_fmus(system, models).follows] = None
            self.no_lanes = self.no_lanes or _no_lanes(system, models)
            self._known[structure] = set(parameters)
            self._expect_believed(system)
            self._compare(system, models)
            return
        self._expect_believed(system)
        known, of_new = self._known[structure], None
        for name, key, value in parameters:
            if (name, key, value) not in known:
                of_new = of_new or self._files.models_of(system)
                check_parameter(system, of_new, name, key)
                known.add((name, key, value))
        if of_new:
            self._compare(system, of_new)

    def _compare(self, system: System, models: Mapping[str, Model]) -> None:
        """Note parameters of components that do not fit each other."""
        self.mismatches = self.mismatches or self._base.mismatches(numeric_parameters(system, models))

    def _expect_believed(self, system: System) -> None:
        """Note components whose code believes another sampling period."""
        periods = tuple(one.sampling.period if one.sampling else None for one in system.components.values())
        if periods not in self._periods:
            self._periods.add(periods)
            self.remarks |= dict.fromkeys(other_periods_in_words(system, self._files.models_of(system)))


def _no_lanes(system: System, models: Mapping[str, Model]) -> str | None:
    """Why it cannot be one of many at once, as far as its FMUs go."""
    try:
        for name, model in models.items():
            sources_of(name, called(model, system.components[name].access))
    except UsageError as error:
        return str(error)
    return None


def expect_tables(system: System) -> None:
    """Raise `UsageError` for a trace or a source's table that cannot be read or is too short."""
    for _, each in distributions_in(system):
        _ = each.highest
    for source in system.sources.values():
        if source.file is not None and source.is_motion:
            read_waypoints(source.file, source.parameters)
        elif source.file is not None:
            table_of(source, system.stop_time)


def describe_run(index: int, settings: Mapping[str, Any]) -> str:
    """A run in a few words: its index and first settings."""
    shown = [f"{name} = {value}" for name, value in list(settings.items())[:4]]
    return f"run {index} ({', '.join(shown)}{', ...' if len(settings) > 4 else ''})"
