"""The commands that write files to begin with: a controller, a plant or a filter of one's own, or the examples."""

from pathlib import Path
from typing import Annotated, get_args

import typer

from orchestration.basics.errors import UsageError
from orchestration.basics.terminal import inform
from orchestration.command import registry as registering
from orchestration.command.answer import Answer, of_files
from orchestration.command.registry import FLY
from orchestration.scaffold import examples as shipped
from orchestration.scaffold.folder import Kind, git_author, write


def new(
    kind: Annotated[str, typer.Argument(help="What to write.", metavar="controller|plant|filter", show_default=False)],
    name: Annotated[str, typer.Argument(help="Of the folder and its FMU, as hover_pd.", show_default=False)],
    author: Annotated[
        str | None, typer.Option("--author", help="Author; default: git's user.name.", show_default=False)
    ] = None,
    license: Annotated[str, typer.Option("--license", help="Under which it is given to others.", metavar="TEXT")] = "",
) -> Answer:
    """Write a folder NAME here: a law in a few lines, its test, a system that flies it, a page of commands."""
    kinds = {each: each for each in get_args(Kind)}
    if kind not in kinds:
        raise UsageError(f"new {kind}: expected {', '.join(kinds)}")
    whose = git_author() if author is None else author
    written = write(kinds[kind], name, Path(), author=whose, license=license)
    if not whose:
        inform("the author is left open; it is the line author = in the class, or --author NAME")
    inform(f"next: quadcosim run {name}/system.toml")
    return of_files(written)


def examples(
    out: Annotated[Path, typer.Option("--out", help="Where the folders go.", metavar="DIR")] = Path(),
) -> Answer:
    """Write the folders examples, studies and gains here: the files that the pages' commands name."""
    written = of_files(shipped.write(out))
    inform(f"next: quadcosim run {out / 'examples' / 'water_tank' / 'system.toml'}")
    return written


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    registering.add(app, FLY, new, examples)
