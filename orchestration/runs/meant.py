"""What a run means before it is flown, and what it has come to after, wherever it flies."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.basics.interrupt import Interrupted
from orchestration.building import fmus
from orchestration.engines.job_numbers import job_numbers
from orchestration.engines.sources import Values
from orchestration.engines.wiring import checked, signals_of, source_values
from orchestration.fmi.model import Model, read_model
from orchestration.recording.recording import Recorder
from orchestration.results import objectives
from orchestration.results.column_info import Described, described
from orchestration.runs.result import Provenance, Result
from orchestration.schedule.streams import Streams
from orchestration.system.model import System
from orchestration.system.request import Request, in_its_own_words

_NOTES = logging.getLogger("quadcosim")

Progress = Callable[[float], None]
"""Hears the share of the run that is done."""
Announce = Callable[[str], None]
"""Hears what is done before the run begins."""


class RunInterrupted(Interrupted):
    """A run has ended at the first instant after Ctrl-C, with this `result` so far."""

    def __init__(self, text: str, result: Result) -> None:
        super().__init__(text)
        self.result = result


class RunLost(QuadcosimError):
    """The process of a run has ended before the run had; the text says how and when."""

    def __init__(self, text: str, result: Result | None = None) -> None:
        super().__init__(text)
        self.result = result
        """What it had recorded; None if that is nothing."""


@dataclass(frozen=True, kw_only=True)
class Meant:
    """What somebody asked for, held to FMUs that are there."""

    asked: Request
    """as the user wrote it"""
    system: System
    """what it means"""
    paths: Mapping[str, Path]
    """of the FMUs, by component"""
    models: Mapping[str, Model]
    parameters: Mapping[str, float]
    """all numeric parameters of all components, as COMPONENT.NAME"""
    units: Mapping[str, str]
    """of what it comes to"""
    follows: str
    """what is followed, and by whom; empty where nothing is"""

    @property
    def foreign(self) -> list[str]:
        """Components whose FMUs are not built on this project's kit."""
        return [name for name, model in self.models.items() if not model.is_of_this_kit]

    @property
    def described(self) -> dict[str, Described]:
        """What is known of each column."""
        return described(self.system, self.models, ("time", *signals_of(self.system, self.models)))

    def sources(self, streams: Streams) -> dict[str, Values]:
        """The sources at work in a run, by name."""
        return {name: source_values(self.system, name, self.parameters, streams) for name in self.system.sources}


@dataclass(frozen=True, kw_only=True)
class Flown:
    """What a run has come to, beside what was recorded."""

    end: float
    """the time of the last row [s]"""
    steps: int
    divergence: str | None
    divergence_time: float | None
    termination: str | None
    interrupted_at: float | None
    provenance: Provenance
    warnings: tuple[str, ...]


def held_to_fmus(asked: Request, announce: Announce | None = None) -> Meant:
    """The system that somebody asked for, its FMUs built if need be; raises `UsageError` for what they do not have."""
    with in_its_own_words(asked):
        system = asked.as_system()
        if not system.components:
            raise UsageError("components = none: expected at least one to run; computers and networks alone have none")
        paths = fmus.of_components(system.fmus, announce)
    return held_to(asked, {name: read_model(path) for name, path in paths.items()})


def held_to(asked: Request, models: Mapping[str, Model]) -> Meant:
    """Likewise, of FMUs that have been found."""
    with in_its_own_words(asked):
        found = checked(asked.as_system(), models)
    return Meant(
        asked=asked, system=found.system, paths={name: model.path for name, model in models.items()}, models=models,
        parameters=found.parameters, units=found.units, follows=found.follows,
    )  # fmt: skip


def result_of(meant: Meant, flown: Flown, recorder: Recorder, wall_time: float, interrupted: bool) -> Result:
    """The result of a run, with its metrics; raises `RunInterrupted` with it if it was `interrupted`."""
    recording = recorder.finish()
    numbers = {**meant.parameters, **job_numbers(meant.system)}
    result = Result(
        asked=meant.asked,
        system=meant.system,
        recording=recording,
        metrics=objectives.compute(
            meant.system,
            lambda: objectives.spans(meant.system, recording, numbers, flown.end),
            end=flown.end,
            divergence_time=flown.divergence_time,
            steps=flown.steps,
            terminated=flown.termination is not None,
        ),
        units=meant.units,
        described=described(meant.system, meant.models, recording.columns),
        parameters=meant.parameters,
        divergence=flown.divergence,
        termination=flown.termination,
        interrupted_at=flown.interrupted_at,
        provenance={**flown.provenance, "follows": meant.follows, "wall_time": wall_time},
        warnings=(*meant.asked.warnings(meant.parameters), *flown.warnings),
    )
    _NOTES.debug(
        "%d steps to t = %g s by the %s loop in %.3f s", flown.steps, flown.end, flown.provenance["engine"], wall_time
    )
    if interrupted:
        raise RunInterrupted(f"at t = {flown.end:g} s of {meant.system.stop_time:g} s", result)
    return result


Course = Callable[[Any, Progress | None], bool]
"""Flies a `PreparedRun`; whether the run is over then. Of a run in another process it is pickled."""
