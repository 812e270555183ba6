"""The commands of `quadcosim` that fly many runs."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.basics.errors import UsageError
from orchestration.basics.terminal import inform, progress_bar
from orchestration.command import completion, exact
from orchestration.command import registry as registering
from orchestration.command.answer import Answer, of_files
from orchestration.command.build_flag import builds
from orchestration.command.figure_flags import FigureFlags
from orchestration.command.flags import FlightFlags, Timing, flies, request_from
from orchestration.command.limit_flags import TimeLimit
from orchestration.command.shared_flags import takes

if TYPE_CHECKING:
    from orchestration.studies.study import Study

StudyFile = Annotated[Path, typer.Argument(help="Study file.", metavar="STUDY.toml", show_default=False)]
Out = Annotated[Path | None, typer.Option("--out", help="Folder of the store; default: results/NAME.", metavar="DIR")]

FIRST = 1000
"""Runs of a study of which is looked at whether their averages mean anything"""

StudyEngineFlag = Annotated[
    str,
    typer.Option(
        "--engine",
        help="What flies; batch: native FMUs, several runs at once in a SIMD batch; cuda: the same on a GPU; "
        "auto: the fastest that can be had without one.",
        metavar="auto|python|compiled|batch|cuda",
        autocompletion=completion.among("auto", "python", "compiled", "batch", "cuda"),
    ),
]


@builds
def sweep(
    study: StudyFile,
    out: Out = None,
    workers: Annotated[int, typer.Option("--workers", help="Processes on this machine.", metavar="N")] = 1,
    dask: Annotated[
        str | None, typer.Option("--dask", help="A dask scheduler instead, e.g. tcp://host:8786.", metavar="URL")
    ] = None,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Repeat failed runs.")] = False,
    engine: StudyEngineFlag = "auto",
    time_limit: TimeLimit = None,
) -> Answer:
    """Run what is missing of a study; it may be stopped and started again at any time."""
    from orchestration.studies.study_file import load_study
    from orchestration.studies.sweep import sweep as fly
    from orchestration.workers.choice import engine_choice

    chosen = load_study(study)
    _say_if_endless(chosen)
    summary = fly(
        chosen, folder=out, workers=workers, dask=dask, retry_failed=retry_failed,
        engine=engine_choice(engine), time_limit=time_limit,
    )  # fmt: skip
    failed = f", {summary.failed} failed (quadcosim export shows why; --retry-failed)" if summary.failed else ""
    lines = [f"{summary.path}: {summary.total} runs, {summary.flown} flown now{failed}"]
    if summary.agreement is not None:
        lines.append(f"engine {summary.engine}: {summary.agreement}")
    for each in summary.follows:
        inform(f"follows {each}")
    told = ("total", "flown", "failed", "path", "engine", "agreement", "follows")
    document = {name: getattr(summary, name) for name in told}
    return Answer(document=document, lines=lines, good=not summary.failed)


def _say_if_endless(study: "Study") -> None:
    """Before it is flown: what becomes of its files meanwhile changes nothing."""
    from orchestration.stability.known_loops import LOOPS

    if LOOPS.of(study.base.kind) is None:
        files = study.files()
        first = range(min(len(study.points), FIRST))
        exact.say_if_endless(study.base, [study.system(i, files.start_values_of(study.origin)) for i in first], files)


def status(study: StudyFile, out: Out = None) -> Answer:
    """Show the progress of a study, also while it runs in another process."""
    from orchestration.studies.store import open_for_reading, store_path
    from orchestration.studies.study_file import load_study
    from orchestration.studies.sweep import AGREEMENT, ENGINE, TOTAL, expect_current
    from orchestration.workers.batching import Agreement

    chosen = load_study(study)
    path = store_path(chosen.name, out)
    with open_for_reading(path) as opened:
        expect_current(opened, chosen)
        about, counts = opened.about(), opened.counts()
        total = int(about.get(TOTAL, "0"))
    done, failed = counts.get("done", 0), counts.get("failed", 0)
    missing = total - done - failed
    agreement = Agreement.from_text(about[AGREEMENT]) if AGREEMENT in about else None
    lines = [f"{path}: {done + failed} of {total} runs, {failed} failed, {missing} missing"]
    if agreement is not None:
        lines.append(f"engine {about[ENGINE]}: {agreement}")
    numbers = {"total": total, "done": done, "failed": failed, "missing": missing}
    return Answer(document={"path": path, **numbers, "agreement": agreement}, lines=lines)


def export(
    what: Annotated[
        Path,
        typer.Argument(help="Study file, or the directory of a run.", metavar="STUDY.toml|DIR", show_default=False),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder of the study's store, default: results/NAME; of a run, of the files, default: DIR.",
            metavar="DIR", show_default=False,
        ),
    ] = None,
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--format", help="Default: parquet and csv of a study, csv of a run; may be repeated.",
            metavar="csv|mat|parquet", autocompletion=completion.among("csv", "mat", "parquet"), show_default=False,
        ),
    ] = None,
) -> Answer:  # fmt: skip
    """Write the rows of a study, or the signals and events of a run, as CSV, MAT or Parquet, with their units."""
    from orchestration.studies import exporting
    from orchestration.studies.store import store_path

    if what.is_dir() and not store_path("", what).is_file():
        return of_files(exporting.of_run(what, out or what, formats or ()))
    store = store_path("", what) if what.is_dir() else _current_store(what, out)
    return of_files(exporting.of_study(store, formats or ()))


@takes("look", FigureFlags)
def draw(
    study: StudyFile,
    out: Out = None,
    metric: Annotated[
        str | None, typer.Option("--metric", help="What to draw; default: the first objective that varies.")
    ] = None,
    *,
    look: FigureFlags,
) -> Answer:
    """Draw a study: a metric over one or two axes with what is good, or sensitivity bars."""
    with progress_bar("drawing") as progress:  # before what draws is loaded, which takes its time
        from orchestration.studies.drawing import draw_study, expect_metric
        from orchestration.studies.study_file import load_study

        chosen = load_study(study)
        expect_metric(chosen, metric)
        _current_store(study, out)
        return of_files(draw_study(chosen, out, metric, look.chosen, progress))


@builds
def tune(
    tuning: Annotated[
        Path, typer.Argument(help="What is tuned, and on what.", metavar="TUNING.toml", show_default=False)
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for the files of tuned parameters.", metavar="DIR")],
    workers: Annotated[int, typer.Option("--workers", help="Processes on this machine.", metavar="N")] = 1,
    engine: StudyEngineFlag = "auto",
) -> Answer:
    """Tune a controller on some initial conditions and judge it on others; it resumes where it was stopped."""
    from orchestration.tuning.tune import tune as search_all
    from orchestration.tuning.tuning_file import load_tuning
    from orchestration.workers.choice import engine_choice

    command = f"quadcosim tune {tuning} --out {out}" + (f" --engine {engine}" if engine != "auto" else "")
    found = search_all(load_tuning(tuning), out=out, workers=workers, engine=engine_choice(engine), command=command)
    return of_files(found.written)


@builds
@takes("look", FigureFlags)
def compare(
    comparison: Annotated[
        Path, typer.Argument(help="What is compared, on what.", metavar="COMPARISON.toml", show_default=False)
    ],
    out: Out = None,
    workers: Annotated[int, typer.Option("--workers", help="Processes on this machine.", metavar="N")] = 1,
    native: Annotated[
        bool, typer.Option("--native", help="The native twins of this project's FMUs, built if need be.")
    ] = False,
    engine: StudyEngineFlag = "auto",
    time_limit: TimeLimit = None,
    cell: Annotated[
        int | None,
        typer.Option("--cell", help="Run only this cell again.", metavar="K", show_default=False),
    ] = None,
    start: Annotated[
        int | None,
        typer.Option("--start", help="One run of that cell, kept in --out DIR.", metavar="I", show_default=False),
    ] = None,
    figures: Annotated[bool, typer.Option(help="Draw the pictures beside the tables.")] = True,
    *,
    look: FigureFlags,
) -> Answer:
    """Compare controllers from the same initial conditions: survival, settling, limits, error and effort."""
    from orchestration.command import comparison as command
    from orchestration.comparison.file import load_comparison
    from orchestration.workers.choice import engine_choice

    how = engine_choice(engine)
    chosen = dataclasses.replace(load_comparison(comparison), native=native)
    if time_limit is not None and (cell is not None or start is not None):
        raise UsageError("--time-limit: expected without --cell; it is of the runs of a whole comparison")
    if start is not None:
        return command.flight(chosen, cell, start, out, engine=how)
    if cell is not None:
        return command.cell(chosen, cell, out, workers=workers, engine=how)
    flags = (" --native" if native else "") + (f" --engine {engine}" if engine != "auto" else "")
    return command.all_cells(
        chosen, out, workers=workers, engine=how, time_limit=time_limit, figures=figures, look=look,
        again=f"quadcosim compare {comparison}{flags} --cell",
    )  # fmt: skip


@flies
def limit(
    scenario: Annotated[
        Path | None,
        typer.Argument(help="System or scenario file, or SSP; without one, the paper's flight.", show_default=False),
    ] = None,
    timing: Timing = None,
    of: Annotated[
        str | None,
        typer.Option(
            "--of",
            help="The quantity: of the quadrotor by name, of any system by path; default: the period of what is "
            "sampled.",
            metavar="period|delay|jitter|loss|PATH",
            autocompletion=completion.among("period", "delay", "jitter", "loss"),
            show_default=False,
        ),
    ] = None,
    first: Annotated[
        float | None, typer.Option("--from", help="Where the scan begins.", metavar="A", show_default=False)
    ] = None,
    last: Annotated[float | None, typer.Option("--to", help="Where it ends.", metavar="B", show_default=False)] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            help="Width of the last bracket; default of a PATH: a fiftieth of --scan.",
            show_default=False,
        ),
    ] = None,
    scan: Annotated[
        float | None,
        typer.Option(
            "--scan",
            help="Step of the scan upward; default of a PATH: a twentieth of the range.",
            metavar="STEP",
            show_default=False,
        ),
    ] = None,
    confidence: Annotated[
        float,
        typer.Option(
            "--confidence",
            help="With random effects: confidence (0 to 1) that at least nine runs in ten are good.",
        ),
    ] = 0.95,
    continuous: Annotated[
        bool, typer.Option("--continuous", help="Run near continuous time too (takes as long as ten runs at 1 ms).")
    ] = False,
    workers: Annotated[int, typer.Option("--workers", help="Processes for the seeds.", metavar="N")] = 1,
    engine: Annotated[
        str,
        typer.Option(
            "--engine",
            help="Simulation loop; auto: native twins of the FMUs where these can be had, compiled where possible.",
            metavar="auto|python|compiled",
            autocompletion=completion.among("auto", "python", "compiled"),
        ),
    ] = "auto",
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the figure; default: beside the file.", metavar="DIR")
    ] = None,
    figures: Annotated[bool, typer.Option(help="Draw what was measured, with both limits.")] = True,
    *,
    flags: FlightFlags,
) -> Answer:
    """Find the largest value that is still good (a period, delay, jitter, loss, any path), and the local limit."""
    from orchestration.engines.engine import engine_named
    from orchestration.limits import limit as limits

    how = "auto" if engine == "auto" else engine_named(engine, "auto")
    chosen = request_from(scenario, flags, timing)
    found = limits.find(
        chosen, of, first=first, last=last, tolerance=tolerance, scan=scan, confidence=confidence,
        continuous=continuous, workers=workers, engine=how or "auto", announce=inform,
    )  # fmt: skip
    where = out or (None if scenario is None else scenario.parent)
    if figures and where is not None:
        from orchestration.limits.figure import draw_limit

        for written in draw_limit(chosen, found, where):
            inform(str(written))
    return Answer(document=found, lines=[f"{name:<19}  {value}" for name, value in limits.as_text(found).items()])


def _current_store(study: Path, out: Path | None) -> Path:
    """The store of a study file that has not changed since it was flown."""
    from orchestration.studies.store import open_for_reading, store_path
    from orchestration.studies.study_file import load_study
    from orchestration.studies.sweep import expect_current

    chosen = load_study(study)
    path = store_path(chosen.name, out)
    with open_for_reading(path) as opened:
        expect_current(opened, chosen)
    return path


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    registering.add(app, registering.STUDY, limit, sweep, status, draw, export, compare, tune)
