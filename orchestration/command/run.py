"""The command `run`."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from orchestration.command import exact, registry
from orchestration.command.flags import EngineFlag, FlightFlags, ScenarioFile, Timing, flight_options, request_from
from orchestration.command.one_fmu import OneFmuFlags
from orchestration.command.options import option
from orchestration.command.registry import CommandResult, expect_positive, option_group
from orchestration.command.study_flags import TimeLimit
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import inform, progress_bar, warn
from orchestration.foundation.basics.unit_algebra import after, some
from orchestration.foundation.processes.resource_limits import Limits

if TYPE_CHECKING:
    from orchestration.simulation.runs.result import Result
    from orchestration.systems.system.request import Request


@dataclass(frozen=True, kw_only=True)
class ProcessFlags:
    """The limits and the pace of a run; raises `UsageError` for values that are not positive."""

    in_process: Annotated[
        bool, option("--in-process", "Load foreign FMUs into this process: if one crashes, everything ends.")
    ] = False
    time_limit: TimeLimit = None
    memory_limit: Annotated[
        float, option("--memory-limit", "Memory of a run's process and its children (Linux).", "MB")
    ] = Limits.memory
    pace: Annotated[
        float | None, option("--pace", "Wait for each instant: 1 in real time, 2 twice as fast; never skips.", "R")
    ] = None

    def __post_init__(self) -> None:
        expect_positive("--pace", self.pace, "seconds in a second")
        expect_positive("--time-limit", self.time_limit, "seconds")
        expect_positive("--memory-limit", self.memory_limit, "MB")


@option_group("process", ProcessFlags)
@option_group("one_fmu", OneFmuFlags)
@flight_options
def run(
    scenario: ScenarioFile = None,
    timing: Timing = None,
    out: Annotated[Path | None, option("--out", "Directory for signals, events, metrics and figures.", "DIR")] = None,
    figures: Annotated[bool, typer.Option(help="Draw the figures into the directory.")] = True,
    pause_at: Annotated[
        float | None, option("--pause-at", "Pause here; the state is saved in --out DIR.", "SECONDS")
    ] = None,
    resume: Annotated[
        Path | None, option("--resume", "Resume the run paused in DIR; the results are the same to the bit.", "DIR")
    ] = None,
    engine: EngineFlag = None,
    *,
    flags: FlightFlags,
    one_fmu: OneFmuFlags,
    process: ProcessFlags,
) -> CommandResult:
    """Run a scenario, a system or one FMU and print its metrics. FMUs that are missing or old are built first."""
    from orchestration.simulation.engines.master import engine_named  # modules for runs are loaded only if needed

    if resume is not None and (scenario is not None or pause_at is not None or flags != FlightFlags()):
        raise UsageError("--resume: expected no scenario and no flags of the run; the paused run has its own")
    fmu = scenario if scenario is not None and timing is None and scenario.suffix.lower() == ".fmu" else None
    if fmu is None:
        one_fmu.expect_none()
    if pause_at is not None and out is None:
        raise UsageError("--pause-at: expected --out DIR for the state")
    with one_fmu.rows_kept(fmu), progress_bar("running") as progress:
        how: Any = {"progress": progress, "announce": inform, "engine": engine_named(engine), **vars(process)}
        result: Result | None
        if resume is not None:
            result = _resumed(resume, out, figures, how)
        else:
            chosen = request_from(scenario, flags, timing) if fmu is None else one_fmu.applied_to(fmu, flags)
            if out is None:
                result = _plain(chosen, how, keep_rows=one_fmu.output is not None)
            elif pause_at is None:
                result = _kept(chosen, out, figures, how)
            else:
                result = _paused(chosen, pause_at, out, figures, how)
    if result is None:
        inform(f"paused in {out}; resume with: quadcosim run --resume {out}")
        return CommandResult(document={"paused_in": out}, lines=[])
    for warning in result.warnings:
        warn(warning)
    if follows := result.provenance["follows"]:
        inform(f"follows {follows}")
    for loop in result.provenance.get("loops", ()):
        inform(f"loop {loop}")
    for where in result.provenance.get("events", ()):
        inform(f"events of {where}")
    if unseen := _events_between_rows(result):
        inform(unseen)
    if fmu is not None:
        one_fmu.write(fmu, result)
    if out is not None:
        inform(f"results in {out}")
    elif not one_fmu.output and not registry.output_options.as_json:
        inform("add --out DIR to keep the signals and the figures")
    return _metrics(result)


def _plain(chosen: "Request", how: Any, *, keep_rows: bool) -> "Result | None":
    """The result of a run without a directory; the rows are kept, or only what its metrics need of them."""
    from orchestration.simulation.results.objectives import OnlyUsed
    from orchestration.simulation.runs.simulation import simulate

    return simulate(chosen, recorder=None if keep_rows else OnlyUsed(chosen), **how)


def _kept(chosen: "Request", out: Path, figures: bool, how: Any) -> "Result | None":
    """The result of a run whose directory is `out`."""
    from orchestration.simulation.runs.run_directory import keep_run
    from orchestration.simulation.runs.simulation import simulate

    return keep_run(out, lambda to: simulate(chosen, recorder=to, **how), figures=figures)


def _paused(chosen: "Request", pause_at: float, out: Path, figures: bool, how: Any) -> "Result | None":
    """None for a run that is paused in `out`; the result of one that ends before."""
    from orchestration.simulation.runs import pause

    return pause.fly_until(chosen, pause_at, out, figures=figures, **how)


def _resumed(paused_in: Path, out: Path | None, figures: bool, how: Any) -> "Result":
    """The result of the run that was paused in a folder."""
    from orchestration.simulation.runs import pause

    return pause.resume(paused_in, out, figures=figures, **how)


def _events_between_rows(result: "Result") -> str | None:
    """A note about events within steps of components whose signals objectives use; None if there are none."""
    import numpy as np  # not needed for --help

    from orchestration.foundation.basics.times import instants_of
    from orchestration.systems.expressions.syntax import names, parse

    used = {name for text in result.system.objectives.values() for name in names(parse(text))}
    counts = dict[str, int]()
    for chunk in result.recording.chunks(("time",)):
        events, rows = chunk.events, instants_of(chunk.rows[:, 0])
        for what in events.names:
            of = events.table[events.are("event", what), 0]
            if any(each.startswith(f"{what}.") for each in used):
                counts[what] = counts.get(what, 0) + int((~np.isin(of, rows)).sum())
    texts = [f"{count} events within steps of {what}" for what, count in counts.items() if count]
    if not texts:
        return None
    return f"{some(texts)}: objectives are of the rows; a shorter step brings them nearer"


def _metrics(result: "Result") -> CommandResult:
    from orchestration.simulation.results.objectives import FIXED, PRINTED

    of_run: Any = result.provenance
    found = {**result.metrics, **{key: of_run[key] for key in PRINTED if key in of_run}}
    left_out = found if result.metrics["diverged"] else FIXED  # an objective without a value has one in other runs
    shown = {name: value for name, value in found.items() if value is not None or name not in left_out}
    width, units = max(map(len, shown)), {**result.units, "wall_time": "s", "largest_lateness": "s"}
    lines = []
    for name, value in shown.items():
        text = f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)
        lines.append(f"{name:<{width}}  {text}{'' if value is None else after(units.get(name))}")
    if result.system.computers or result.system.networks:
        found["missed_deadlines"] = result.missed_deadlines
    means = partial(exact.warn_if_means_are_infinite, result.request) if result.system.depends_on_seed else None
    return CommandResult(document=found, verdict=result.verdict, lines=lines, afterwards=means)
