"""The commands that write files to start from: a controller, a plant, a filter, the examples, an FMU of C."""

from pathlib import Path
from typing import Annotated, get_args

import typer

from orchestration.command.options import option
from orchestration.command.registry import CommandResult, result_of_files
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import inform


def new(
    kind: Annotated[
        str,
        typer.Argument(
            help="A law for the quadrotor, a plant with its law, or a filter.", metavar="controller|plant|filter"
        ),
    ],
    name: Annotated[str, typer.Argument(help="Name of the folder and its FMU, such as hover_pd.")],
    author: Annotated[str | None, option("--author", "Author; default: git's user.name.")] = None,
    license: Annotated[str, option("--license", "Licence of the slave.", "TEXT")] = "",
    in_c: Annotated[bool, option("--c", "A controller in C, and the file by which it is wrapped.")] = False,
    plant: Annotated[
        str | None,
        option(
            "--for",
            "A controller for this plant: its outputs in, its inputs out, connected; also with --c.",
            "PLANT.fmu",
        ),
    ] = None,
    out: Annotated[Path, option("--out", "Folder in which it is written; default: this one.", "DIR")] = Path(),
) -> CommandResult:
    """Write a folder NAME: a law for the quadrotor (controller), or for a plant of your own, or a filter; its test.

    It has a system that uses it, and a page of commands.
    """
    from orchestration.components.scaffold.folder import Kind, git_author, write

    kinds = {each: each for each in get_args(Kind)}
    if kind not in kinds:
        raise UsageError(f"new {kind}: expected {', '.join(kinds)}")
    if in_c and kind != "controller":
        raise UsageError(f"new {kind} --c: expected controller; a plant with its law in C is in examples/dc_motor")
    author = git_author() if author is None else author
    of_plant = None if plant is None else _of_plant(plant, kind, out / name, in_c=in_c)
    written = write(kinds[kind], name, out, author=author, license=license, in_c=in_c, of_plant=of_plant)
    if not author:
        inform(
            f"no author is set: set it by --author NAME, or in the line author = of the {'file' if in_c else 'class'}"
        )
    inform(f"next: quadcosim run {out / name / 'system.toml'}")
    return result_of_files(written)


def _of_plant(plant: str, kind: str, folder: Path, *, in_c: bool) -> dict[str, str]:
    from orchestration.components.building import fmus
    from orchestration.components.fmi.read_description import read_model
    from orchestration.systems.system.for_plant import texts_for

    if kind != "controller":
        raise UsageError(f"new {kind} --for {plant}: expected new controller")
    return texts_for(plant, read_model(fmus.locate(plant, inform)), folder, in_c=in_c)


def examples(
    out: Annotated[Path, option("--out", "Folder for them.", "DIR")] = Path(),
) -> CommandResult:
    """Write the folders examples, studies and gains here: the files that the documentation uses."""
    from orchestration.components.scaffold import examples as shipped

    written = result_of_files(shipped.write(out))
    inform(f"next: quadcosim run {out / 'examples' / 'water_tank' / 'system.toml'}")
    return written


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
