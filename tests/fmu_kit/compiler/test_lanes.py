"""A slave in SIMD lanes has, in every lane, the bits of a single instance, whatever the other lanes do."""

import itertools
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray

from fmu_kit import libraries
from fmu_kit.bundle import PackagingError, Target
from fmu_kit.compiler.emit.c_code import ERRORS
from fmu_kit.compiler.emit.standards import STANDARDS
from fmu_kit.compiler.pack.building import c_sources, modules_of
from fmu_kit.compiler.pack.c_compiler import FOR_THIS_PROCESSOR, OPTIONS
from fmu_kit.compiler.pack.lanes import compiled_lanes, preferred_lanes
from fmu_kit.compiler.passes.precomputing import precompute
from fmu_kit.compiler.trace.tracing import trace
from fmu_kit.packaging import slave_class
from fmu_kit.variables import Variable
from orchestration.components.building import fmus
from orchestration.components.building.models import MODELS
from tests.extent import sample
from tests.fmu_kit.compiler.compiled import compiler
from tests.fmu_kit.compiler.in_lanes import Alone, Together, Values, bits
from tests.fmu_kit.compiler.twins import GUID, compiled

PROBES = {"Arithmetic": 4, "Branches": 8, "Integers": 8, "Kept": 4, "Loops": 4, "Memory": 1, "Rare": 8}
"""Slaves that use all features, with numbers of lanes"""
FMU_ERROR, DIVERGENCE = (1 + ERRORS.index(name) for name in ("FmuError", "DivergenceError"))
STRANGE = (0.0, -0.0, 1.0, -1.0, 3.0, 1e3, 1e200, -1e308)


def _value(rng: np.random.Generator, variable: Variable, strange: float) -> float | int | bool:
    """A random value near the start value or, with probability `strange`, a strange one."""
    if variable.type == "Boolean":
        return bool(rng.integers(2))
    if variable.type == "Integer":
        return int(rng.integers(-3, 12))
    if variable.type == "Enumeration":
        return int(rng.integers(0, 4))
    if rng.random() < strange:
        return float(rng.choice(STRANGE))
    return float(variable.start + rng.normal() * max(abs(variable.start), 0.3) * 0.1)


def _random_values(
    rng: np.random.Generator, variables: list[Variable], causality: str, share: float, strange: float
) -> Values:
    return {
        k: _value(rng, variable, strange)
        for k, variable in enumerate(variables)
        if variable.causality == causality and variable.has_start and rng.random() < share
    }


def in_lanes(sources: dict[str, bytes], lanes: int, folder: Path, *, several: bool = False) -> None:
    """Compile the sources as `lanes.so`, from the cache of the engine if it is there."""
    key = (OPTIONS, FOR_THIS_PROCESSOR, lanes, several)
    content = libraries.cached_content("lanes", sources, key, lambda: compiled_lanes(sources, lanes, several=several))
    (folder / "lanes.so").write_bytes(content)


@pytest.mark.parametrize("model", MODELS)
def test_in_a_lane_are_the_bits_of_the_fmu(model: str, tmp_path: Path) -> None:
    compiler("cc")
    path = Path(fmpy.extract(str(fmus.locate(f"native/{model}")), str(tmp_path)))
    guid = fmpy.read_model_description(str(path)).guid
    sources = {file.name: file.read_bytes() for file in (path / "sources").iterdir()}
    in_lanes(sources, 8, tmp_path)
    target = Target.parse(MODELS[model])
    shutil.copy(path / "binaries" / fmpy.platform / f"{model}.so", tmp_path / "alone.so")
    may_diverge = {DIVERGENCE} if model in ("QuadrotorPlant", "UnifiedController") else set()
    assert _statuses(tmp_path, target, guid) >= {0, FMU_ERROR} | may_diverge


@pytest.mark.parametrize("name", sample([*PROBES], 4))
def test_all_features_of_slaves_work_in_lanes(name: str, tmp_path: Path) -> None:
    compiler("cc")
    target = Target.parse(f"tests.fmu_kit.compiler.probes:{name}")
    program = precompute(trace(slave_class(target), modules_of(target)))
    compiled(program, tmp_path / "alone.so", "own")
    in_lanes(c_sources(program, GUID, STANDARDS[2]), PROBES[name], tmp_path)
    assert _statuses(tmp_path, target, GUID) > {0}


