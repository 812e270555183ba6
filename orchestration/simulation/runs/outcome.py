"""The outcome of a run, in whichever process it ran, and the result made of it and the recording."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from orchestration.foundation.basics.errors import Named, SimulatorError
from orchestration.foundation.basics.interrupt import Interrupted
from orchestration.foundation.basics.times import nanoseconds
from orchestration.foundation.processes.passable import passable
from orchestration.foundation.recording.recording import Recorder
from orchestration.simulation.engines.resolved import (
    ResolvedRequest,
    fixed_steps,
    idle_partitions,
    never_computed,
    periods_in_words,
    uneven_steps,
)
from orchestration.simulation.results import objectives
from orchestration.simulation.results.own_points import points_of
from orchestration.simulation.results.units import column_infos
from orchestration.simulation.runs.result import Provenance, Result
from orchestration.systems.expressions.over_run import Recorded
from orchestration.systems.schedule.overload import overloads_in_words

_NOTES = logging.getLogger("quadcosim")

Progress = Callable[[float], None]
"""Receives the share of the run that is done."""
Course = Callable[[Any, Progress | None], bool]
"""Steps a `PreparedRun`; returns whether the run is over. For a run in another process it is pickled."""


class RunInterrupted(Interrupted):
    """A run has ended at the first instant after Ctrl-C, with this `result` so far."""

    def __init__(self, text: str, result: Result) -> None:
        super().__init__(text)
        self.result = result


class RunLost(SimulatorError):
    """The process of a run ended before the run did; the text states how and when."""


@passable
@dataclass(frozen=True, kw_only=True)
class RunOutcome:
    """How a run ended, beside what was recorded."""

    end: float
    """the time of the last row [s]"""
    steps: int
    divergence: str | None
    divergence_time: float | None
    termination: str | None
    failure: SimulatorError | None
    """Error that ended the run after its first row, beside Ctrl-C"""
    interrupted_at: float | None
    provenance: Provenance
    warnings: tuple[str, ...]


def result_of(
    resolved: ResolvedRequest, outcome: RunOutcome, recorder: Recorder, wall_time: float, interrupted: bool
) -> Result:
    """The result of a run, with its metrics.

    Raises `RunInterrupted` with it for a run that was `interrupted`, or the failure with it for one that has failed.
    """
    recording = recorder.finish()
    numbers = {**resolved.parameters, **resolved.of_jobs}

    unset = never_computed(resolved.system, resolved.models)
    points = points_of(resolved.system, fixed_steps(resolved.system, resolved.models), nanoseconds(outcome.end))

    def spans() -> Iterator[Recorded]:
        return objectives.spans(resolved.system, recording, numbers, outcome.end, points, unset)

    metrics = objectives.compute(
        resolved.system,
        spans,
        end=outcome.end,
        divergence_time=outcome.divergence_time,
        steps=outcome.steps,
        terminated=outcome.termination is not None,
    )
    is_short = metrics["good"] is False or None in map(metrics.get, resolved.system.objectives)
    odd = objectives.not_finite(spans) if is_short and outcome.divergence_time is None else None
    result = Result(
        request=resolved.request,
        system=resolved.system,
        recording=recording,
        metrics=Named(metrics),
        units=resolved.units,
        described=column_infos(resolved.system, resolved.models, recording.columns),
        parameters=resolved.parameters,
        divergence=outcome.divergence,
        termination=outcome.termination,
        interrupted_at=outcome.interrupted_at,
        provenance={
            **outcome.provenance,
            "follows": resolved.follows,
            **({"loops": list(resolved.loops)} if resolved.loops else {}),
            **({"events": list(resolved.events)} if resolved.events else {}),
            "wall_time": wall_time,
        },
        warnings=(
            *resolved.request.mismatches(resolved.parameters),
            *map(resolved.request.in_own_terms, resolved.system.oversights()),
            *uneven_steps(resolved.system, resolved.models),
            *periods_in_words(resolved.system, resolved.models),
            *overloads_in_words([resolved.system]),
            *idle_partitions(resolved.system, resolved.models),
            *outcome.warnings,
            *([] if odd is None else [odd]),
            *([] if outcome.failure is None else [str(outcome.failure)]),
        ),
    )
    engine = outcome.provenance["engine"]
    _NOTES.debug("%d steps to t = %g s by the %s loop in %.3f s", outcome.steps, outcome.end, engine, wall_time)
    if interrupted:
        why = "" if outcome.failure is None else f": {outcome.failure}"
        raise RunInterrupted(f"at t = {outcome.end:g} s of {resolved.system.stop_time:g} s{why}", result)
    if outcome.failure is not None:
        outcome.failure.result = result
        raise outcome.failure
    return result
