"""Numbers of the runs of a batch that expressions and sources name: parameters, measures of jobs, the stop time."""

from collections.abc import Hashable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from orchestration.components.fmi.instance import number_of
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import nanoseconds, seconds
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.job_numbers import job_numbers
from orchestration.systems.expressions.over_run import STOP_TIME
from orchestration.systems.expressions.syntax import names_job_measure
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System

ParameterColumns = Mapping[str, Floats]
"""Real parameters by COMPONENT.NAME, a value for each run"""
NO_COLUMNS: ParameterColumns = MappingProxyType({})


def end_of(system: System) -> float:
    """The stop time [s] of a run, which is a whole number of nanoseconds."""
    return seconds(nanoseconds(system.stop_time))


class RunNumbers:
    """Numbers of each run, from its system or from `columns` that override it."""

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self.columns = NO_COLUMNS
        self._of_jobs: tuple[System, Mapping[str, float]] | None = None
        """Measures of the jobs of the last system that was asked for"""
        owners = [source.trajectory for source in shape.system.sources.values() if source.trajectory is not None]
        self._trajectories = {
            owner: [f"{owner}.{name}" for name in shape.models[owner].variables if name.startswith("trajectory.")]
            for owner in owners
        }
        self._used = (*shape.numbers, *(name for names in self._trajectories.values() for name in names))
        self._starts = {
            name: (component_of(name), variable_of(name), variable, number_of(variable, variable.start))
            for name in self._used
            if not names_job_measure(name)
            for variable in [shape.variable(name)]
        }

    def of(self, lane: int, system: System, name: str) -> float:
        """A number of one run."""
        if name in self.columns:
            return float(self.columns[name][lane])
        if name not in self._starts:
            return self._job_numbers(system)[name]
        owner, parameter, variable, start = self._starts[name]
        given = system.components[owner].parameters.get(parameter)
        return start if given is None else number_of(variable, given)

    def over(self, systems: Sequence[System]) -> dict[str, Floats]:
        """Parameters and the stop time that expressions name, in each run."""
        numbers = {
            name: np.array([self.of(lane, system, name) for lane, system in enumerate(systems)])
            for name in self._shape.numbers
        }
        return {**numbers, STOP_TIME: np.array([end_of(system) for system in systems])}

    def parameters(self, lane: int, system: System) -> dict[str, float]:
        """The parameters that the divergence monitor and the sources of a run use."""
        return {name: self.of(lane, system, name) for name in self._used}

    def source_key(self, lane: int, system: System) -> Hashable:
        """Everything besides the structure that determines the values of the sources of a run."""
        parts: list[Any] = []
        for name, source in system.sources.items():
            if name in self._shape.seen or source.to:
                parts += [vars(source), system.seed if source.is_random else None]
            if source.trajectory is not None:
                parts.append([self.of(lane, system, each) for each in self._trajectories[source.trajectory]])
        return repr(parts)  # the repr of a source itself would be abbreviated

    def _job_numbers(self, system: System) -> Mapping[str, float]:
        if self._of_jobs is None or self._of_jobs[0] is not system:
            self._of_jobs = system, job_numbers(system)
        return self._of_jobs[1]
