"""The command `limit`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from orchestration.command.figure_flags import FigureFlags
from orchestration.command.flags import FlightFlags, ScenarioFile, Timing, flight_options, request_from
from orchestration.command.options import option
from orchestration.command.registry import CommandResult, option_group
from orchestration.foundation.basics.terminal import in_columns, inform


@option_group("look", FigureFlags)
@flight_options
def limit(
    scenario: ScenarioFile = None,
    timing: Timing = None,
    of: Annotated[
        str | None,
        option(
            "--of",
            "The quantity: of the quadrotor by name, of any system by path; default: the period of what is sampled.",
            "period|delay|jitter|loss|PATH",
        ),
    ] = None,
    first: Annotated[float | None, option("--from", "Lowest value.", "A")] = None,
    last: Annotated[float | None, option("--to", "Highest value.", "B")] = None,
    tolerance: Annotated[
        float | None,
        option(
            "--tolerance",
            "Width of the last bracket; default of a PATH: a fiftieth of --scan (of a period: a twentieth of it; "
            "over decades: 1 % of the value).",
        ),
    ] = None,
    scan: Annotated[
        float | None,
        option(
            "--scan",
            "Step of the scan; default of a PATH: a twentieth of the range (of a period: half of it; over "
            "decades: equal factors, of at most 1.6).",
            "STEP",
        ),
    ] = None,
    confidence: Annotated[
        float,
        option("--confidence", "With random effects: confidence (0 to 1) that at least nine runs in ten are good."),
    ] = 0.95,
    continuous: Annotated[
        bool, option("--continuous", "Also run near continuous time (takes as long as ten runs at 1 ms).")
    ] = False,
    workers: Annotated[int, option("--workers", "Processes for the seeds.", "N")] = 1,
    engine: Annotated[
        str,
        option(
            "--engine",
            "Simulation loop; auto: native twins of the FMUs where available, compiled where possible.",
            "auto|python|compiled",
        ),
    ] = "auto",
    out: Annotated[Path | None, option("--out", "Folder for the figure; default: beside the file.", "DIR")] = None,
    figures: Annotated[bool, typer.Option(help="Draw the measurements with both limits.")] = True,
    *,
    flags: FlightFlags,
    look: FigureFlags,
) -> CommandResult:
    """Find the largest good value of a period, delay, jitter, loss or any path by runs, and the local limit."""
    from orchestration.experiments.limits import limit_result
    from orchestration.experiments.limits.limit import limit as limit_of
    from orchestration.simulation.engines.master import engine_named

    how = "auto" if engine == "auto" else engine_named(engine, "auto")
    request = request_from(scenario, flags, timing)
    afterwards = None
    try:
        found = limit_of(
            request, of, first=first, last=last, tolerance=tolerance, scan=scan, confidence=confidence,
            continuous=continuous, workers=workers, engine=how or "auto",
        )  # fmt: skip
    except limit_result.LimitInterrupted as stop:
        found, afterwards = stop.result, partial(_raise, stop)
    where = out or (None if scenario is None else scenario.parent)
    if figures and where is not None:
        from orchestration.experiments.limits.figure import draw_limit

        for written in draw_limit(request, found, where, look.figure_style):
            inform(str(written))
    texts = limit_result.as_text(found)
    lines = [*in_columns([*texts.items()])]
    if shares := limit_result.shares_as_text(found):
        lines += ["", *in_columns(shares)]
    lines += [f"note: {text}" for text in found.notes]
    return CommandResult(document=found, verdict=found.verdict, lines=lines, afterwards=afterwards)


def _raise(stop: BaseException) -> None:
    raise stop
