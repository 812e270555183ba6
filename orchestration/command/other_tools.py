"""The commands for other tools: C for a microcontroller, SSP, and runs in third-party masters."""

from pathlib import Path
from typing import Annotated

import typer

from orchestration.command import completion, verdicts
from orchestration.command.flags import FlightFlags, ScenarioFile, Timing, flight_options, request_from
from orchestration.command.options import option
from orchestration.command.registry import CommandResult, option_group, result_of_files
from orchestration.command.variant_flags import VariantFlags
from orchestration.foundation.basics.terminal import inform, progress_bar, warn


@option_group("variant", VariantFlags)
def export_c(
    out: Annotated[Path, option("--out", "Folder for NAME.h and NAME.c.", "DIR")],
    slave: Annotated[
        str,
        typer.Argument(
            help="UnifiedController, QuadrotorPlant, a folder of modules that define slaves, or FOLDER/NAME."
        ),
    ] = "UnifiedController",
    single: Annotated[
        bool, option("--single", "Single precision, with functions of libm; default: double, without.")
    ] = False,
    *,
    variant: VariantFlags,
) -> CommandResult:
    """Write a controller, or any slave, as two files in C for a microcontroller: no allocation, C99."""
    from orchestration.components.building import builder

    written = builder.export_c(variant.applied_to(builder.slaves_named(slave)), out, single=single)
    return result_of_files(each for path in written for each in (path.with_suffix(".h"), path))


@flight_options
def ssp(
    scenario: Annotated[
        Path | None, typer.Argument(help="System or scenario file; without one, the paper's flight.")
    ] = None,
    out: Annotated[
        Path | None, option("--out", "The file; default: QuadrotorLoop.ssp in fmus/, or NAME.ssp here.", "FILE")
    ] = None,
    read_back: Annotated[
        bool,
        option(
            "--read-back", "Load it in libcosim, ecos and fmpy, where installed, run the first steps, and report each."
        ),
    ] = False,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Write FMUs, connections and parameters as one SSP 1.0 file for other tools, and its timing beside it."""
    from orchestration.components.building import fmus
    from orchestration.simulation.interop.reading_back import readings
    from orchestration.simulation.requests.ssp import writing
    from orchestration.simulation.requests.ssp.export import export_of

    request = request_from(scenario, flags)
    if request.title is not None or scenario is None:
        default = fmus.default_folder() / f"{request.title}.ssp"
    else:
        default = Path(f"{scenario.stem}.ssp")
    written, timing = writing.write_with_timing(request, out or default, inform, warn)
    inform(f"{timing} has its timing, for quadcosim run")
    masters: dict[str, str | None] = {}
    for reading in readings(written, export_of(request)) if read_back else ():
        masters[reading.master] = reading.refusal
        if reading.refusal is None:
            inform(f"{reading.master} runs it")
        else:
            warn(f"{reading.master} does not run it: {reading.refusal}")
    return CommandResult(document={"files": [written, timing], "masters": masters}, lines=[str(written)])


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
    from orchestration.simulation.interop import compare
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
    far = [agreement.tool.name for agreement in found if not compare.agrees(agreement)]
    document = [compare.as_dict(agreement) for agreement in found]
    if far:
        inform(f"farther than {compare.TOLERANCE:g} from this project's master: {'; '.join(far)}")
    verdict = verdicts.of_agreements(far, len(found), compare.TOLERANCE)
    return CommandResult(
        document={"tools": document}, verdict=verdict, lines=compare.text(found).splitlines(), good=not far
    )
