"""Reruns runs of a study for their signals, which a store does not keep: in SIMD batches where possible."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from orchestration.components.fmi.read_description import Model
from orchestration.experiments.report.known_layouts import layout_for
from orchestration.experiments.report.subset import Progress
from orchestration.experiments.report.tracks import Signals
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.simulation.engines.resolved import columns_of, source_signals
from orchestration.simulation.results.objectives import Metrics
from orchestration.simulation.runs.simulation import run
from orchestration.simulation.workers.choice import choose_execution
from orchestration.systems.system.check import connect_references, recorded_variables
from orchestration.systems.system.files import Files, all_with_files
from orchestration.systems.system.model import System

BATCH = 64
"""Runs at once, which limits the memory for their signals"""
MAX_COLUMNS = 24
"""Most columns of a system other than a quadrotor"""


@dataclass(frozen=True, kw_only=True)
class Rerun:
    """A run of a study that was simulated again."""

    index: int
    system: System
    signals: Signals
    metrics: Metrics
    message: str | None


def fastest(study: Study) -> tuple[Study, Files, bool]:
    """The study with the fastest engine of this machine, its files, and whether it runs in SIMD batches."""

    def first(native: bool) -> tuple[System, Files]:
        variant = replace(study, native=native)
        files = variant.files()
        return variant.system(0, files.start_values), files

    how = choose_execution("auto", study.native, first)
    variant = replace(study, native=how.native)
    files = variant.files()
    return variant, files, how.in_lanes and all(model.is_own for model in files.models.values())


def rerun(
    study: Study, files: Files, indices: Sequence[int], *, lanes: bool, progress: Progress | None = None
) -> Iterator[Rerun]:
    """Simulate runs of a study again by their indices; a run that fails is omitted."""
    paths = {**files.fmus, **files.tables}
    batches, size = (Batches(), BATCH) if lanes else (None, 1)
    for first in range(0, len(indices), size):
        some = indices[first : first + size]
        listed = [study.system(i, files.start_values) for i in some]
        known = [connect_references(system, files.models_of(system)) for system in listed]
        systems, names = dict(zip(some, all_with_files(known, paths))), _columns(known, files)
        if batches is None:
            again = {index: _single_run(index, system, names) for index, system in systems.items()}
        else:
            starts = {index: files.start_values_of(system) for index, system in zip(some, listed)}
            again = _in_lanes(systems, starts, batches, names)
        yield from (one for index in some if (one := again[index]) is not None)
        if progress is not None:
            progress(min(1.0, (first + len(some)) / len(indices)))


def _in_lanes(
    systems: Mapping[int, System], starts: Mapping[int, Mapping[str, float]], batches: Batches, names: Sequence[str]
) -> dict[int, Rerun | None]:
    """The runs of systems by their indices, with the columns of these names; None for one that fails."""
    indices, listed = [*systems], [*systems.values()]
    columns = [name for name in names if name.partition(".")[0] in listed[0].components]
    runs: dict[int, Rerun | None] = {}
    for place, summary, rows in batches.each(listed, columns):
        index, system = indices[place], listed[place]
        if summary is None:
            runs[index] = _single_run(index, system, names)
            continue
        signals = dict(zip(("time", *columns), rows.T.copy()))
        signals |= _of_sources(system, starts[index], signals["time"])
        runs[index] = Rerun(
            index=index, system=system, signals=signals, metrics=summary.metrics, message=summary.message
        )
    return runs


def _single_run(index: int, system: System, names: Sequence[str]) -> Rerun | None:
    try:
        result = run(system)
    except QuadcosimError:
        return None
    signals = {name: result.signals[name] for name in ("time", *names)}
    message = result.divergence or result.termination
    return Rerun(index=index, system=system, signals=signals, metrics=result.metrics, message=message)


def _columns(systems: Sequence[System], files: Files) -> list[str]:
    """The columns to keep, common to all runs: those of their known layout and sources, else those exchanged."""
    distinct = {tuple(system.fmus.items()): system for system in systems}.values()
    recorded = [_recorded(system, files.models_of(system)) for system in distinct]
    common = [name for name in recorded[0] if all(name in others for others in recorded[1:])]
    known = layout_for(common)
    if known is not None:
        sources = [name for name in common if name.partition(".")[0] in systems[0].sources]
        return [name for name in (*known.compact, *sources) if name in common]
    return common[:MAX_COLUMNS]


def _recorded(system: System, models: Mapping[str, Model]) -> list[str]:
    """The columns of its run: exchanged variables first."""
    variables = recorded_variables(system, models)
    own = [f"{name}.{variable}" for name, of_component in variables.items() for variable in of_component]
    return [*dict.fromkeys((*columns_of(system)[1:], *own))]


def _of_sources(system: System, starts: Mapping[str, float], t: Floats) -> dict[str, Floats]:
    """The signals of the sources, which SIMD batches do not record."""
    values = {
        f"{name}.{key}": value for name, one in system.components.items() for key, value in one.parameters.items()
    }
    numbers = {name: float(value) for name, value in values.items() if not isinstance(value, str)}
    return source_signals(system, {**starts, **numbers}, t)