def _statuses(folder: Path, target: Target, guid: str) -> set[int]:
    """Simulate all lanes repeatedly, each beside an instance; the final statuses."""
    rng = np.random.default_rng(1)
    variables = list(slave_class(target).variables)
    together = Together(folder / "lanes.so")
    types = [variable.type.replace("Enumeration", "Integer") for variable in variables]
    alone = [Alone.made(folder / "alone.so", together.lanes.places, types, guid) for _ in range(together.count)]
    usual = (slave_class(target).usual_parameters, 0.0, 0.0, (0.0,))
    unusual: tuple[Mapping[str, float], float, float, tuple[float, ...]] = ({}, 0.3, 0.02, (0.0, 0.5, -1.0))
    found, tried, left = set[int](), 0, 0
    for case in (usual, unusual, unusual) * 6:
        found |= set(_simulate(together, alone, variables, rng, *case))
        tried, left = (sum(pair) for pair in zip((tried, left), together.lanes.line))
    if target.model == "Loops":
        assert tried == 0, "a loop of any number of rounds is no straight line"
    else:
        assert left < tried, "some steps are done as a straight line"
    return found


def _simulate(
    together: Together,
    alone: list[Alone],
    variables: list[Variable],
    rng: np.random.Generator,
    usual_parameters: Mapping[str, float | int | bool],
    changed: float,
    strange: float,
    starts: Sequence[float],
) -> list[int]:
    """Simulate lanes and instances, each with its own values, times and steps, until it fails; the statuses.

    A share `changed` of the parameters differs from their start values, a share `strange` of the values is strange.
    Lanes start at one of `starts` [s].
    """
    usual = {
        k: usual_parameters[variable.name] for k, variable in enumerate(variables) if variable.name in usual_parameters
    }
    together.begin()
    for lane, instance in enumerate(alone):
        instance.fmu.reset()
        values = {
            **usual,
            **_random_values(rng, variables, "parameter", changed, strange),
            **_random_values(rng, variables, "input", 0.8, strange),
        }
        instance.put(values)
        together.put(lane, values)
    active = rng.random(together.count) < 0.9
    start = rng.choice(starts, together.count)
    period = float(rng.choice([0.001, 0.01, 0.25]))
    before = together.held()
    together.initialise(active, start)
    for lane in np.flatnonzero(active).tolist():
        alone[lane].initialise(start[lane])
    t = start.copy()
    for _ in range(12):
        _expect_alike(together, alone, active, before)
        active &= together.status == 0
        h = period * rng.choice([0.5, 1.0, 1.0, 2.0], together.count)
        for lane in np.flatnonzero(active).tolist():
            inputs = dict(_random_values(rng, variables, "input", 0.5, strange))
            together.put(lane, inputs)
            alone[lane].put(inputs)
            alone[lane].step(t[lane], h[lane])
        before = together.held()
        together.step(active, t, h)
        t += h
    return list(map(int, together.status))


def _expect_alike(together: Together, alone: list[Alone], active: NDArray[np.bool_], before: list[bytes]) -> None:
    """Assert that active lanes equal their instances, and others are unchanged."""
    for lane, (instance, held) in enumerate(zip(alone, before)):
        if active[lane]:
            assert together.status[lane] == instance.status
            assert bits(together.memory[:, lane]) == bits(instance.memory())
        else:
            assert together.held()[lane] == held


@pytest.mark.parametrize("model", ["QuadrotorPlant", "UnifiedController"])
def test_unread_variables_are_left_out_and_nothing_else_changes(model: str, tmp_path: Path) -> None:
    compiler("cc")
    path = Path(fmpy.extract(str(fmus.locate(f"native/{model}")), str(tmp_path)))
    in_lanes({file.name: file.read_bytes() for file in (path / "sources").iterdir()}, 8, tmp_path)
    slave, rng = slave_class(Target.parse(MODELS[model])), np.random.default_rng(1)
    all_read, some_read = (Together(tmp_path / "lanes.so") for _ in range(2))
    variables, active, left_out = list(slave.variables), np.ones(8, dtype=np.bool_), 0
    usual = {k: slave.usual_parameters[v.name] for k, v in enumerate(variables) if v.name in slave.usual_parameters}
    for each in (all_read, some_read):
        each.begin()
        for lane in range(8):
            each.put(lane, usual)
        each.initialise(active, np.zeros(8))
    for k in range(40):
        inputs = _random_values(rng, variables, "input", 0.5, 0.0)
        wanted = rng.random(all_read.lanes.variables) < (1.0 if k % 10 == 9 else 0.3)
        for each, read in ((all_read, None), (some_read, wanted)):
            for lane in range(8):
                each.put(lane, inputs)
            each.step(active, np.full(8, 0.001 * k), np.full(8, 0.001), read)
            assert not each.status.any()
        same = [bits(a) == bits(b) for a, b in zip(all_read.memory, some_read.memory)]
        others = [*wanted, *[True] * (len(same) - len(wanted))]  # the slave's own places are read by itself
        assert all(itertools.compress(same, others))
        left_out += same.count(False)
    assert left_out > 0, "unread variables are not computed"


