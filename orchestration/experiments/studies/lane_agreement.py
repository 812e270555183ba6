"""Agreement of runs in SIMD lanes with FMUs: a sample of the runs by their FMUs, and their beginning by FMUs in Python.

Lanes and native FMUs are compiled from the same text, so an error in it would affect both, but not FMUs in Python. In
chaotic runs, differences in the last bits of mathematical functions suffice for other metrics. Such runs are detected
by a twin: the same run in lanes with each Real parameter of its FMUs changed in its last bit. Parameters of 0.0 are not
changed, since 0.0 may switch off an effect. A run whose metrics do not change is compared.
"""

import contextlib
import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fmu_kit.libraries import compiler, processor
from fmu_kit.new_files import write_atomically
from orchestration.components.building.fmus import look_up, python_twin, python_twins
from orchestration.components.fmi.read_description import Model, Variable
from orchestration.simulation.engines.batch.shape import outline
from orchestration.simulation.workers.batching import SAMPLE, TOLERATED, LaneAgreement, Pair, Repeated, Sample
from orchestration.simulation.workers.executors import TaskRunner
from orchestration.simulation.workers.provenance import machine, versions
from orchestration.simulation.workers.task import RunTask, TaskBatch
from orchestration.systems.system.component import Component
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System

BEGINNING, SHARE = 1.0, 0.05
"""Time simulated by FMUs in Python [s], and least share of a run: a whole run costs as much as hundreds in lanes"""
_BEGINNING, _NUDGED, _PYTHON = "begun ", "nudged ", "in Python "
"""Prefixes of the keys of variants of a run"""


def with_python_twins(files: Files) -> Files:
    """The files of a study and the Python twins of its native FMUs, where there are any; missing ones are built."""
    twins = {python_twin(fmu) for fmu in files.fmus} - files.fmus.keys()
    paths = {twin: path for twin in twins if (path := look_up(twin)) is not None}
    return replace(files, fmus={**files.fmus, **paths})


def lane_agreement(
    sample: Sample, files: Files, task_of: Callable[[int, str], RunTask], run: TaskRunner, *, here: bool
) -> LaneAgreement | None:
    """The agreement of a sample of runs in lanes with the same runs by FMUs; None if there were no runs in lanes.

    `task_of` makes the task of a run from its index and key. `run` works with `files`, as returned by
    `with_python_twins`. With all workers `here`, on this machine, one run is enough if a whole sample of
    runs of the same code has agreed before.
    """
    lanes = sample.runs
    chosen = [task_of(one.run, key) for key, one in lanes.items()]
    if not chosen:
        return None
    if not here:
        return _agreement(chosen, lanes, files, run)
    place = place_of((task.system for task in chosen), files)
    if is_kept(place):
        found = _agreement(chosen[:1], lanes, files, run)
        if found.agrees and (found.python is not None or not _has_twins(chosen[0].system, files)):
            return found
    found = _agreement(chosen, lanes, files, run)
    keep(place, found)
    return found


def _agreement(
    chosen: Sequence[RunTask], lanes: Mapping[str, Repeated], files: Files, run: TaskRunner
) -> LaneAgreement:
    beginnings = [_beginning(task) for task in chosen if _has_twins(task.system, files)]
    tasks: list[RunTask | TaskBatch] = [*chosen, *map(_in_python, beginnings)]
    if beginnings:
        nudged = (_nudged(one, files.models_of(one.system)) for one in beginnings)
        tasks.append(TaskBatch.of([*beginnings, *nudged]))
    # A run that exceeds the time limit outside of lanes is not compared: lanes are faster.
    rows = {
        key: Repeated.of(some, place)
        for some in run(tasks)
        for place, key in enumerate(some.key)
        if place not in some.results.ended
    }

    def pairs(tasks: Iterable[RunTask], one: Mapping[str, Repeated], prefix: str) -> list[Pair]:
        both = ((task, one.get(task.key), rows.get(prefix + task.key)) for task in tasks)
        return [(task.index, here.metrics, there.metrics) for task, here, there in both if here and there]

    steady = [one for one in beginnings if LaneAgreement.of(pairs([one], rows, _NUDGED)).difference <= TOLERATED]
    python = LaneAgreement.of(pairs(steady, rows, _PYTHON)) if steady else None
    return replace(LaneAgreement.of(pairs(chosen, lanes, "")), python=python)


