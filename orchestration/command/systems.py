"""The commands that are about a system as a file: its schema, a proposal for one, a picture of one."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.basics.terminal import inform
from orchestration.command import registry as registering
from orchestration.command.answer import Answer
from orchestration.command.build_flag import builds
from orchestration.command.flags import FlightFlags, Timing, flies, request_from
from orchestration.command.registry import FLY

if TYPE_CHECKING:
    from orchestration.system.model import System


def schema() -> Answer:
    """Print the JSON schema of a system file, from which editors complete and check it."""
    from orchestration.system import system_file

    answer = Answer(document=system_file.schema(), lines=[])
    return replace(answer, lines=answer.as_json.splitlines())


@builds
def connect(
    fmu: Annotated[
        list[str],
        typer.Argument(
            help="FMUs: paths, or names of this project's; tables of tasks (.csv), databases of CAN buses (.dbc).",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", help="The system file; default: printed.", metavar="SYSTEM.toml")
    ] = None,
) -> Answer:
    """Propose a system file for FMUs: outputs to inputs by name, type and unit; what is open is said in it."""
    from orchestration.basics.errors import UsageError
    from orchestration.building import fmus
    from orchestration.fmi.model import read_model
    from orchestration.requests.resource_files import resources_of
    from orchestration.system.proposal import propose

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
        return Answer(document=document, lines=proposal.text.splitlines())
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(proposal.text, encoding="utf-8")
    return Answer(document=document, lines=[str(out)])


@flies
def show(
    system: Annotated[
        Path | None,
        typer.Argument(help="System or scenario file, or SSP; without one, the paper's flight.", show_default=False),
    ] = None,
    timing: Timing = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Draw it, in the format of the ending.", metavar="FIGURE.png")
    ] = None,
    *,
    flags: FlightFlags,
) -> Answer:
    """Show a system: components with their rates, connections with their delay, jitter, loss and hold, units."""
    from orchestration.system.description import as_text
    from orchestration.system.request import system_of
    from orchestration.system.written import tables_of

    meant = system_of(request_from(system, flags, timing))
    if out is not None:
        from orchestration.figures import diagram

        inform(str(diagram.write(meant, out)))
    return Answer(document=tables_of(meant), lines=as_text(meant, *_said_by_fmus(meant)).splitlines())


def _said_by_fmus(system: "System") -> tuple[dict[str, str], str]:
    """The units of its objectives, and what is followed by whom.

    Nothing where its FMUs are not there, or do not fit: who looks runs no foreign module.
    """
    from orchestration.basics.errors import QuadcosimError
    from orchestration.building import fmus
    from orchestration.engines.wiring import check_against_fmus
    from orchestration.fmi.model import read_model

    try:
        paths = {name: fmus.look_up(fmu, inform) for name, fmu in system.fmus.items()}
        models = {name: read_model(path) for name, path in paths.items() if path is not None}
        if models.keys() != paths.keys():
            return {}, ""
        found = check_against_fmus(system, models)
    except QuadcosimError:
        return {}, ""
    return found.units, found.follows


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    registering.add(app, FLY, show, connect, schema)
