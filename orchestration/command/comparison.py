"""`quadcosim compare`: what it prints and where it ends."""

from pathlib import Path
from typing import Any

from orchestration.basics.errors import UsageError
from orchestration.basics.terminal import inform
from orchestration.command import comparison_text as terminal
from orchestration.command.answer import Answer
from orchestration.command.figure_flags import FigureFlags
from orchestration.comparison import run
from orchestration.comparison.design import Comparison
from orchestration.comparison.outcome import as_json as to_json
from orchestration.workers.choice import EngineChoice


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
) -> Answer:
    """Fly what is missing, and tell what all cells come to; `again` is the command for one of them."""
    style = look.chosen if figures else None
    found = run.compare(
        comparison, folder=out, workers=workers, engine=engine, time_limit=time_limit, figures=figures, style=style
    )
    summary = found.summary
    inform(f"{summary.path}: {summary.total} runs, {summary.flown} flown now; tables and pictures beside it")
    for each in summary.follows:
        inform(f"follows {each}")
    if summary.agreement is not None:
        inform(f"engine {summary.engine}: {summary.agreement}")
    inform(f"one cell again, by its number in cells.csv: {again} K")
    if summary.failed:
        inform(f"{summary.failed} runs failed: runs.csv shows why")
    content: dict[str, Any] = to_json(comparison, found.outcome, found.bandwidths)
    return Answer(
        document={**content, "follows": summary.follows, "files": found.written},
        lines=list(terminal.lines(comparison, found.outcome)),
        good=not summary.failed,
    )


def cell(comparison: Comparison, index: int, out: Path | None, *, workers: int, engine: EngineChoice) -> Answer:
    """Fly one cell again, and tell whether the store has the same."""
    (found,) = run.rerun_cells(comparison, [index], workers=workers, engine=engine)
    stored = run.stored_cell(comparison, index, out)
    same = None if stored is None else run.agree(stored, found)
    lines = list(terminal.cell_lines(comparison, found))
    if same is not None:
        lines.append(f"{'in the store':<22}  {'the same' if same else 'another result'}")
    return Answer(document={**found.row("value"), "same_as_stored": same}, lines=lines)


def flight(comparison: Comparison, index: int | None, start: int, out: Path | None, *, engine: EngineChoice) -> Answer:
    """Keep one flight of a cell; raises `UsageError` without a cell or a directory."""
    if index is None or out is None:
        raise UsageError("--start: expected --cell K, whose start it is, and --out DIR for the flight")
    run.flight(comparison, index, start, out, engine=engine)
    inform(f"results in {out}")
    return Answer(document={"directory": out}, lines=[])
