"""The command that answers without a run."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.basics.terminal import warn
from orchestration.command import registry as registering
from orchestration.command.answer import Answer
from orchestration.command.flags import FlightFlags, Timing, flies, request_from

if TYPE_CHECKING:
    from collections.abc import Sequence

    from orchestration.building.inputs import Files
    from orchestration.exact.expect import Expected
    from orchestration.system.model import System
    from orchestration.system.request import Request


@flies
def expect(
    scenario: Annotated[
        Path | None,
        typer.Argument(help="System or scenario file, or SSP; without one, the paper's flight.", show_default=False),
    ] = None,
    timing: Timing = None,
    as_simulated: Annotated[
        bool, typer.Option("--as-simulated", help="What runs print on average: noise held, means over their rows.")
    ] = False,
    horizon: Annotated[
        float | None,
        typer.Option("--horizon", help="Means from the initial conditions to this time.", metavar="SECONDS"),
    ] = None,
    *,
    flags: FlightFlags,
) -> Answer:
    """Expect the objectives that are means of squares exactly, of the loop about its operating point, without a run."""
    from orchestration.exact.expect import expect as expected

    found = expected(request_from(scenario, flags, timing), as_simulated=as_simulated, horizon=horizon)
    return Answer(document=found, lines=_lines(found))


def say_if_endless(request: "Request", systems: "Sequence[System] | None" = None, files: "Files | None" = None) -> None:
    """Warn where averages over such runs mean nothing."""
    from orchestration.building.inputs import files_of
    from orchestration.exact.infinite_means import infinite_means_warning
    from orchestration.system.request import system_of

    systems = [system_of(request)] if systems is None else systems
    text = infinite_means_warning(request, systems, files_of(systems[0]) if files is None else files)
    if text is not None:
        warn(text)


def _lines(found: "Expected") -> list[str]:
    fourth = found.fourth_moment_radius
    told = {
        **{name: "-" if value is None else f"{value:.12g}" for name, value in found.objectives.items()},
        "mean_square_radius": f"{found.mean_square_radius:.12g} in {found.period:g} s",
        "fourth_moment_radius": "-" if fourth is None else f"{fourth:.12g}",
        "accuracy": f"{found.accuracy:.1g} of each",
        "method": found.method,
    }
    width = max(map(len, told))
    lines = [f"{name:<{width}}  {value}" for name, value in told.items()]
    if fourth is not None and found.mean_square_radius < 1.0 <= fourth:
        lines.append("fourth moments have no end: an interval of a mean square over runs means nothing here")
    without: dict[str, list[str]] = {}
    for name, why in found.reasons.items():
        without.setdefault(why, []).append(name)
    return [*lines, *(f"no {', '.join(listed)}: {why}" for why, listed in without.items())]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    registering.add(app, registering.STUDY, expect)
