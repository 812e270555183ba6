"""Flies runs of a study again for their signals, of which a store keeps none: in lanes where that can be."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from orchestration.basics.errors import QuadcosimError
from orchestration.basics.simulator import Floats
from orchestration.building.inputs import Files, all_with_files
from orchestration.engines.batch.batches import Batches
from orchestration.engines.wiring import columns_of, source_signals
from orchestration.fmi.model import Model
from orchestration.report.known_layouts import layout_for
from orchestration.report.tracks import Signals
from orchestration.results.objectives import Metrics
from orchestration.runs.simulation import run
from orchestration.studies.study import Study
from orchestration.system.check import recorded_variables
from orchestration.system.model import System
from orchestration.system.references import connect_references
from orchestration.workers.choice import choose_execution

SOME = 64
"""Runs that are flown at once, so that of no more the whole signals are held"""
MOST_COLUMNS = 24
"""of a system that is no quadrotor"""
Progress = Callable[[float], None]
"""Hears the share of the flights that is done"""


@dataclass(frozen=True, kw_only=True)
class Flight:
    """A run that was flown again."""

    index: int
    system: System
    signals: Signals
    metrics: Metrics
    message: str | None


def fastest(study: Study) -> tuple[Study, Files, bool]:
    """A study as it is flown fastest on this machine, its files, and whether that is in lanes."""

    def first(native: bool) -> tuple[System, Files]:
        asked = replace(study, native=native)
        files = asked.files()
        return asked.system(0, files.starts_of(asked.origin)), files

    how = choose_execution("auto", study.native, first)
    flown = replace(study, native=how.native)
    return flown, flown.files(), how.in_lanes


def fly(
    study: Study, files: Files, indices: Sequence[int], *, lanes: bool, progress: Progress | None = None
) -> Iterator[Flight]:
    """Runs of a study by their indices, flown again; a run that fails is left out."""
    starts, paths = files.starts_of(study.origin), {**files.fmus, **files.tables}
    batches = Batches() if lanes else None
    for first in range(0, len(indices), SOME if lanes else 1):
        some = indices[first : first + (SOME if lanes else 1)]
        asked = [study.system(i, starts) for i in some]
        known = [connect_references(system, files.models_of(system)) for system in asked]
        systems = all_with_files(known, paths)
        for index, system, found in zip(some, systems, _flown(systems, starts, batches, _columns(known, files))):
            if found is not None:
                signals, metrics, message = found
                yield Flight(index=index, system=system, signals=signals, metrics=metrics, message=message)
        if progress is not None:
            progress(min(1.0, (first + len(some)) / len(indices)))


Found = tuple[Signals, Metrics, str | None]


def _flown(
    systems: Sequence[System], starts: Mapping[str, float], batches: Batches | None, wanted: Sequence[str]
) -> Iterator[Found | None]:
    """What runs come to, in their order, with the columns that are wanted; their files are where they are."""
    if batches is None:
        yield from (_alone(system, wanted) for system in systems)
        return
    columns = [name for name in wanted if name.partition(".")[0] in systems[0].components]
    found: dict[int, Found | None] = {}
    for place, flown, rows in batches.each(systems, columns):
        if flown is None:
            found[place] = _alone(systems[place], wanted)
            continue
        signals = dict(zip(("time", *columns), rows.T.copy()))
        sources = _of_sources(systems[place], starts, signals["time"])
        found[place] = signals | sources, flown.metrics, flown.message
    yield from (found[place] for place in range(len(systems)))


def _alone(system: System, wanted: Sequence[str]) -> Found | None:
    try:
        result = run(system)
    except QuadcosimError:
        return None
    message = result.divergence or result.termination
    return {name: result.signals[name] for name in ("time", *wanted)}, result.metrics, message


def _columns(systems: Sequence[System], files: Files) -> list[str]:
    """What is kept, as all of the runs have it: what their known layout needs and sources, else what is exchanged."""
    alike = {tuple(system.fmus.items()): system for system in systems}.values()
    there = [_recorded(system, files.models_of(system)) for system in alike]
    common = [name for name in there[0] if all(name in others for others in there[1:])]
    known = layout_for(common)
    if known is not None:
        sources = [name for name in common if name.partition(".")[0] in systems[0].sources]
        return [name for name in (*known.compact, *sources) if name in common]
    return common[:MOST_COLUMNS]


def _recorded(system: System, models: Mapping[str, Model]) -> list[str]:
    """The columns that its run has: what is exchanged first."""
    own = [f"{name}.{variable}" for name, some in recorded_variables(system, models).items() for variable in some]
    return [*dict.fromkeys((*columns_of(system)[1:], *own))]


def _of_sources(system: System, starts: Mapping[str, float], t: Floats) -> dict[str, Floats]:
    """What the sources said, which lanes do not record."""
    given = {f"{name}.{key}": value for name, one in system.components.items() for key, value in one.parameters.items()}
    numbers = {name: float(value) for name, value in given.items() if not isinstance(value, str)}
    return source_signals(system, {**starts, **numbers}, t)
