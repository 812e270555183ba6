"""The command `run`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from orchestration.command import exact, registry
from orchestration.command.command_result import CommandResult
from orchestration.command.flags import EngineFlag, FlightFlags, Timing, flight_options, request_from
from orchestration.command.limit_flags import ProcessFlags
from orchestration.command.option_group import option_group
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import inform, progress_bar, warn
from orchestration.foundation.basics.units import after

if TYPE_CHECKING:
    from orchestration.simulation.runs.result import Result


@option_group("process", ProcessFlags)
@flight_options
def run(
    scenario: Annotated[
        Path | None,
        typer.Argument(help="System or scenario file, or SSP; without one, the paper's flight.", show_default=False),
    ] = None,
    timing: Timing = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Directory for signals, events, metrics and figures.", metavar="DIR")
    ] = None,
    figures: Annotated[bool, typer.Option(help="Draw the figures into the directory.")] = True,
    pause_at: Annotated[
        float | None, typer.Option("--pause-at", help="Pause here; the state is saved in --out DIR.", metavar="SECONDS")
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            "--resume", help="Resume the run paused in DIR; the results are the same to the bit.", metavar="DIR"
        ),
    ] = None,
    engine: EngineFlag = None,
    *,
    flags: FlightFlags,
    process: ProcessFlags,
) -> CommandResult:
    """Run a scenario or a system and print its metrics. FMUs that are missing or out of date are built first."""
    from orchestration.simulation.engines.engine import engine_named
    from orchestration.simulation.runs.simulation import run as simulate  # modules for files are loaded only if needed

    if resume is not None and (scenario is not None or pause_at is not None or flags != FlightFlags()):
        raise UsageError("--resume: expected no scenario and no flags of the run; the paused run has its own")
    if pause_at is not None and out is None:
        raise UsageError("--pause-at: expected --out DIR for the state")
    with progress_bar("running") as progress:
        how: Any = {"progress": progress, "announce": inform, "engine": engine_named(engine), **vars(process)}
        if resume is not None:
            from orchestration.simulation.runs import pause

            result: Result | None = pause.resume(resume, out, figures=figures, **how)
        elif pause_at is not None and out is not None:
            from orchestration.simulation.runs import pause

            chosen = request_from(scenario, flags, timing)
            result = pause.run_until(chosen, pause_at, out, figures=figures, **how)
        elif out is not None:
            from orchestration.simulation.runs.run_directory import keep_run

            chosen = request_from(scenario, flags, timing)
            result = keep_run(out, lambda to: simulate(chosen, recorder=to, **how), figures=figures)
        else:
            result = simulate(request_from(scenario, flags, timing), **how)
    if result is None:
        inform(f"paused in {out}; resume with: quadcosim run --resume {out}")
        return CommandResult(document={"paused_in": out}, lines=[])
    for warning in result.warnings:
        warn(warning)
    exact.warn_if_means_are_infinite(result.request)
    if follows := result.provenance["follows"]:
        inform(f"follows {follows}")
    if out is not None:
        inform(f"results in {out}")
    elif not registry.output_options.as_json:
        inform("add --out DIR to keep the signals and the figures")
    return _metrics(result)


def _metrics(result: "Result") -> CommandResult:
    from orchestration.simulation.results.criterion import unmet

    found = {**result.metrics, "wall_time": result.provenance["wall_time"], "engine": result.provenance["engine"]}
    width, units = max(map(len, found)), {**result.units, "wall_time": "s"}
    lines = []
    for name, value in found.items():
        shown = f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)
        lines.append(f"{name:<{width}}  {shown}{'' if value is None else after(units.get(name))}")
    if result.divergence is not None:
        lines.append(f"diverged: {result.divergence}")
    if (missed := unmet(result.system, result.metrics, result.units)) is not None:
        inform(f"not good: {missed}")
    if result.termination is not None:
        lines.append(f"terminated: {result.termination}")
    return CommandResult(document=found, lines=lines)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    registry.add(app, registry.RUN, run)
