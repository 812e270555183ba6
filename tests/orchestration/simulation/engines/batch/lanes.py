"""Systems run in SIMD lanes with their signals, compared with the same systems run one after another."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest

from orchestration.components.building import fmus
from orchestration.components.fmi.read_description import read_model
from orchestration.simulation.engines.batch.batch import Batch, BatchResult, Group
from orchestration.simulation.engines.batch.shape import Shape, outline
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.simulation.engines.structures import structures
from orchestration.simulation.runs.result import Result
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.syntax import Call, Node, Operation, children, parse
from orchestration.systems.schedule.schedule_cache import ScheduleCache, schedule_key
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
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


LOOP = System(
    stop_time=1.0,
    components={
        "plant": Component(fmu="stub", step=0.01),
        "controller": Component(fmu="stub", sampling=Sampling(period=0.02, jitter=0.01)),
    },
    connections=(
        Connection(name="measured", start=("plant.y",), end=("controller.u0y",), noise={"y": 0.1}, loss=0.2),
        Connection(name="commanded", start=("controller.y",), end=("plant.u1y",), hold="first", delay=0.03),
        Connection(name="applied", start=("controller.z",), end=("plant.u2y",), delay_jitter=0.01),
    ),
)

EXACT = {"max", "min", "first", "last", "peak_time", "settling_time", "growth_share"}
"""Reductions that add nothing up: they have the same bits"""
OF_PROCESSOR = {"sin", "cos", "tan", "asin", "acos", "atan2", "tanh", "exp", "log", "**"}
"""Functions of numpy whose last bit depends on the processor"""


def assert_the_same_numbers(system: System, found: Mapping[str, Any], alone: Mapping[str, Any]) -> None:
    """Assert that metrics are those of the same run alone: sums to 1e-12, all else to the bit."""
    assert list(found) == list(alone)
    for name, value in alone.items():
        expression = system.objectives.get(name)
        if expression is None or value is None or _functions(parse(expression)) <= EXACT | {*OPERATORS} - OF_PROCESSOR:
            assert (name, found[name]) == (name, value), _where(name, expression)
        else:
            assert found[name] == pytest.approx(value, rel=1e-12, abs=0.0), _where(name, expression)


def _functions(node: Node) -> set[str]:
    """The words of all operators and functions in it."""
    here = {node.sign} if isinstance(node, Operation) else {node.function} if isinstance(node, Call) else set()
    return here.union(*map(_functions, children(node)))


def _where(name: str, expression: str | None) -> str:
    return (
        f"{name} = {expression}: expected the same in lanes, by folds.py in orchestration/simulation/engines/batch, as "
        f"in Python, by reductions.py and operators.py in orchestration/systems/expressions"
    )
