"""The commands that compare controllers and tune them."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from orchestration.command.figure_flags import FigureFlags
from orchestration.command.options import option
from orchestration.command.registry import CommandResult, build_option, option_group, result_of_files
from orchestration.command.study_flags import Out, StudyEngineFlag, TimeLimit, Workers
from orchestration.foundation.basics.errors import UsageError


@build_option
@option_group("look", FigureFlags)
def compare(
    comparison: Annotated[Path, typer.Argument(help="Comparison file.", metavar="COMPARISON.toml")],
    out: Out = None,
    workers: Workers = 1,
    native: Annotated[
        bool, option("--native", "Use the native twins of this project's FMUs, built if need be.")
    ] = False,
    engine: StudyEngineFlag = "auto",
    time_limit: TimeLimit = None,
    cell: Annotated[int | None, option("--cell", "Run only this cell again.", "K")] = None,
    start: Annotated[int | None, option("--start", "One run of that cell, kept in --out DIR.", "I")] = None,
    figures: Annotated[bool, typer.Option(help="Draw the pictures beside the tables.")] = True,
    *,
    look: FigureFlags,
) -> CommandResult:
    """Compare controllers from the same initial conditions: survival, settling, limits, error and effort."""
    from orchestration.command import comparison as command
    from orchestration.experiments.comparison.file import load_comparison
    from orchestration.simulation.workers.choice import engine_choice

    how = engine_choice(engine)
    loaded = dataclasses.replace(load_comparison(comparison), native=native)
    if time_limit is not None and (cell is not None or start is not None):
        raise UsageError("--time-limit: expected no --cell; the limit is for whole comparisons")
    if start is not None:
        return command.flight(loaded, cell, start, out, engine=how, figures=figures)
    if cell is not None:
        return command.cell(loaded, cell, out, workers=workers, engine=how)
    flags = (" --native" if native else "") + (f" --engine {engine}" if engine != "auto" else "")
    return command.all_cells(
        loaded, out, workers=workers, engine=how, time_limit=time_limit, figures=figures, look=look,
        again=f"quadcosim compare {comparison}{flags} --cell",
    )  # fmt: skip


@build_option
def tune(
    tuning: Annotated[Path, typer.Argument(help="Tuning file.", metavar="TUNING.toml")],
    out: Annotated[Path, option("--out", "Folder for the files of tuned parameters.", "DIR")],
    workers: Workers = 1,
    engine: StudyEngineFlag = "auto",
) -> CommandResult:
    """Tune a controller on some initial conditions and evaluate it on others; it resumes where it was stopped."""
    from orchestration.experiments.tuning.tune import tune as search_all
    from orchestration.experiments.tuning.tuning_file import load_tuning
    from orchestration.simulation.workers.choice import engine_choice

    command = f"quadcosim tune {tuning} --out {out}" + (f" --engine {engine}" if engine != "auto" else "")
    tuned = search_all(load_tuning(tuning), out=out, workers=workers, engine=engine_choice(engine), command=command)
    return result_of_files(tuned.written)
