"""One run with noise from rest: whether it stays where the loop is linear, for which alone expectations hold."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.simulation.runs.prepared import prepared
from orchestration.simulation.runs.result import Result
from orchestration.simulation.runs.simulation import run_to_end
from orchestration.systems.expressions.syntax import Call, text
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import at_operating_point
from orchestration.theory.exact.objectives import Mean, ObjectiveMeans, constant_signals
from orchestration.theory.stability.in_double import in_double
from orchestration.theory.stability.loop_at_rest import Start, tracing_loader
from orchestration.theory.stability.operating_point import AT_REST

STEPS = 10_000
"""Shortest steps or periods of the run"""
BY_CHANCE = 1000.0
"""Factor on the expectation of a mean square that a run has by chance with a probability below its inverse (Markov's
inequality), whatever the distribution: from rest on, no linear loop has a larger expectation than a stationary one"""


def doubt(
    system: System,
    objectives: ObjectiveMeans,
    means: Mapping[Call, float],
    start: Start | None,
    instances: Instances,
    horizon: float | None,
) -> str:
    """Why the expected `means` of a system may be none of its runs, in a sentence; empty: one run is no reason.

    Not run is a system without noise, or with sources that move. `start`: where one comes to rest that runs to rest;
    `horizon`: the time that the means are over [s], None: stationary ones.
    """
    rests = in_double(at_operating_point(system))
    if not (rests.has_noise and all(constant_signals(*each) for each in rests.sources.items())):
        return ""
    flight = replace(rests, stop_time=min(STEPS * _shortest(rests), horizon or math.inf))
    found = _seen(flight, objectives, means, start, instances)
    return found and (
        f"a run from rest with this noise (seed {system.seed}) {found}: the expectation is that of the loop linear "
        "about rest, and deviations become too large for that; expected less noise, or the mean of runs "
        "(quadcosim sweep)"
    )


def _shortest(system: System) -> float:
    steps = (one.step if one.sampling is None else one.sampling.period for one in system.components.values())
    return min(step for step in steps if step is not None)


def _seen(
    system: System, objectives: ObjectiveMeans, means: Mapping[Call, float], start: Start | None, instances: Instances
) -> str:
    """What a run does that one of the linear loop would not; empty: nothing."""
    load = instances.load if start is None else tracing_loader(instances, start)
    try:
        with prepared(system, load=load) as run:
            run.follow(run_to_end, None)
            result = run.result()
    except SimulatorError as error:
        return f"fails: {error}"
    if result.divergence is not None:
        return f"diverges after {quantity(float(result.metrics['divergence_time'] or 0.0), 's')}"
    if result.termination is not None:
        return f"ends early: {result.termination}"
    for call, expected in means.items():
        mean = objectives.means[call]
        if _is_square(mean) and _mean_square(mean, objectives.rest, result) > BY_CHANCE * (expected - mean.c):
            return f"has a {text(call)} of more than {BY_CHANCE:g} times the expected"
    return ""


def _is_square(mean: Mean) -> bool:
    """Whether it is the mean of a square of deviations, and a constant: never less than at rest."""
    if np.any(mean.g) or not np.any(mean.Q):
        return False
    values = np.linalg.eigvalsh(mean.Q)
    return bool(values[0] >= -np.finfo(float).eps * len(values) * values[-1])


def _mean_square(mean: Mean, rest: Mapping[str, float], result: Result) -> float:
    """The mean over the rows of a run, less that at rest; deviations count from those on that are none of rest."""
    at = np.array([rest[name] for name in mean.signals])
    y: Floats = result.rows[:, [result.columns.index(name) for name in mean.signals]] - at
    y[np.abs(y) <= AT_REST * np.maximum(1.0, np.abs(at))] = 0.0
    return float(((y @ mean.Q) * y).sum(axis=1).mean())
