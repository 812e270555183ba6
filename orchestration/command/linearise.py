"""The command that writes a loop as matrices."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.command.flags import FlightFlags, Timing, flight_options, request_from
from orchestration.command.options import option
from orchestration.command.registry import CommandResult

if TYPE_CHECKING:
    from orchestration.theory.stability.state_space import StateSpace


@flight_options
def linearise(
    scenario: Annotated[
        Path | None, typer.Argument(help="System or scenario file, or SSP; without one, the paper's loop about hover.")
    ] = None,
    timing: Timing = None,
    component: Annotated[
        str | None,
        option("--component", "Where the loop is cut open; default: the only component that is sampled.", "NAME"),
    ] = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Linearise a loop about its operating point, from sample to sample: a component, and the rest of the loop.

    With --json A, B, C and D of both, and the names of their inputs and outputs.
    """
    from orchestration.theory.stability.linearise import linearise as linearised_loop

    loop = linearised_loop(request_from(scenario, flags, timing), component)
    halves = {loop.name: loop.component, "rest": loop.rest}
    document = {"name": loop.name, "component": _matrices(loop.component), "rest": _matrices(loop.rest)}
    return CommandResult(document=document, lines=[f"{name:<17}  {_summary(half)}" for name, half in halves.items()])


def _matrices(system: "StateSpace") -> dict[str, object]:
    """A system as a document."""
    matrices = {name: getattr(system, name).tolist() for name in "ABCD"}
    return {**matrices, "dt": system.dt, "inputs": system.inputs, "outputs": system.outputs}


def _summary(system: "StateSpace") -> str:
    inputs, outputs = (", ".join(names) for names in (system.inputs, system.outputs))
    return f"{inputs} → {outputs}; {len(system.A)} states, every {system.dt:g} s"
