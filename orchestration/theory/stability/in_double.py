"""Float code of controllers in C, which linear theory takes in double precision, and whether that is the same law.

Rounding as in single precision hides what small deviations do. The same code with doubles for floats shows it, but for
what floats alone do: where an integral stands still, and in which steps it moves.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from orchestration.components.building import fmus, wrap
from orchestration.components.building.models import PATHS
from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.read_description import read_model
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.model import Criterion, System

SIZES, TRIED = (1e-3, 0.01, 0.1, 1.0, 10.0), 2
"""Deviations of inputs by which both are compared, relative or absolute, and at how many of them an output is"""
SAMPLES = 256
SAME = 2e-3
"""Difference of the responses, relative to the largest of an output, that single precision explains"""
ROUNDED = 30.0 * float(np.finfo(np.float32).eps)
"""Error of an output by its rounding, relative to its size"""
RESOLVED = 1000.0
"""Times that error, from which a response is compared"""

_OF: dict[str, str] = {}
"""The FMU as it is, of each in double precision that this process has taken"""
_SAME: set[str] = set()
"""Components and their inputs at rest that have been compared"""


def in_double(request: fmus.Twin) -> fmus.Twin:
    """A system, or its request, with float code in C in double precision, where its state can be saved.

    Raises `UsageError` for code that cannot be compiled so.
    """
    return request.with_twins(_twin)


def _twin(fmu: str) -> str:
    found = wrap.in_double(fmu) if Path(fmu).suffix in PATHS else None
    if found is None or not read_model(fmus.locate(fmu)).saves_state:
        return fmu
    _OF[str(found)] = fmu
    return str(found)


def as_it_is(fmu: str) -> str:
    """The FMU whose code one in double precision has; any other is itself."""
    return _OF.get(fmu, fmu)


def are_in_double(components: Mapping[str, Component]) -> tuple[str, ...]:
    """The names of those that are."""
    return tuple(name for name, one in components.items() if Path(one.fmu).is_relative_to(wrap.in_double_folder()))


def of_code(names: Iterable[str]) -> str:
    """That code of these components is taken in double precision, in words."""
    return f", float code of {', '.join(names)} in double precision" if names else ""


def expect_same_law(system: System, instances: Instances, held: Mapping[str, Mapping[str, float]]) -> None:
    """Raise `UsageError` for code in double precision that is another law than as it is; `held`: inputs at rest.

    Both get the same random inputs about them, from their start.
    """
    for fmu in dict.fromkeys(system.components[name].fmu for name in are_in_double(system.components)):
        parts = {
            name: replace(one, sampling=_even(one.sampling))
            for name, one in system.components.items()
            if one.fmu == fmu
        }
        rounded = {name: {end: float(f"{x:.2g}") for end, x in held[name].items()} for name in parts}
        key = json.dumps([{name: asdict(one) for name, one in parts.items()}, rounded], default=str)
        if key not in _SAME:
            _expect_same(parts, instances, {name: held[name] for name in parts})
            _SAME.add(key)


def _even(sampling: Sampling | None) -> Sampling | None:
    return None if sampling is None else Sampling(period=sampling.period, fmu_clock=sampling.fmu_clock)


def _expect_same(parts: Mapping[str, Component], instances: Instances, held: Mapping[str, Mapping[str, float]]) -> None:
    """Compare each output by inputs of the two least sizes at which floats resolve it: larger ones might saturate."""
    single = {name: replace(one, fmu=as_it_is(one.fmu)) for name, one in parts.items()}
    tried, apart, found, why = np.zeros(1), np.nan, np.zeros(1), ""
    for size in SIZES:
        try:
            (rounded, _), (exact, values) = (_responses(one, instances, held, size) for one in (single, parts))
        except SimulatorError as error:
            why = str(error)
            continue
        largest, errors = np.abs(exact).max(axis=0), np.abs(exact - rounded).max(axis=0) - ROUNDED * values
        counts = (np.maximum(largest, np.abs(rounded).max(axis=0)) > RESOLVED * ROUNDED * values) & (tried < TRIED)
        share = np.maximum(errors, 0.0) / np.where(largest > 0.0, largest, 1e-300)
        found = np.where(counts, np.where(tried > 0, np.minimum(found, share), share), found)
        tried = tried + counts
        apart = float(found.max(initial=0.0))
        if apart <= SAME and tried.all():
            return
    if not apart <= SAME:
        by = f"responses differ by {apart:.2g} of the largest" if apart > SAME else why
        raise UsageError(
            f"{', '.join(parts)}: its float code in double precision, of which linear theory is, is another law: {by}, "
            f"expected at most {SAME:g}, as of code that does not rely on the bits or the rounding of a float"
        )


def _responses(
    parts: Mapping[str, Component], instances: Instances, held: Mapping[str, Mapping[str, float]], size: float
) -> tuple[Floats, Floats]:
    """Half the difference of all outputs after random inputs up and down, shape (n, outputs), and their sizes."""
    alone = System(stop_time=1e9, components=parts, criterion=Criterion())
    courses = []
    for sign in (size, -size):
        rng = np.random.default_rng(0)
        with prepared(alone, load=instances.load) as run:
            run.master.initialise()
            courses.append(_course(run.instances, parts, held, rng, sign))
    up, down = courses
    return 0.5 * (up - down), np.maximum(np.abs(up), np.abs(down)).max(axis=0)


def _course(
    instances: Mapping[str, Instance],
    parts: Mapping[str, Component],
    held: Mapping[str, Mapping[str, float]],
    rng: np.random.Generator,
    size: float,
) -> Floats:
    writes, reads = [], []
    for name, fmu in instances.items():
        ends, outputs = (
            list(held[name]),
            [v.name for v in fmu.model.variables.values() if v.causality == "output" and v.kind == "Real"],
        )
        rest, into = np.array(list(held[name].values())), np.zeros(len(outputs))
        real = np.array([fmu.model.variables[end].kind == "Real" for end in ends], dtype=float)
        given = rest.copy()
        writes.append((fmu.writer(ends, given), given, rest, size * real * np.maximum(1.0, np.abs(rest))))
        reads.append((fmu.reader(outputs, into), into))
    rows = []
    for k in range(SAMPLES):
        for (name, fmu), (write, given, rest, most) in zip(instances.items(), writes):
            given[:] = rest + most * rng.uniform(-1.0, 1.0, len(rest))
            write()
            sampling = parts[name].sampling
            h = parts[name].step or (0.0 if sampling is None else sampling.period)
            fmu.step(k * h, h)
        for read, _ in reads:
            read()
        rows.append(np.concatenate([into for _, into in reads]))
    return np.array(rows)
