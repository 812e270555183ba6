"""The commands for system files: their schema, a proposal for FMUs, a description or diagram."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmu_kit.new_files import clear, write_atomically
from orchestration.command.flags import FlightFlags, ScenarioFile, Timing, flight_options, request_from
from orchestration.command.options import option
from orchestration.command.registry import CommandResult, build_option
from orchestration.foundation.basics.terminal import inform

if TYPE_CHECKING:
    from orchestration.systems.system.model import System


def schema() -> CommandResult:
    """Print the JSON schema of system files, with which editors complete and check them."""
    from orchestration.systems.system import file

    result = CommandResult(document=file.schema(), lines=[])
    return replace(result, lines=result.as_json.splitlines())


@build_option
def connect(
    fmu: Annotated[
        list[str],
        typer.Argument(
            help="FMUs: paths, or names of this project's; tables of tasks (.csv), databases of CAN buses (.dbc)."
        ),
    ],
    out: Annotated[Path | None, option("--out", "The system file; default: printed.", "SYSTEM.toml")] = None,
) -> CommandResult:
    """Propose a system file for FMUs: outputs to inputs by name, type and unit; open points are marked in it."""
    from orchestration.components.building import fmus
    from orchestration.components.fmi.read_description import read_model
    from orchestration.foundation.basics.errors import UsageError
    from orchestration.simulation.requests.resource_files import resources_of
    from orchestration.systems.system.proposal import propose

    if out is not None:
        clear(out.parent)  # it may be what a killed process was about to move there
    if out is not None and out.exists():
        raise UsageError(f"--out {out}: exists already; expected a file that does not exist")
    resources, others = resources_of(fmu)
    proposal = propose(
        [(text, read_model(fmus.locate(text, inform))) for text in others],
        Path.cwd() if out is None else out.parent,
        resources,
    )
    for line in proposal.guessed:
        inform(f"guessed: {line}")
    for line in proposal.undecided:
        inform(f"not decided: {line}")
    document = {"file": out, "text": proposal.text, "guessed": proposal.guessed, "undecided": proposal.undecided}
    if out is None:
        return CommandResult(document=document, lines=proposal.text.splitlines())
    write_atomically(out, proposal.text)
    return CommandResult(document=document, lines=[str(out)])


@flight_options
def show(
    system: ScenarioFile = None,
    timing: Timing = None,
    out: Annotated[Path | None, option("--out", "Draw it, in the format of the ending.", "FIGURE.png")] = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Show a system: components with their rates, connections with their delay, jitter, loss and hold, units.

    Of an FMU without flags: what it declares, from its capabilities to its variables.
    """
    if system is not None and system.suffix.lower() == ".fmu" and out is None and flags == FlightFlags():
        from orchestration.components.fmi import facts
        from orchestration.components.fmi.read_description import read_model

        found = facts.facts(read_model(system))
        return CommandResult(document=found, lines=[*facts.as_lines(found)], verdict=found.verdict)
    from orchestration.systems.system.description import as_text
    from orchestration.systems.system.file_tables import tables_of
    from orchestration.systems.system.request import system_of

    shown = system_of(request_from(system, flags, timing))
    if out is not None:
        from orchestration.simulation.figures import diagram

        inform(str(diagram.write(shown, out)))
    return CommandResult(document=tables_of(shown), lines=as_text(shown, *_from_fmus(shown)).splitlines())


def _from_fmus(system: "System") -> tuple[dict[str, str], str, Sequence[str], Sequence[str]]:
    """The units of its objectives, the references of its components, its algebraic loops, and who handles events.

    Empty if FMUs are missing or do not fit: nothing is built, so that no foreign module runs.
    """
    from orchestration.components.building import fmus
    from orchestration.components.fmi.read_description import read_model
    from orchestration.foundation.basics.errors import QuadcosimError
    from orchestration.simulation.engines.resolved import check_against_fmus

    try:
        paths = {name: fmus.look_up(fmu, inform) for name, fmu in system.fmus.items()}
        models = {name: read_model(path) for name, path in paths.items() if path is not None}
        if models.keys() != paths.keys():
            return {}, "", (), ()
        found = check_against_fmus(system, models)
    except QuadcosimError:
        return {}, "", (), ()
    return found.units, found.follows, found.loops, found.events
