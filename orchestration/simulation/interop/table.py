"""Agreements as text and as JSON types, and whether they hold."""

from collections.abc import Sequence
from typing import Any

from orchestration.simulation.interop.compare import Agreement

TOLERANCE = 1e-9
"""largest difference of a state that counts as agreement [SI]"""

_HEAD = ("tool", "order", "inputs of the first step", "steps", "ends at", "drift", "difference", "same first inputs")


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
