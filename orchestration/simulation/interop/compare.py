"""The same run in every tool and in this project's master, compared signal by signal, and what a comparison says."""

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmu_kit.scratch import temporary_folder
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.interop.catalogue import Tool
from orchestration.simulation.interop.tool_runs import ToolRuns
from orchestration.simulation.interop.trace import Trace
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.request import Request

MISSING = 1
"""steps at the end that a tool may omit: some stop where the next step would end beyond it"""
TOLERANCE = 1e-9
"""largest difference of a state that counts as agreement [SI]"""

_HEAD = ("tool", "order", "inputs of the first step", "steps", "ends at", "drift", "difference", "same first inputs")


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """The differences of one tool's run to this project's, in the order of exchange that was observed for the tool."""

    tool: Tool
    versions: dict[str, str]
    trace: Trace
    as_it_comes: dict[str, float]
    """Largest difference from `quadcosim run` by signal [SI]"""
    same_first_inputs: dict[str, float]
    """the same, with the tool's inputs until the end of the first step in this project's master, too"""

    states: frozenset[str]
    """signals of components in continuous time; the others are commands"""

    def both(self) -> tuple[dict[str, float], dict[str, float]]:
        """As it comes, and with the same first inputs."""
        return self.as_it_comes, self.same_first_inputs

    def largest(self, differences: dict[str, float]) -> tuple[float, str]:
        """The largest difference of a state, or of a command if the tool ran no state, with its signal."""
        compared = {name: value for name, value in differences.items() if name in self.states} or differences
        return max((value, name) for name, value in compared.items())


def agreements(
    request: Request,
    tools: Sequence[Tool],
    *,
    announce: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Agreement]:
    """Run a system in each tool, as many at a time as there are processors.

    The step of its components in continuous time is the communication step of all; a period is that of a
    component's own clock, or that step. Raises `ModuleNotFoundError` if a tool is not installed, `UsageError` for a
    system that an SSP cannot express or whose times are no multiples of that step, `QuadcosimError` with the last
    output of a tool that fails.
    """
    with temporary_folder() as folder:
        versions = {tool.name: tool.versions() for tool in tools}
        runs = ToolRuns(request, folder, announce)
        tools = _capable(tools, runs.loop.converted, announce)
        with ThreadPoolExecutor(os.cpu_count()) as pool, runs:
            traces = [pool.submit(runs.trace, tool) for tool in tools]
            results = [pool.submit(runs.run, tool) for tool in tools]
            _wait([*traces, *results], progress)
            return [
                _agreement(runs, tool, versions[tool.name], trace.result(), rows.result())
                for tool, trace, rows in zip(tools, traces, results)
            ]


def _capable(tools: Sequence[Tool], converted: Sequence[str], announce: Callable[[str], None] | None) -> list[Tool]:
    """The tools that can run a system; the others are announced. Raises `UsageError` if there are none."""
    capable = [tool for tool in tools if tool.converts or not converted]
    left_out = "; ".join(tool.name for tool in tools if tool not in capable)
    text = f"{left_out}: connects a Real to a Real only, not {', '.join(converted)}"
    if not capable:
        raise UsageError(f"--tool {text}; expected one that has it")
    if left_out and announce is not None:
        announce(f"left out {text}")
    return capable


def _wait(tasks: Sequence[Future[Any]], progress: Callable[[float], None] | None) -> None:
    """Wait until all are done or one fails; none is begun after a failure."""
    try:
        for done, task in enumerate(as_completed(tasks), 1):
            task.result()
            if progress is not None:
                progress(done / len(tasks))
    finally:
        for task in tasks:
            task.cancel()


def _agreement(runs: ToolRuns, tool: Tool, versions: dict[str, str], trace: Trace, rows: Floats) -> Agreement:
    """Compare the rows of a tool with this project's in the order that was observed for it."""
    order = "gauss-seidel" if trace.order == "alone" else trace.order
    if len(rows) < runs.steps - MISSING:
        raise QuadcosimError(f"{tool.name}: ended after {len(rows)} steps, expected {runs.steps}")
    late = np.abs(rows[:, 0] - runs.step * np.arange(1, len(rows) + 1)).max()
    if late > 0.01 * runs.step:
        raise QuadcosimError(f"{tool.name}: a row is {late:g} s off its communication point")
    first_inputs = {name: (trace.initial_inputs[name], first) for name, first in trace.first_inputs.items()}
    return Agreement(
        tool=tool,
        versions=versions,
        trace=trace,
        as_it_comes=_differences(tool, rows, runs, runs.rows_of_master(order, {})),
        same_first_inputs=_differences(
            tool, rows, runs, runs.rows_of_master(order, {} if trace.order == "alone" else first_inputs)
        ),
        states=frozenset(runs.loop.states),
    )


def _differences(tool: Tool, rows: Floats, runs: ToolRuns, own: Floats) -> dict[str, float]:
    """By signal, the largest difference of a tool's rows, at the ends of steps, from this project's."""
    count, states = min(len(rows), len(own) - 1), 1 + len(runs.loop.states)
    expected = np.column_stack([own[1 : count + 1, 1:states], own[:count, states:]])
    differences = np.abs(rows[:count, 1:] - expected).max(axis=0)
    found = dict(zip(runs.loop.signals, map(float, differences), strict=True))
    components = runs.components_of(tool)
    return {
        name: math.inf if math.isnan(value) else value
        for name, value in found.items()
        if component_of(name) in components
    }


def agrees(agreement: Agreement) -> bool:
    """Whether the tool's run is this project's, if both have the same inputs in the first step."""
    return agreement.largest(agreement.same_first_inputs)[0] <= TOLERANCE


def text(agreements: Sequence[Agreement]) -> str:
    """A Markdown table, a tool a row, its columns aligned."""
    rows = [_HEAD, *map(_row, agreements)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |" for row in rows
    ]
    return "\n".join([lines[0], "|" + "|".join("-" * (width + 2) for width in widths) + "|", *lines[1:]])


def as_dict(agreement: Agreement) -> dict[str, Any]:
    """All results of a tool, in JSON types."""
    trace = agreement.trace
    return {
        "tool": agreement.tool.name,
        "versions": agreement.versions,
        "order": trace.order,
        "first_inputs": trace.first_exchange,
        "steps": trace.steps,
        "end": trace.end,
        "drift": trace.drift,
        "agrees": agrees(agreement),
        "as_it_comes": agreement.as_it_comes,
        "same_first_inputs": agreement.same_first_inputs,
    }


def _row(agreement: Agreement) -> tuple[str, ...]:
    trace = agreement.trace
    kinds = set(trace.first_exchange.values())
    first = kinds.pop() if len(kinds) == 1 else ", ".join(f"{k}: {v}" for k, v in trace.first_exchange.items())
    differences = (f"{value:.1e} {name}" for value, name in map(agreement.largest, agreement.both()))
    return (
        agreement.tool.name,
        trace.order,
        first,
        str(trace.steps),
        f"{trace.end:.15g} s",
        f"{trace.drift:.0e} s",
        *differences,
    )
