"""Flies many systems as lanes of runs, and alone what cannot be."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from orchestration.building import fmus
from orchestration.engines.batch.batches import Batches
from orchestration.results.objectives import Metrics
from orchestration.runs.simulation import run
from orchestration.system.model import System


def fly(systems: Sequence[System]) -> Iterator[Metrics]:
    """The metrics of systems in their order, by native FMUs, built if need be; divergence is a result.

    Raises `UsageError` for a system that cannot be flown in lanes, naming the component and what it lacks, and what
    `run` raises for one that cannot be flown at all.
    """
    twins = [fmus.native_twins(system) for system in systems]
    paths: dict[str, str] = {}
    for system in twins:
        if not paths.keys() >= {*system.fmus.values()}:
            paths |= {system.fmus[name]: str(path) for name, path in fmus.of_components(system.fmus).items()}
    located = [_with_fmus(system, paths) for system in twins]
    for system, flown in zip(located, Batches().run(located)):
        yield run(system).metrics if flown is None else flown.metrics


def _with_fmus(system: System, paths: Mapping[str, str]) -> System:
    components = {name: replace(each, fmu=paths[each.fmu]) for name, each in system.components.items()}
    return replace(system, components=components)
