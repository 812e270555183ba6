"""Who follows what: the reference of a component is what it has built in, or what its inputs are fed."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from orchestration.basics.errors import UsageError
from orchestration.fmi.kit import TRAJECTORY, USE_REFERENCE_INPUTS
from orchestration.fmi.model import Model
from orchestration.system.model import System
from orchestration.system.source import MOTION, Source

BUILT_IN, AT_REST = "paper", "hover"
"""Signals: what controllers of this project have built in, and the only one that needs nobody to hear it"""


def connect_references(system: System, models: Mapping[str, Model]) -> System:
    """A `system` that fits its FMUs, with each source that says what a component follows feeding inputs that hear it.

    A component without a trajectory of its own is fed the paper's. Raises `UsageError` for one that has no inputs for
    what it is to follow, naming them.
    """
    sources, components = dict(system.sources), dict(system.components)
    for name, source, follower in _followed(system):
        model = models[follower]
        if source.is_built_in and has_built_in_trajectory(model):
            continue
        inputs = {*model.names("input")}
        to = tuple(f"{follower}.{name}.{each}" for each in MOTION if f"{name}.{each}" in inputs)
        lacking = [f"{name}.{each}" for each in MOTION[:3] if f"{name}.{each}" not in inputs]
        if lacking and (to or source.signal != AT_REST):
            held = f"{name} {AT_REST}, for one that holds a point by itself"
            raise UsageError(
                f"sources.{name}: {model.name} cannot hear what it is to follow, it has no input {', '.join(lacking)}; "
                f"expected {held}"
            )
        signal = BUILT_IN if source.is_built_in else source.signal
        sources[name] = replace(source, signal=signal, trajectory=None, to=to)
        if to and USE_REFERENCE_INPUTS in model.variables:
            told = {**components[follower].parameters, USE_REFERENCE_INPUTS: True}
            components[follower] = replace(components[follower], parameters=told)
    return system if sources == system.sources else replace(system, sources=sources, components=components)


def describe_references(system: System, models: Mapping[str, Model]) -> str:
    """What is followed, and by whom, of a system that is not `heard` yet; empty where nothing is."""
    fed = connect_references(system, models)
    words = (_words(source, fed.sources[name], models[follower]) for name, source, follower in _followed(system))
    return "; ".join(words)


def has_built_in_trajectory(model: Model) -> bool:
    """Whether an FMU has a built-in trajectory."""
    return not TRAJECTORY.keys().isdisjoint(model.variables)


def _followed(system: System) -> Iterator[tuple[str, Source, str]]:
    """Sources that say what a component follows, with their names and its own."""
    for name, source in system.sources.items():
        if source.trajectory is not None:
            yield name, source, source.trajectory


def _words(source: Source, fed: Source, follower: Model) -> str:
    if fed.trajectory is not None:
        return f"the trajectory that {follower.name} has built in"
    what = "the paper's trajectory" if source.is_built_in else source.signal or str(source.file)
    if not fed.to:
        return f"{what}, which {follower.name} holds by itself"
    quantities = dict.fromkeys(end.split(".")[-2] for end in fed.to)
    return f"{what}, fed to {follower.name} as {', '.join(quantities)}"
