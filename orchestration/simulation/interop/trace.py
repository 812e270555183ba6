"""How a tool steps the FMUs, from the logs of traced copies."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from orchestration.components.fmi.instance import number_of
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.simulation.interop.assignment import AssignedLoop
from orchestration.simulation.interop.copies import log_of


@dataclass(frozen=True, kw_only=True)
class Trace:
    """How a tool stepped the FMUs."""

    order: str
    """gauss-seidel: the components step one after the other, each with the newest outputs of those before it; jacobi:
    all step with the outputs of the step before; alone: only a part of the loop was run; other: none of these"""
    initial_inputs: dict[str, tuple[float, ...]]
    """The values at the connected inputs of each component when its initialisation ended."""
    first_inputs: dict[str, tuple[float, ...]]
    """The values at the connected inputs of each component when its first step began."""
    first_exchange: dict[str, str]
    """The origin of these, for each component: exchanged (outputs of the others), start values or zeros."""
    steps: int
    """Number of steps that the last component of the loop took."""
    drift: float
    """The largest distance of a communication point from a multiple of the step [s]."""
    end: float
    """The time at which the last step ended [s]."""


def read_trace(folder: Path, components: Mapping[str, Path], loop: AssignedLoop, step: float) -> Trace:
    """The trace in the logs of `components`, FMUs by name; raises `QuadcosimError` if a component took no step."""
    starts, steps = {}, {}
    for component in components:
        log = log_of(component, folder)
        lines = log.read_text(encoding="utf-8").splitlines() if log.is_file() else []
        if len(lines) < 2:
            raise QuadcosimError(f"{component}: the tool did not step it; expected at least one step in {log}")
        starts[component], *steps[component] = map(json.loads, lines)
    exact = Fraction(repr(step))
    last = steps[next(name for name in reversed(list(loop.ports)) if name in steps)]
    return Trace(
        order=_order(steps, loop),
        initial_inputs={component: tuple(start["inputs"]) for component, start in starts.items()},
        first_inputs={component: tuple(found[0]["inputs"]) for component, found in steps.items()},
        first_exchange={
            name: _first_exchange(name, components[name], loop, starts, steps)
            for name in components
            if loop.ports[name].inputs
        },
        steps=len(last),
        drift=max(abs(line["t"] - float(k * exact)) for k, line in enumerate(last)),
        end=last[-1]["t"] + last[-1]["h"],
    )


def _order(steps: Mapping[str, list[dict[str, Any]]], loop: AssignedLoop) -> str:
    """The order of exchange: the step whose outputs were the inputs of each step after the first."""
    if set(steps) != set(loop.ports) or len(steps) < 2:
        return "alone"
    places = {name: i for i, name in enumerate(loop.ports)}
    old, new = True, True
    for component in steps:
        for sender, values, before, now in _exchanged(component, steps, loop):
            old &= values == before
            new &= values == (now if places[sender] < places[component] else before)
    return "gauss-seidel" if new else "jacobi" if old else "other"


def _exchanged(
    component: str, steps: Mapping[str, list[dict[str, Any]]], loop: AssignedLoop
) -> Iterator[tuple[str, list[float], list[float], list[float]]]:
    """For each connected input: its sender, its values from the second step on, the outputs of the step before and of
    the same step.
    """
    for i, (sender, output) in enumerate(loop.feeding(component).values()):
        place = loop.ports[sender].outputs.index(output)
        outputs = [line["outputs"][place] for line in steps[sender]]
        values = [line["inputs"][i] for line in steps[component][1:]]
        yield sender, values, outputs[: len(values)], outputs[1 : len(values) + 1]


def _first_exchange(
    component: str,
    fmu: Path,
    loop: AssignedLoop,
    starts: Mapping[str, dict[str, Any]],
    steps: Mapping[str, list[dict[str, Any]]],
) -> str:
    """The origin of the connected inputs of `component` at its first step."""
    variables = read_model(fmu).variables
    inputs = steps[component][0]["inputs"]
    if inputs == [number_of(variables[name], variables[name].start or 0.0) for name in loop.ports[component].inputs]:
        return "start values"
    if not any(inputs):
        return "zeros"
    feeding = loop.feeding(component)
    if not all(sender in starts for sender, _ in feeding.values()):
        return "exchanged"
    for value, (sender, output) in zip(inputs, feeding.values(), strict=True):
        place = loop.ports[sender].outputs.index(output)
        if value not in (starts[sender]["outputs"][place], steps[sender][0]["outputs"][place]):
            return "other"
    return "exchanged"
