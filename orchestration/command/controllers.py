"""The commands that compare controllers and tune them."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.command import printed_tables, verdicts
from orchestration.command.figure_flags import FigureFlags
from orchestration.command.flags import AsSimulated
from orchestration.command.options import option
from orchestration.command.printed_tables import TABLE
from orchestration.command.registry import CommandResult, build_option, option_group, result_of_files
from orchestration.command.study_flags import Dask, Out, StudyEngineFlag, TimeLimit, Workers
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import inform

if TYPE_CHECKING:
    from orchestration.experiments.comparison.cells import CellSummary
    from orchestration.experiments.comparison.design import Comparison
    from orchestration.experiments.comparison.run import Compared


@build_option
@option_group("look", FigureFlags)
def compare(
    comparison: Annotated[Path, typer.Argument(help="Comparison file.", metavar="COMPARISON.toml")],
    out: Out = None,
    workers: Workers = 1,
    dask: Dask = None,
    native: Annotated[
        bool, option("--native", "Use the native twins of this project's FMUs, built if need be.")
    ] = False,
    engine: StudyEngineFlag = "auto",
    time_limit: TimeLimit = None,
    cell: Annotated[int | None, option("--cell", "Run only this cell again.", "K")] = None,
    start: Annotated[int | None, option("--start", "One run of that cell, kept in --out DIR.", "I")] = None,
    table: Annotated[str | None, TABLE] = None,
    figures: Annotated[bool, typer.Option(help="Draw the pictures beside the tables.")] = True,
    *,
    look: FigureFlags,
) -> CommandResult:
    """Compare controllers from the same initial conditions: survival, settling, limits, error and effort."""
    from orchestration.experiments.comparison import run
    from orchestration.experiments.comparison.file import load_comparison
    from orchestration.simulation.workers.choice import engine_choice

    how = engine_choice(engine)
    printed_tables.expect_format(table)
    loaded = dataclasses.replace(load_comparison(comparison), native=native)
    if table is not None and cell is not None:
        raise UsageError("--table: expected no --cell; the table has all cells")
    if time_limit is not None and (cell is not None or start is not None):
        raise UsageError("--time-limit: expected no --cell; the limit is for whole comparisons")
    if start is not None:
        if cell is None or out is None:
            raise UsageError("--start: expected --cell K, the cell of the run, and --out DIR for its files")
        run.flight(loaded, cell, start, out, engine=how, figures=figures)
        inform(f"results in {out}")
        return CommandResult(document={"directory": out}, lines=[])
    if cell is not None:
        (rerun,) = run.rerun_cells(loaded, [cell], workers=workers, engine=how)
        return _cell(loaded, rerun, run.stored_cell(loaded, cell, out))
    figures = figures and table is None
    style = look.figure_style if figures else None
    compared = run.compare(
        loaded, out=out, workers=workers, dask=dask, engine=how, time_limit=time_limit, figures=figures, style=style
    )
    flags = (" --native" if native else "") + (f" --engine {engine}" if engine != "auto" else "")
    return _all_cells(loaded, compared, again=f"quadcosim compare {comparison}{flags} --cell K", table=table)


def _all_cells(comparison: "Comparison", compared: "Compared", again: str, table: str | None) -> CommandResult:
    """The results of all cells, as text or in the format of a `table`; `again` is the command for one of them."""
    from orchestration.command import comparison_tables
    from orchestration.command.comparison_tables import comparison_table
    from orchestration.experiments.comparison.outcome import as_json

    summary = compared.summary
    inform(f"{summary.path}: {summary.total} runs, {summary.flown} of them new; its files are beside it")
    for each in summary.follows:
        inform(f"follows {each}")
    if summary.agreement is not None:
        inform(f"engine {summary.engine}: {summary.agreement}")
    inform(f"to run one cell again, by its number in cells.csv: {again}")
    if summary.failed:
        inform(f"{summary.failed} runs failed: runs.csv shows why")
    content = as_json(comparison, compared.outcome, compared.bandwidths)
    document = {**content, "follows": summary.follows, "files": compared.written}
    verdict = compared.verdict
    if table is None:
        lines = list(comparison_tables.lines(comparison, compared.outcome))
        return CommandResult(document=document, verdict=verdict, lines=lines, good=not summary.failed)
    inform(verdict)  # standard output is the table alone, for a file
    lines = list(printed_tables.lines(comparison_table(comparison, compared.outcome), table))
    return CommandResult(document={"verdict": verdict, **document}, lines=lines, good=not summary.failed)


def _cell(comparison: "Comparison", rerun: "CellSummary", stored: "CellSummary | None") -> CommandResult:
    """The results of a cell that was run again, and whether the store has the same."""
    from orchestration.command import comparison_tables
    from orchestration.experiments.comparison.run import agree

    same = None if stored is None else agree(stored, rerun)
    lines = list(comparison_tables.cell_lines(comparison, rerun))
    if same is not None:
        lines.append(f"{'in the store':<22}  {'the same' if same else 'a different result'}")
    document = {**rerun.as_json(), "same_as_stored": same}
    return CommandResult(document=document, verdict=verdicts.of_cell(rerun), lines=lines)


@build_option
def tune(
    tuning: Annotated[Path, typer.Argument(help="Tuning file.", metavar="TUNING.toml")],
    out: Annotated[Path, option("--out", "Folder for the files of tuned parameters.", "DIR")],
    workers: Workers = 1,
    dask: Dask = None,
    engine: StudyEngineFlag = "auto",
    as_simulated: AsSimulated = False,
) -> CommandResult:
    """Tune a controller on some initial conditions and evaluate it on others; it resumes where it was stopped."""
    from orchestration.experiments.tuning.tune import tune as search_all
    from orchestration.experiments.tuning.tuning_file import load_tuning
    from orchestration.simulation.workers.choice import engine_choice

    command = f"quadcosim tune {tuning} --out {out}" + (f" --engine {engine}" if engine != "auto" else "")
    command += " --as-simulated" if as_simulated else ""
    tuned = search_all(
        load_tuning(tuning), out=out, workers=workers, dask=dask, engine=engine_choice(engine),
        as_simulated=as_simulated, command=command,
    )  # fmt: skip
    written = result_of_files(tuned.written)
    return dataclasses.replace(written, verdict=tuned.verdict)
