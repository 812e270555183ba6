"""The command that writes a loop as matrices."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.command.answer import Answer
from orchestration.command.flags import FlightFlags, Timing, flies, request_from

if TYPE_CHECKING:
    from orchestration.stability.state_space import StateSpace


@flies
def linearise(
    scenario: Annotated[
        Path | None,
        typer.Argument(
            help="System or scenario file, or SSP; without one, the paper's loop about hover.", show_default=False
        ),
    ] = None,
    timing: Timing = None,
    component: Annotated[
        str | None,
        typer.Option(
            "--component",
            help="Where the loop is cut open; default: the only component that is sampled.",
            metavar="NAME",
            show_default=False,
        ),
    ] = None,
    *,
    flags: FlightFlags,
) -> Answer:
    """A loop about its operating point as matrices, from sample to sample: a component, and all else as it sees it.

    With --json A, B, C and D of both, and what their inputs and outputs are.
    """
    from orchestration.stability.linearise import linearise as linearised

    found = linearised(request_from(scenario, flags, timing), component)
    halves = {found.name: found.component, "rest": found.rest}
    document = {"name": found.name, "component": _matrices(found.component), "rest": _matrices(found.rest)}
    return Answer(document=document, lines=[f"{name:<17}  {_in_words(half)}" for name, half in halves.items()])


def _matrices(system: "StateSpace") -> dict[str, object]:
    """As a document."""
    matrices = {name: getattr(system, name).tolist() for name in "ABCD"}
    return {**matrices, "dt": system.dt, "inputs": system.inputs, "outputs": system.outputs}


def _in_words(system: "StateSpace") -> str:
    inputs, outputs = (", ".join(names) for names in (system.inputs, system.outputs))
    return f"{inputs} → {outputs}; {len(system.A)} states, every {system.dt:g} s"
