"""A request resolved against its FMUs before it is run: the system, and what the FMUs declare of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestration.components.building import fmus
from orchestration.components.fmi.model import Model, read_model
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.sources import SourceValues
from orchestration.simulation.engines.wiring import check_against_fmus, signals_of, source_values
from orchestration.simulation.results.column_info import ColumnInfo, column_infos
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request, errors_in_own_terms

Announce = Callable[[str], None]
"""Receives a line for each thing that is done before the run begins."""


@dataclass(frozen=True, kw_only=True)
class ResolvedRequest:
    """A request whose system has been checked against its FMUs."""

    request: Request
    """Request as the user wrote it"""
    system: System
    """the system that it describes"""
    paths: Mapping[str, Path]
    """Paths of the FMUs, by component"""
    models: Mapping[str, Model]
    parameters: Mapping[str, float]
    """all numeric parameters of all components, as COMPONENT.NAME"""
    units: Mapping[str, str]
    """Units of the metrics"""
    follows: str
    """Text of which component follows which reference; empty where none does"""

    @property
    def foreign(self) -> list[str]:
        """Components whose FMUs are not built on this project's kit."""
        return [name for name, model in self.models.items() if not model.is_of_this_kit]

    @property
    def described(self) -> dict[str, ColumnInfo]:
        """The unit and the description of each column."""
        return column_infos(self.system, self.models, ("time", *signals_of(self.system, self.models)))

    def sources(self, streams: Streams) -> dict[str, SourceValues]:
        """The values of the sources in a run, by name."""
        return {name: source_values(self.system, name, self.parameters, streams) for name in self.system.sources}


def resolve(request: Request, announce: Announce | None = None) -> ResolvedRequest:
    """Find the FMUs of a request, build them if need be, and check its system against them.

    Raises `UsageError` for what the FMUs do not have.
    """
    with errors_in_own_terms(request):
        system = request.as_system()
        if not system.components:
            raise UsageError("components = none: expected at least one to run; computers and networks alone have none")
        paths = fmus.of_components(system.fmus, announce)
    return resolve_with_models(request, {name: read_model(path) for name, path in paths.items()})


def resolve_with_models(request: Request, models: Mapping[str, Model]) -> ResolvedRequest:
    """As `resolve`, with FMUs whose models have been read."""
    with errors_in_own_terms(request):
        fits = check_against_fmus(request.as_system(), models)
    return ResolvedRequest(
        request=request, system=fits.system, paths={name: model.path for name, model in models.items()}, models=models,
        parameters=fits.parameters, units=fits.units, follows=fits.follows,
    )  # fmt: skip
