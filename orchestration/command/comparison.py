"""Runs `quadcosim compare` and prints its results."""

from pathlib import Path
from typing import Any

from orchestration.command import comparison_text as terminal
from orchestration.command.figure_flags import FigureFlags
from orchestration.command.registry import CommandResult
from orchestration.experiments.comparison import run
from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.outcome import as_json as to_json
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import inform
from orchestration.simulation.workers.choice import EngineChoice


def all_cells(
    comparison: Comparison,
    out: Path | None,
    *,
    workers: int,
    engine: EngineChoice,
    time_limit: float | None,
    figures: bool,
    look: FigureFlags,
    again: str,
) -> CommandResult:
    """Run what is missing, and print the results of all cells; `again` is the command for one of them."""
    style = look.figure_style if figures else None
    compared = run.compare(
        comparison, folder=out, workers=workers, engine=engine, time_limit=time_limit, figures=figures, style=style
    )
    summary = compared.summary
    inform(f"{summary.path}: {summary.total} runs, {summary.flown} of them new; tables and pictures beside it")
    for each in summary.follows:
        inform(f"follows {each}")
    if summary.agreement is not None:
        inform(f"engine {summary.engine}: {summary.agreement}")
    inform(f"to run one cell again, by its number in cells.csv: {again} K")
    if summary.failed:
        inform(f"{summary.failed} runs failed: runs.csv shows why")
    content: dict[str, Any] = to_json(comparison, compared.outcome, compared.bandwidths)
    return CommandResult(
        document={**content, "follows": summary.follows, "files": compared.written},
        lines=list(terminal.lines(comparison, compared.outcome)),
        good=not summary.failed,
    )


def cell(comparison: Comparison, index: int, out: Path | None, *, workers: int, engine: EngineChoice) -> CommandResult:
    """Run one cell again, and compare it with the store."""
    (rerun,) = run.rerun_cells(comparison, [index], workers=workers, engine=engine)
    stored = run.stored_cell(comparison, index, out)
    same = None if stored is None else run.agree(stored, rerun)
    lines = list(terminal.cell_lines(comparison, rerun))
    if same is not None:
        lines.append(f"{'in the store':<22}  {'the same' if same else 'a different result'}")
    return CommandResult(document={**rerun.row("value"), "same_as_stored": same}, lines=lines)


def flight(
    comparison: Comparison, index: int | None, start: int, out: Path | None, *, engine: EngineChoice, figures: bool
) -> CommandResult:
    """Keep one run of a cell; raises `UsageError` without a cell or a directory."""
    if index is None or out is None:
        raise UsageError("--start: expected --cell K, the cell of the run, and --out DIR for its files")
    run.flight(comparison, index, start, out, engine=engine, figures=figures)
    inform(f"results in {out}")
    return CommandResult(document={"directory": out}, lines=[])
