"""The command that makes an FMU of a controller in C."""

from pathlib import Path
from typing import Annotated

import typer

from orchestration.command.options import option
from orchestration.command.registry import CommandResult, result_of_files


def wrap(
    controller: Annotated[Path, typer.Argument(help="File that describes the code.", metavar="CONTROLLER.toml")],
    out: Annotated[
        Path | None, option("--out", "Folder for the FMU; default: that of the file, or fmi3/ there.", "DIR")
    ] = None,
    fmi: Annotated[int, option("--fmi", "Version of FMI.", min=2, max=3)] = 2,
    target: Annotated[
        str | None,
        option(
            "--target",
            "Systems to compile for, too, with the compiler of the package ziglang; then once a process.",
            "all|linux64,linux-aarch64,win64,darwin64",
        ),
    ] = None,
) -> CommandResult:
    """Make an FMU of a controller that exists as C: its sources as they are, and a file that names its variables."""
    from orchestration.components.building import consent
    from orchestration.components.building import wrap as wrapping

    default = wrapping.fmu_of(controller, fmi)
    consent.agree(controller.parent)
    built = wrapping.build(controller, default if out is None else out / default.name, version=fmi, systems=target)
    return result_of_files([built])