def _has_twins(system: System, files: Files) -> bool:
    """Whether some of its FMUs have a Python twin, and all these twins are available."""
    own, twins = {*system.fmus.values()}, {*python_twins(system).fmus.values()}
    return bool(twins - own) and twins <= files.fmus.keys()


def _beginning(task: RunTask) -> RunTask:
    """The beginning of a run."""
    horizon = task.system.stop_time
    system = replace(task.system, stop_time=min(horizon, max(BEGINNING, SHARE * horizon)))
    return replace(task, key=_BEGINNING + task.key, system=system, keep_signals=False)


def _in_python(task: RunTask) -> RunTask:
    """The same run with FMUs in Python."""
    return replace(task, key=_PYTHON + task.key, system=python_twins(task.system))


def _nudged(task: RunTask, models: Mapping[str, Model]) -> RunTask:
    """The same run with each parameter changed in its last bit."""
    components = {
        name: _nudged_component(component, models[name]) for name, component in task.system.components.items()
    }
    return replace(task, key=_NUDGED + task.key, system=replace(task.system, components=components))


def _nudged_component(component: Component, model: Model) -> Component:
    parameters = [v for v in model.variables.values() if v.kind == "Real" and v.causality == "parameter"]
    values = {v.name: component.parameters.get(v.name, v.start) for v in parameters}
    moved = {v.name: _next_number(float(value), v) for v in parameters if float(value := values[v.name] or 0.0) != 0.0}
    return replace(component, parameters={**component.parameters, **moved})


def _next_number(value: float, variable: Variable) -> float:
    """The next number above, or below if that exceeds the parameter's maximum."""
    above = math.nextafter(value, math.inf)
    return above if variable.maximum is None or above <= variable.maximum else math.nextafter(value, -math.inf)


def place_of(systems: Iterable[System], files: Files) -> Path:
    """The place in the user's cache of the agreement of a sample of runs: a hash of what it vouches for.

    That is machine code: that of the same FMUs in systems of the same outline, made by this compiler for this
    processor, and run by this version of the software. Numbers that vary within a study do not select other code.
    """
    import platformdirs

    sampled = list(systems)
    fmus = {fmu for system in sampled for fmu in system.fmus.values()}
    twins = {python_twin(fmu) for fmu in fmus} & files.fmus.keys()
    code = [machine(), versions(), compiler(), processor(), {fmu: files.hashes[fmu] for fmu in fmus | twins}]
    content = _text([sorted({_text([outline(system), _choices(system)]) for system in sampled}), code])
    key = hashlib.sha256(content.encode()).hexdigest()
    return Path(platformdirs.user_cache_dir("quadcosim")) / "agreement" / f"{key}.json"


def is_kept(place: Path) -> bool:
    """Whether a whole sample has agreed."""
    try:
        return _vouches(LaneAgreement.from_text(place.read_text(encoding="utf-8")))
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return False


def keep(place: Path, found: LaneAgreement) -> None:
    """Keep the agreement of a whole sample; a difference ends what is kept."""
    if _vouches(found) or not found.agrees:
        with contextlib.suppress(OSError):  # where nothing can be written, each sweep repeats the whole sample
            write_atomically(place, found.as_text())


def _vouches(found: LaneAgreement) -> bool:
    return found.runs == SAMPLE and found.agrees


def _choices(system: System) -> dict[str, dict[str, Any]]:
    """The parameters that may select other code: all but real numbers."""
    return {
        name: {key: value for key, value in component.parameters.items() if not isinstance(value, float)}
        for name, component in system.components.items()
    }


def _text(content: Any) -> str:
    return json.dumps(content, sort_keys=True, default=_plain)


def _plain(part: Any) -> Any:
    return sorted(part) if isinstance(part, frozenset) else dataclasses.asdict(part)
