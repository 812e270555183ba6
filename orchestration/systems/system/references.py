"""References of components: a built-in trajectory, or a source that feeds their inputs."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from orchestration.components.fmi.kit import TRAJECTORY, USE_REFERENCE_INPUTS
from orchestration.components.fmi.model import Model
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.model import System
from orchestration.systems.system.source import MOTION, Source

BUILT_IN, AT_REST = "paper", "hover"
"""Signals: the built-in trajectory of this project's controllers, and the only one that needs no inputs"""


def connect_references(system: System, models: Mapping[str, Model]) -> System:
    """The `system` with each reference source connected to the inputs of the component that follows it.

    A component without a built-in trajectory is fed the paper's. Raises `UsageError` for one without inputs for its
    reference, naming them.
    """
    sources, components = dict(system.sources), dict(system.components)
    for name, source, follower in _reference_sources(system):
        model = models[follower]
        if source.is_built_in and has_built_in_trajectory(model):
            continue
        inputs = {*model.names("input")}
        to = tuple(f"{follower}.{name}.{each}" for each in MOTION if f"{name}.{each}" in inputs)
        lacking = [f"{name}.{each}" for each in MOTION[:3] if f"{name}.{each}" not in inputs]
        if lacking and (to or source.signal != AT_REST):
            held = f"{name} {AT_REST}, for one that holds a point by itself"
            raise UsageError(
                f"sources.{name}: {model.name} cannot follow it without the inputs {', '.join(lacking)}; "
                f"expected {held}"
            )
        signal = BUILT_IN if source.is_built_in else source.signal
        sources[name] = replace(source, signal=signal, trajectory=None, to=to)
        if to and USE_REFERENCE_INPUTS in model.variables:
            parameters = {**components[follower].parameters, USE_REFERENCE_INPUTS: True}
            components[follower] = replace(components[follower], parameters=parameters)
    return system if sources == system.sources else replace(system, sources=sources, components=components)


def describe_references(system: System, models: Mapping[str, Model]) -> str:
    """The references of a system and the components that follow them, as text; empty if there are none."""
    fed = connect_references(system, models)
    words = (
        _description(source, fed.sources[name], models[follower])
        for name, source, follower in _reference_sources(system)
    )
    return "; ".join(words)


def has_built_in_trajectory(model: Model) -> bool:
    """Whether an FMU has a built-in trajectory."""
    return not TRAJECTORY.keys().isdisjoint(model.variables)


def _reference_sources(system: System) -> Iterator[tuple[str, Source, str]]:
    """The sources that a component follows: name, source, and the name of the component."""
    for name, source in system.sources.items():
        if source.trajectory is not None:
            yield name, source, source.trajectory


def _description(source: Source, fed: Source, follower: Model) -> str:
    if fed.trajectory is not None:
        return f"the trajectory that {follower.name} has built in"
    what = "the paper's trajectory" if source.is_built_in else source.signal or str(source.file)
    if not fed.to:
        return f"{what}, which {follower.name} holds by itself"
    quantities = dict.fromkeys(end.split(".")[-2] for end in fed.to)
    return f"{what}, fed to {follower.name} as {', '.join(quantities)}"
