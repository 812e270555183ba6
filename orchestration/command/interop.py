"""The command that compares this project's master with third-party masters."""

from pathlib import Path
from typing import Annotated

from orchestration.command import completion
from orchestration.command.flags import FlightFlags, ScenarioFile, Timing, flight_options, request_from
from orchestration.command.options import option
from orchestration.command.registry import CommandResult
from orchestration.foundation.basics.terminal import inform, progress_bar


def _tools(incomplete: str) -> list[str]:
    from orchestration.simulation.interop.catalogue import TOOLS

    return completion.starting(incomplete, [name for name in TOOLS if " " not in name])


@flight_options
def interop(
    scenario: ScenarioFile = None,
    timing: Timing = None,
    tool: Annotated[
        list[str] | None, option("--tool", "Only this tool; may be repeated.", "NAME", autocompletion=_tools)
    ] = None,
    out: Annotated[Path | None, option("--out", "Draw the agreement, signal by signal, here.", "DIR")] = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Run a system in third-party masters and compare every signal with this master's.

    Exit code 1 if a state of a tool differs by more than 1e-9 from this master's with the same first inputs.
    """
    from orchestration.simulation.interop import table
    from orchestration.simulation.interop.catalogue import chosen
    from orchestration.simulation.interop.compare import agreements
    from orchestration.systems.system.request import system_of

    request = request_from(scenario, flags, timing)
    tools = chosen(tool, system_of(request).components)
    with progress_bar("running other masters") as progress:
        found = agreements(request, tools, announce=inform, progress=progress)
    if out is not None:
        from orchestration.simulation.interop.figure import draw

        for path in draw(found, out):
            inform(str(path))
    far = [agreement.tool.name for agreement in found if not table.agrees(agreement)]
    if far:
        inform(f"farther than {table.TOLERANCE:g} from this project's master: {'; '.join(far)}")
    document = [table.as_dict(agreement) for agreement in found]
    return CommandResult(document=document, lines=table.text(found).splitlines(), good=not far)
