"""What vouches for runs in lanes: a sample of them flown by their FMUs too, and how these begin by FMUs in Python.

Lanes and native FMUs are compiled of the same text: a mistake in that would agree with itself. It would not agree with
Python. Where runs are chaotic the last bits of the mathematics are enough for other metrics: a twin tells, the same run
in lanes with each Real parameter of its FMUs, given or not, off by its last bit. One of 0.0 stays: that may switch
something off which the number next to it switches on. A run of which nothing moves is not known to be chaotic, and is
compared.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from orchestration.building.fmus import look_up, python_twin, python_twins
from orchestration.building.inputs import Files
from orchestration.fmi.model import Model, Variable
from orchestration.system.component import Component
from orchestration.system.model import System
from orchestration.workers.batching import TOLERATED, Agreement, Pair, sample
from orchestration.workers.executors import TaskRunner
from orchestration.workers.row import Row
from orchestration.workers.task import Chunk, RunTask

BEGINNING, SHARE = 1.0, 0.05
"""[s] that FMUs in Python fly, and the least of a run: whole, one of theirs costs as much as hundreds in lanes"""
_BEGUN, _NUDGED, _PYTHON = "begun ", "nudged ", "in Python "
"""before the key of a run: what of it is flown"""


def with_python_twins(files: Files) -> Files:
    """The files of a study, and of each native FMU the one in Python where there is such, built if need be."""
    twins = {python_twin(fmu) for fmu in files.fmus} - files.fmus.keys()
    paths = {twin: path for twin in twins if (path := look_up(twin)) is not None}
    return replace(files, fmus={**files.fmus, **paths})


def vouched(
    lanes: Mapping[str, Row], files: Files, task_of: Callable[[int, str], RunTask], fly: TaskRunner
) -> Agreement | None:
    """How a sample of the runs that were flown in lanes compares with other ways to fly them; None if there were none.

    `lanes` are their rows by key; `task_of` makes the task of a run by its index and key. `fly` has the `files`, which
    are those `with_python_twins`.
    """
    chosen = [task_of(lanes[key].index, key) for key in sorted(sample(lanes))]
    if not chosen:
        return None
    begun = [_begun(task) for task in chosen if _has_twins(task.system, files)]
    tasks: list[RunTask | Chunk] = [*chosen, *map(_in_python_too, begun)]
    if begun:
        tasks.append(Chunk(tasks=(*begun, *(_nudged(one, files.models_of(one.system)) for one in begun))))
    # One that takes too long alone says nothing: lanes take less.
    rows = {one.row.key: one.row for some in fly(tasks) for one in some if not one.ended}

    def pairs(tasks: Iterable[RunTask], one: Mapping[str, Row], prefix: str) -> list[Pair]:
        both = ((task, one.get(task.key), rows.get(prefix + task.key)) for task in tasks)
        return [(task.index, _told(here), _told(there)) for task, here, there in both if here and there]

    steady = [one for one in begun if Agreement.of(pairs([one], rows, _NUDGED)).difference <= TOLERATED]
    python = Agreement.of(pairs(steady, rows, _PYTHON)) if steady else None
    return replace(Agreement.of(pairs(chosen, lanes, "")), python=python)


def _told(row: Row) -> Mapping[str, Any]:
    return row.metrics or {"status": row.message}


def _has_twins(system: System, files: Files) -> bool:
    """Whether each of its FMUs that should have one in Python has, and some have."""
    own, twins = {*system.fmus.values()}, {*python_twins(system).fmus.values()}
    return bool(twins - own) and twins <= files.fmus.keys()


def _begun(task: RunTask) -> RunTask:
    """The beginning of a run."""
    horizon = task.system.stop_time
    system = replace(task.system, stop_time=min(horizon, max(BEGINNING, SHARE * horizon)))
    return replace(task, key=_BEGUN + task.key, system=system, keep_signals=False)


def _in_python_too(task: RunTask) -> RunTask:
    """The same by FMUs in Python."""
    return replace(task, key=_PYTHON + task.key, system=python_twins(task.system))


def _nudged(task: RunTask, models: Mapping[str, Model]) -> RunTask:
    """The same with each parameter off by its last bit."""
    components = {name: _off(component, models[name]) for name, component in task.system.components.items()}
    return replace(task, key=_NUDGED + task.key, system=replace(task.system, components=components))


def _off(component: Component, model: Model) -> Component:
    parameters = [v for v in model.variables.values() if v.kind == "Real" and v.causality == "parameter"]
    values = {v.name: component.parameters.get(v.name, v.start) for v in parameters}
    moved = {v.name: _beside(float(value), v) for v in parameters if float(value := values[v.name] or 0.0) != 0.0}
    return replace(component, parameters={**component.parameters, **moved})


def _beside(value: float, variable: Variable) -> float:
    """The next number above, or below where that is beyond what the parameter may be."""
    above = math.nextafter(value, math.inf)
    return above if variable.maximum is None or above <= variable.maximum else math.nextafter(value, -math.inf)
