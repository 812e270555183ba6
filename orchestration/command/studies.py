"""The commands that run, export and draw studies."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.command import printed_tables
from orchestration.command.figure_flags import FigureFlags
from orchestration.command.options import option
from orchestration.command.printed_tables import TABLE
from orchestration.command.registry import CommandResult, build_option, option_group, result_of_files
from orchestration.command.study_flags import STORE, Dask, Out, StudyEngineFlag, TimeLimit, Workers
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import inform, progress_bar, warn

if TYPE_CHECKING:
    from orchestration.experiments.studies.study import Study

StudyFile = Annotated[Path, typer.Argument(help="Study file.", metavar="STUDY.toml")]

At = Annotated[
    list[str] | None, option("--at", "Only the cells at that value of an axis; may be repeated.", "NAME=VALUE")
]

Mean = Annotated[
    bool, option("--mean", "The mean of the metric over all runs that have it, not the median over the good ones.")
]


@build_option
def sweep(
    study: StudyFile,
    out: Out = None,
    workers: Workers = 1,
    dask: Dask = None,
    retry_failed: Annotated[bool, option("--retry-failed", "Repeat failed runs.")] = False,
    engine: StudyEngineFlag = "auto",
    time_limit: TimeLimit = None,
) -> CommandResult:
    """Run the missing runs of a study; it can be stopped and resumed at any time."""
    from orchestration.experiments.studies.study_file import load_study
    from orchestration.experiments.studies.sweep import sweep as run_missing
    from orchestration.simulation.workers.choice import engine_choice

    loaded = load_study(study)
    summary = run_missing(
        loaded, out=out, workers=workers, dask=dask, retry_failed=retry_failed,
        engine=engine_choice(engine), time_limit=time_limit,
    )  # fmt: skip
    failed = f", {summary.failed} failed (quadcosim export shows why; --retry-failed)" if summary.failed else ""
    lines = [f"{summary.path}: {summary.total} runs, {summary.flown} of them new{failed}"]
    if summary.agreement is not None:
        lines.append(f"engine {summary.engine}: {summary.agreement}")
    for each in summary.follows:
        inform(f"follows {each}")
    _tell_if_undecided(summary.study, summary.outcomes)
    keys = ("total", "flown", "failed", "path", "engine", "engines", "agreement", "follows", "infinite_means")
    document = {name: getattr(summary, name) for name in keys}
    return CommandResult(document=document, verdict=summary.verdict, lines=lines, good=not summary.failed)


def status(study: StudyFile, out: Out = None, store: Annotated[Path | None, STORE] = None) -> CommandResult:
    """Show the progress of a study, also while it runs in another process."""
    from orchestration.experiments.studies.missing_runs import AGREEMENT, ENGINE
    from orchestration.experiments.studies.store import note_on_engines, open_for_reading, store_folder, store_path
    from orchestration.experiments.studies.study_file import load_study
    from orchestration.experiments.studies.sweep import TOTAL, expect_current
    from orchestration.simulation.results.objectives import how_runs_ended
    from orchestration.simulation.workers.batching import LaneAgreement

    loaded = load_study(study)
    out = store_folder(loaded.name, store, out) or out
    path = store_path(loaded.name, out)
    with open_for_reading(path) as opened:
        expect_current(opened, loaded)
        about, counts, engines, outcomes = opened.about(), opened.counts(), opened.engines(), opened.outcomes()
        total = int(about.get(TOTAL, "0"))
    done, failed = counts.get("done", 0), counts.get("failed", 0)
    missing = total - done - failed
    agreement = LaneAgreement.from_text(about[AGREEMENT]) if about.get(AGREEMENT) else None
    then = f"; {_sweep_command(study, out)} runs them" if missing else ""
    lines = [f"{path}: {done + failed} of {total} runs, {failed} failed, {missing} missing{then}"]
    if agreement is not None:
        lines.append(f"engine {about[ENGINE]}: {agreement}")
    if note := note_on_engines(engines):
        lines.append(note)
    document = {"path": path, "total": total, "done": done, "failed": failed, "missing": missing}
    document |= {"engines": engines, "agreement": agreement}
    return CommandResult(document=document, verdict=how_runs_ended(outcomes, total), lines=lines)


def export(
    what: Annotated[Path, typer.Argument(help="Study file, or the directory of a run.", metavar="STUDY.toml|DIR")],
    out: Annotated[
        Path | None,
        option("--out", "Folder of the files; default: that of the store, or of the run.", "DIR"),
    ] = None,
    store: Annotated[Path | None, STORE] = None,
    formats: Annotated[
        list[str] | None,
        option("--format", "Default: parquet and csv of a study, csv of a run; may be repeated.", "csv|mat|parquet"),
    ] = None,
    table: Annotated[str | None, TABLE] = None,
    metric: Annotated[
        str | None, option("--metric", "Metric whose medians, means or shares in the cells are written too.")
    ] = None,
    at: At = None,
    mean: Mean = False,
) -> CommandResult:
    """Write the rows of a study, or the signals and events of a run, as CSV, MAT or Parquet, with their units."""
    from orchestration.experiments.studies.store import store_folder, store_path
    from orchestration.experiments.studies.study_file import load_study
    from orchestration.experiments.studies.table import of_run, of_study

    printed_tables.expect_format(table)
    if what.is_dir() and (table, metric, mean) != (None, None, False):
        raise UsageError(f"{what}: expected a study file with --table, --metric and --mean")
    if at and table is None:
        raise UsageError("--at: expected --table with it, which it is for; the files have all cells")
    if what.is_dir() and store is not None:
        raise UsageError(f"{what}: expected a study file with --store")
    if what.is_dir() and not store_path("", what).is_file():
        return result_of_files(of_run(what, out or what, formats or ()))
    if what.is_dir():
        return result_of_files(of_study(store_path("", what), formats or (), out=out))
    study = load_study(what)
    path = _current_store(what, store_folder(study.name, store, out), mean=mean)
    if table is None:
        return result_of_files(of_study(path, formats or (), study, metric, out=out, mean=mean))
    from orchestration.command.study_table import study_table
    from orchestration.experiments.studies.shares import GOOD

    printed = study_table(study, path, metric or GOOD, at or (), mean=mean)
    written = of_study(path, formats or (), study, metric, out=out, mean=mean)
    for file in written:
        inform(str(file))  # standard output is the table alone, for a file
    lines = list(printed_tables.lines(printed, table))
    return CommandResult(document=result_of_files(written).document, lines=lines)


@option_group("look", FigureFlags)
def draw(
    study: StudyFile,
    out: Annotated[Path | None, option("--out", "Folder of the figures; default: that of the store.", "DIR")] = None,
    store: Annotated[Path | None, STORE] = None,
    metric: Annotated[
        str | None, option("--metric", "Metric to draw; default: the first objective that varies.")
    ] = None,
    at: At = None,
    mean: Mean = False,
    *,
    look: FigureFlags,
) -> CommandResult:
    """Draw a study: a metric over one or two axes with the good region, or sensitivity bars."""
    with progress_bar("drawing") as progress:  # first, as importing matplotlib takes time
        from orchestration.experiments.studies.drawing import draw_study, expect_metric
        from orchestration.experiments.studies.store import store_folder
        from orchestration.experiments.studies.study_file import load_study

        loaded = load_study(study)
        expect_metric(loaded, metric)
        store = store_folder(loaded.name, store, out)
        _current_store(study, store, mean=mean)
        style = look.figure_style
        return result_of_files(draw_study(loaded, store, metric, style, progress, out=out, at=at or (), mean=mean))


def _sweep_command(study: Path, out: Path | None) -> str:
    """The command that runs what a store in that folder misses."""
    return f"quadcosim sweep {study}" + ("" if out is None else f" --out {out}")


def _current_store(study: Path, out: Path | None, *, mean: bool) -> Path:
    """The store of a study file that has not changed since its runs; warns if some are missing.

    Of a `mean` it says, too, which means of squares are not finite, as a sweep does at its end.
    """
    from orchestration.experiments.studies.infinite_means import INFINITE, InfiniteMeans
    from orchestration.experiments.studies.store import open_for_reading, store_path
    from orchestration.experiments.studies.study_file import load_study
    from orchestration.experiments.studies.sweep import expect_current
    from orchestration.experiments.studies.table import units_in

    loaded = load_study(study)
    path = store_path(loaded.name, out)
    with open_for_reading(path) as opened:
        expect_current(opened, loaded)
        there, total = sum(opened.counts().values()), len(loaded.points)
        outcomes, examined = opened.outcomes(), opened.about().get(INFINITE)
    if there < total:
        warn(f"{path}: {there} of {total} runs; the others are missing, {_sweep_command(study, out)} runs them")
    elif mean and not examined:
        warn(f"{path}: which means of squares are finite is not yet examined; {_sweep_command(study, out)} does")
    elif mean:
        InfiniteMeans.in_store(path, loaded).tell(loaded, units_in(path))
    _tell_if_undecided(loaded, outcomes)
    return path


def _tell_if_undecided(study: "Study", outcomes: Mapping[str | None, int]) -> None:
    from orchestration.simulation.results.objectives import undecided

    if note := undecided(study.origin, outcomes):
        inform(note)
