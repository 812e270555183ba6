"""The initial state of a system, as deviations from rest."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import exact_nanoseconds
from orchestration.simulation.engines.resolved import never_computed
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import AFTER, System
from orchestration.systems.system.paths import at_operating_point, changed, parameter_name
from orchestration.theory.exact.objectives import Mean, constant_signals
from orchestration.theory.stability.linearised_component import LINEAR, Tangent
from orchestration.theory.stability.loop_at_rest import AtRest, tracing_loader
from orchestration.theory.stability.matrices import Components
from orchestration.theory.stability.operating_point import deterministic, time_to_rest

SMALLER = 0.1
"""Factor of a deviation from one in which coordinates are measured to the next"""
SHARES = 10
"""Smaller deviations from which coordinates are measured, at most"""
EXACT = 1e-9
"""Error of coordinates, relative, up to which no smaller deviation is tried"""
TOLERATED = 0.01
"""Error of a quadratic cost by what is not linear from the initial state on, relative, up to which it is told"""
HALVINGS = 20
"""Halves of the initial deviation that are tried for one that is linear, at most"""
FLOWN = 1000
"""Periods over which runs from the initial state and from half of it are compared, at most"""
ROUNDED = 1e-12
"""Deviation of a signal, relative to its value where above 1, that may be rounding"""


@dataclass(frozen=True, kw_only=True)
class InitialState:
    """Deviations from rest after the first exchange, which is never lost, late or noisy."""

    states: Mapping[str, Floats]
    """States by component"""
    outputs: Mapping[str, Floats]
    """likewise"""
    received: Mapping[str, Floats]
    """Received values by connection"""
    accuracy: float
    """Error of quadratic costs from here, relative: of the coordinates, and by what is not linear"""


def steps_of(system: System) -> dict[str, float]:
    """By how much constants of sources differ from those at the operating point, by source."""
    rests = at_operating_point(system).sources
    steps = {name: (one.constant or 0.0) - (rests[name].constant or 0.0) for name, one in system.sources.items()}
    return {name: step for name, step in steps.items() if step}


def initial_state_of(
    system: System,
    loop: AtRest,
    parts: Components,
    tangents: Mapping[str, Tangent],
    means: Collection[Mean],
    instances: Instances,
) -> InitialState:
    """The initial state of `system`, in the coordinates of the components `parts` of its loop at rest.

    Runs from it and from half of it, to the `stop_time`, show how nearly the `means` are those of a linear loop. Raises
    `UsageError` where that is too little, naming the share of the deviation from which it is enough.
    """
    _expect_steady_sources(system)
    if time_to_rest(system):
        held = [f"sources.{name}.constant" for name, source in system.sources.items() if source.constant is not None]
        raise UsageError(
            f"operating_point.{AFTER}: over a horizon initial values, and constants of sources, count by how far they "
            f"are from those at rest: expected in [operating_point] values at which it rests, "
            f"{'as initial ones' if not held else f'as initial ones and {held[0]}'}, without {AFTER}"
        )
    calm = deterministic(replace(system, operating_point={}))
    prompt = {
        name: one if one.sampling is None else replace(one, sampling=replace(one.sampling, offset=0.0))
        for name, one in calm.components.items()
    }
    prompt_system, deviations = replace(calm, components=prompt), _deviations(system, calm, instances)
    found, worst = _measured(prompt_system, loop, parts, tangents, instances)
    if not deviations:  # it rests there, as nearly as it comes to rest
        found = replace(found, accuracy=0.0)
    factor = 1.0
    for _ in range(SHARES if deviations else 0):
        if found.accuracy <= EXACT:
            break
        factor *= SMALLER
        smaller, name = _measured(_scaled(prompt_system, deviations, factor), loop, parts, tangents, instances, factor)
        if smaller.accuracy < found.accuracy:
            found, worst = smaller, name
        elif found.accuracy <= LINEAR:
            break
    if not found.accuracy <= LINEAR:
        raise UsageError(
            f"{worst}: its initial state, and any small share of it, is one that its inputs do not reach about its "
            f"operating point: what they show misses {found.accuracy:.1g} of it; expected other initial values"
        )
    nonlinear = 2.0 * _nonlinearity(calm, deviations, loop, means, instances) if deviations else 0.0
    return replace(found, accuracy=2.0 * found.accuracy + nonlinear)


def _measured(
    system: System,
    loop: AtRest,
    parts: Components,
    tangents: Mapping[str, Tangent],
    instances: Instances,
    factor: float = 1.0,
) -> tuple[InitialState, str]:
    """The initial state of `system`, divided by `factor`, and the component with the largest error.

    Its `accuracy` is that of the coordinates.
    """
    with prepared(system, load=tracing_loader(instances)) as run:
        unset = never_computed(run.system, run.models)
        for name in (x.name for x in system.connections if x.hold == "first" and x.name in unset):
            raise UsageError(f"connections.{name}.hold: expected zero over a horizon: its line has no first value")
        run.master.initialise()
        if run.master.divergence is not None:
            raise UsageError(f"it diverges at its initialisation: {run.master.divergence}")
        saved = {name: instance.save() for name, instance in run.instances.items()}
        outputs = {name: _outputs(run.instances[name], part.outputs) for name, part in parts.items()}
        received = [channel.received.copy() for channel in run.master.running.channels]
    for name, state in loop.saved_states.items():
        loop.simulation.instances[name].restore(state)
    rest = {name: _outputs(loop.simulation.instances[name], part.outputs) for name, part in parts.items()}
    received_at_rest = [channel.received for channel in loop.simulation.master.running.channels]
    measured = {name: tangents[name].coordinates_of(saved[name]) for name in parts}
    worst = max(measured, key=lambda name: measured[name][1])
    size = max(size for _, _, size in measured.values())
    found = InitialState(
        states={name: coordinates / factor for name, (coordinates, _, _) in measured.items()},
        outputs={name: (outputs[name] - rest[name]) / factor for name in parts},
        received={
            x.name: (now - then) / factor for x, now, then in zip(system.connections, received, received_at_rest)
        },
        accuracy=measured[worst][1] / size if size > ROUNDED * factor else 0.0,
    )
    return found, worst


def _deviations(system: System, calm: System, instances: Instances) -> dict[str, tuple[float, float]]:
    """The real parameters and constants that differ from the operating point, by path: their values there, and here."""
    named = {path: name for path in system.operating_point if (name := parameter_name(path)) is not None}
    found = {}
    with prepared(calm, load=tracing_loader(instances)) as run:
        run.master.initialise()
        for path, name in named.items():
            instance = run.instances[component_of(name)]
            there = system.operating_point[path]
            if instance.model.variables[variable_of(name)].kind == "Real":
                here = float(instance.get(variable_of(name)))
                if here != there:
                    found[path] = float(there), here
    rests = at_operating_point(system)
    for name in steps_of(system):
        found[f"sources.{name}.constant"] = rests.sources[name].constant or 0.0, calm.sources[name].constant or 0.0
    return found


def _scaled(system: System, deviations: Mapping[str, tuple[float, float]], factor: float) -> System:
    return changed(system, {path: there + factor * (here - there) for path, (there, here) in deviations.items()})


def _nonlinearity(
    calm: System,
    deviations: Mapping[str, tuple[float, float]],
    loop: AtRest,
    means: Collection[Mean],
    instances: Instances,
) -> float:
    """By how much the means from all of the deviation differ from those of twice the motion from half of it, relative.

    From a share of a deviation a mean is off by at least half as much less: the whole error is at most twice this.
    """
    signals = tuple(dict.fromkeys(signal for mean in means for signal in mean.signals))
    rest = _values(loop.simulation.instances, signals, loop.simulation.system)
    weight = ROUNDED * np.maximum(1.0, np.abs(rest))
    whole = _flown(calm, signals, loop, instances) - rest
    for halving in range(HALVINGS):
        half = _flown(_scaled(calm, deviations, 0.5 ** (halving + 1)), signals, loop, instances) - rest
        if len(whole) == len(half):
            twice = np.where(np.abs(whole - 2.0 * half) > weight, 2.0 * half, whole)
            found = max((_apart(mean, signals, whole, twice) for mean in means), default=0.0)
            if 2.0 * found <= TOLERATED:
                if halving == 0:
                    return found
                break
        whole = half
    else:
        raise UsageError("its initial state is not linear about its operating point: nor are small shares of it")
    raise UsageError(
        f"its initial state is not linear about its operating point: expected initial values at most "
        f"{0.5**halving:.3g} times as far from it, from which costs are linear to {TOLERATED:.0%}"
    )


def _apart(mean: Mean, signals: Sequence[str], one: Floats, other: Floats) -> float:
    """By how much the deviation of a mean from that at rest differs between two motions, relative to its terms."""
    places = [signals.index(name) for name in mean.signals]
    x, y = one[:, places], other[:, places]
    apart = (x - y) @ mean.g + (((x - y) @ mean.Q) * (x + y)).sum(axis=1)
    size = np.abs(x) @ np.abs(mean.g) + ((np.abs(x) @ np.abs(mean.Q)) * np.abs(x)).sum(axis=1)
    return float(abs(apart.sum()) / size.sum()) if size.sum() > 0.0 else 0.0


def _flown(system: System, signals: Sequence[str], loop: AtRest, instances: Instances) -> Floats:
    """The `signals` at the begin of each period until the end of the run."""
    count = min(int(exact_nanoseconds(system.stop_time) / loop.period), FLOWN)
    with prepared(system, load=tracing_loader(instances)) as run:
        run.master.initialise()
        rows = [_values(run.instances, signals, system)]
        for k in range(1, count + 1):
            if run.master.run(pause_at=round(k * loop.period)) and run.master.divergence is not None:
                break
            rows.append(_values(run.instances, signals, system))
    return np.array(rows)


def _values(instances: Mapping[str, Instance], signals: Sequence[str], system: System) -> Floats:
    known = {key: value for name, one in system.sources.items() for key, value in constant_signals(name, one).items()}
    return np.array(
        [
            known[name] if name in known else float(instances[component_of(name)].get(variable_of(name)))
            for name in signals
        ]
    )


def _outputs(instance: Instance, names: tuple[str, ...]) -> Floats:
    return np.array([float(instance.get(name)) for name in names])


def _expect_steady_sources(system: System) -> None:
    """Raise `UsageError` for a source that drives the system away from rest but by a step at the begin."""
    for name, source in system.sources.items():
        if not source.is_held:
            raise UsageError(
                f"sources.{name}: expected noise, or a constant, which may differ at the operating point: a step as "
                "the horizon begins"
            )