@pytest.mark.parametrize("frequencies", [1, 8])
def test_several_steps_at_once_are_the_same_steps(frequencies: int, tmp_path: Path) -> None:
    compiler("cc")
    path = Path(fmpy.extract(str(fmus.locate("native/QuadrotorPlant")), str(tmp_path)))
    sources = {file.name: file.read_bytes() for file in (path / "sources").iterdir()}
    in_lanes(sources, 8, tmp_path, several=True)
    slave, rng = slave_class(Target.parse(MODELS["QuadrotorPlant"])), np.random.default_rng(1)
    at_once, one_by_one = (Together(tmp_path / "lanes.so") for _ in range(2))
    variables, active = list(slave.variables), rng.random(8) < 0.8
    usual = {k: slave.usual_parameters[v.name] for k, v in enumerate(variables) if v.name in slave.usual_parameters}
    of_wind = {v.name: k for k, v in enumerate(variables) if v.name.startswith("wind.")}
    for each in (at_once, one_by_one):
        each.begin()
        for lane in range(8):
            each.put(lane, {**usual, of_wind["wind.frequency"]: 1.0 + lane % frequencies / 8})
            each.put(lane, {of_wind["wind.amplitude.x"]: 0.1 * lane, of_wind["wind.amplitude.z"]: 0.3})
        each.initialise(active, np.zeros(8))
    h, k = 0.001, 0
    for count in (1, 2, 7, 8, 9, 31, 32, 33, 80):
        inputs = _random_values(rng, variables, "input", 0.5, 0.0)
        for lane, each in itertools.product(range(8), (at_once, one_by_one)):
            each.put(lane, inputs)
        times, seen = np.array([h * i for i in range(k, k + count)]), list[list[bytes]]()

        def between(seen: list[list[bytes]] = seen) -> bool:
            seen.append(at_once.held())
            return True

        assert at_once.several(active, times, h, between) == count
        k += count
        for i, t in enumerate(times):
            one_by_one.step(active, np.full(8, t), np.full(8, h))
            assert one_by_one.held() == (seen[i] if i < count - 1 else at_once.held())
    assert at_once.several(active, np.array([h * i for i in range(9)]), h, lambda: False) == 1


def test_lanes_are_refused_by_name() -> None:
    with pytest.raises(PackagingError, match=r"lanes = 3: expected 1 or a power of two up to 64"):
        compiled_lanes({"lanes.c": b""}, 3)
    with pytest.raises(PackagingError, match=r"expected lanes\.c"):
        compiled_lanes({"fmi2.c": b""}, 8)


def test_without_a_compiler_what_to_install_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    preferred_lanes.cache_clear()
    with pytest.raises(PackagingError, match="install one"):
        preferred_lanes()


def test_the_straight_line_is_tried_again_after_other_runs_have_left_it(tmp_path: Path) -> None:
    compiler("cc")
    path = Path(fmpy.extract(str(fmus.locate("native/UnifiedController")), str(tmp_path)))
    in_lanes({file.name: file.read_bytes() for file in (path / "sources").iterdir()}, 8, tmp_path)
    together = Together(tmp_path / "lanes.so")
    variables = slave_class(Target.parse(MODELS["UnifiedController"])).variables
    (period,) = (k for k, variable in enumerate(variables) if variable.name == "sample_period")
    every, h = np.ones(together.count, np.bool_), np.full(together.count, 0.01)
    left = []
    together.begin()
    for periods, count in (((0.05, 0.0), 300), ((0.0, 0.0), 20_000)):
        for lane in range(together.count):
            together.put(lane, {period: periods[lane % 2]})
        together.initialise(every, 0.0 * h)
        for step in range(count):
            together.step(every, step * h, h)
        left.append(together.lanes.line)
    (tried, often), (again, never) = left
    assert often * 20 > tried
    assert (again > 1000, never) == (True, 0)
