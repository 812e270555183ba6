"""Systems run in SIMD lanes with their signals, compared with the same systems run one after another."""

from collections.abc import Sequence

import numpy as np

from orchestration.components.building import fmus
from orchestration.components.fmi.read_description import read_model
from orchestration.simulation.engines.batch.batch import Batch, BatchResult, Group
from orchestration.simulation.engines.batch.shape import Shape, outline
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.simulation.engines.structures import structures
from orchestration.simulation.runs.result import Result
from orchestration.systems.schedule.schedule_cache import ScheduleCache, schedule_key
from orchestration.systems.system.model import System


def located(system: System) -> System:
    """With the native twins of its FMUs, as paths."""
    twins = fmus.native_twins(system)
    paths = fmus.of_components(twins.fmus)
    return check_against_fmus(twins, {name: read_model(path) for name, path in paths.items()}).system


CROWD = 8
"""The lanes of a batch in tests, on all machines: the most that a register has"""


def shape_of(system: System) -> Shape:
    """The shape of a system."""
    models = {name: read_model(path) for name, path in fmus.of_components(system.fmus).items()}
    return Shape(system=check_against_fmus(system, models).system, models=models, lanes=CROWD)


def in_lanes(shape: Shape, systems: Sequence[System]) -> BatchResult:
    """The result of systems of one shape run at once, everything recorded."""
    assert len({outline(system) for system in systems}) == 1
    return Batch(shape, ScheduleCache()).run(group_of(systems), shape.board.columns[1:])


def group_of(systems: Sequence[System]) -> Group:
    """The systems as a group for a batch."""
    return Group(systems=systems, timings=[schedule_key(system) for system in systems])


def assert_the_same_signals(shape: Shape, found: BatchResult, lane: int, alone: Result) -> None:
    """Assert that the rows of a lane are those of the same run alone, to the byte."""
    columns = ["time", *shape.board.columns[1:]]
    own = np.ascontiguousarray(alone.rows[:, [alone.columns.index(column) for column in columns]])
    rows = found.signals[lane]
    assert rows.shape == own.shape, (lane, rows[-3:, 0], own[-3:, 0])
    differing = [name for i, name in enumerate(columns) if rows[:, i].tobytes() != own[:, i].tobytes()]
    assert differing == []
    assert found.outcome[lane] == structures(shape.lanes).RUNNING or alone.metrics["divergence_time"] is not None
    assert found.steps[lane] == alone.metrics["steps"]
