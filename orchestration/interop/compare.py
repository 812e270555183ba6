"""The same flight in every tool and in this project's master, compared signal by signal."""

import math
import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.basics.simulator import Floats
from orchestration.interop.catalogue import Tool
from orchestration.interop.flights import Flights
from orchestration.interop.trace import Trace
from orchestration.system.request import Request
from orchestration.system.variable_names import component_of

MISSING = 1
"""Steps before the end that a tool may leave out: some stop where the next step would end beyond it."""


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How far one tool's flight is from this project's, in the order of exchange that the tool was seen to have."""

    tool: Tool
    versions: dict[str, str]
    trace: Trace
    as_it_comes: dict[str, float]
    """by signal: largest difference from `quadcosim run` [SI]"""
    same_start: dict[str, float]
    """the same, with the tool's inputs until the end of the first step given to this project's master too"""

    states: frozenset[str]
    """signals of components in continuous time; the others are commands"""

    def both(self) -> tuple[dict[str, float], dict[str, float]]:
        """As it comes, and with the same start."""
        return self.as_it_comes, self.same_start

    def largest(self, differences: dict[str, float]) -> tuple[float, str]:
        """The largest difference of a state, or of a command if the tool flew no state, and the signal it is in."""
        flown = {name: value for name, value in differences.items() if name in self.states} or differences
        return max((value, name) for name, value in flown.items())


def agreements(
    asked: Request,
    tools: Sequence[Tool],
    *,
    announce: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Agreement]:
    """Fly a system in each tool, as many at a time as there are processors.

    The step of its components in continuous time is the communication step of all; a period is that of a
    component's own clock, or that step. Raises `ModuleNotFoundError` if a tool is not installed, `UsageError` for a
    system that an SSP cannot carry or whose times are no multiples of that step, `QuadcosimError` with a tool's last
    words if it fails.
    """
    with tempfile.TemporaryDirectory(prefix="quadcosim_") as folder:
        versions = {tool.name: tool.versions() for tool in tools}
        flights = Flights(asked, Path(folder), announce)
        tools = _able(tools, flights.loop.converted, announce)
        with ThreadPoolExecutor(os.cpu_count()) as pool, flights:
            seen = [pool.submit(flights.seen, tool) for tool in tools]
            flown = [pool.submit(flights.flown, tool) for tool in tools]
            _wait([*seen, *flown], progress)
            return [
                _agreement(flights, tool, versions[tool.name], trace.result(), rows.result())
                for tool, trace, rows in zip(tools, seen, flown)
            ]


def _able(tools: Sequence[Tool], converted: Sequence[str], announce: Callable[[str], None] | None) -> list[Tool]:
    """The tools that can fly a system, the others told of; raises `UsageError` if there are none."""
    able = [tool for tool in tools if tool.converts or not converted]
    left_out = "; ".join(tool.name for tool in tools if tool not in able)
    told = f"{left_out}: no conversion of types, as of {', '.join(converted)}"
    if not able:
        raise UsageError(f"--tool {told}; expected one that has it")
    if left_out and announce is not None:
        announce(f"left out {told}")
    return able


def _wait(tasks: Sequence[Future[Any]], progress: Callable[[float], None] | None) -> None:
    """Until all are done or one fails; none is begun after a failure."""
    try:
        for done, task in enumerate(as_completed(tasks), 1):
            task.result()
            if progress is not None:
                progress(done / len(tasks))
    finally:
        for task in tasks:
            task.cancel()


def _agreement(flights: Flights, tool: Tool, versions: dict[str, str], trace: Trace, rows: Floats) -> Agreement:
    """Compare the rows of a tool with this project's in the order that it was seen to have."""
    order = "gauss-seidel" if trace.order == "alone" else trace.order
    if len(rows) < flights.steps - MISSING:
        raise QuadcosimError(f"{tool.name}: ended after {len(rows)} steps, expected {flights.steps}")
    late = np.abs(rows[:, 0] - flights.step * np.arange(1, len(rows) + 1)).max()
    if late > 0.01 * flights.step:
        raise QuadcosimError(f"{tool.name}: a row is {late:g} s beside its communication point")
    given = {name: (trace.initial_inputs[name], first) for name, first in trace.first_inputs.items()}
    return Agreement(
        tool=tool,
        versions=versions,
        trace=trace,
        as_it_comes=_differences(tool, rows, flights, flights.rows_of_master(order, {})),
        same_start=_differences(
            tool, rows, flights, flights.rows_of_master(order, {} if trace.order == "alone" else given)
        ),
        states=frozenset(flights.loop.states),
    )


def _differences(tool: Tool, rows: Floats, flights: Flights, own: Floats) -> dict[str, float]:
    """By signal, the largest difference of a tool's rows, which are of the ends of steps, from this project's."""
    count, states = min(len(rows), len(own) - 1), 1 + len(flights.loop.states)
    expected = np.column_stack([own[1 : count + 1, 1:states], own[:count, states:]])
    differences = np.abs(rows[:count, 1:] - expected).max(axis=0)
    found = dict(zip(flights.loop.signals, map(float, differences), strict=True))
    components = flights.flown_by(tool)
    return {
        name: math.inf if math.isnan(value) else value
        for name, value in found.items()
        if component_of(name) in components
    }
