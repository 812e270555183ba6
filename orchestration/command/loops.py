"""The commands that draw a loop: over the frequency, after a step, and its poles over a quantity."""

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from orchestration.command.flags import FlightFlags, ScenarioFile, Timing, flight_options, request_from
from orchestration.command.options import option
from orchestration.command.registry import CommandResult
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import in_columns, inform
from orchestration.foundation.basics.unit_algebra import quantity

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Figures
    from orchestration.systems.system.request import Request

Cut = Annotated[
    str | None,
    option("--component", "Where the loop is cut open; default: the only component that is sampled.", "NAME"),
]
Folder = Annotated[Path | None, option("--out", "Folder for the figure.", "DIR")]


@flight_options
def bode(
    scenario: ScenarioFile = None,
    timing: Timing = None,
    component: Annotated[
        str | None,
        option("--component", "Whose loops are cut open; default: each that is sampled, the others closed.", "NAME"),
    ] = None,
    out: Folder = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Compute gain, phase and delay margins of each command's loop, sampled, held and delayed as it is; draw them.

    A negative phase margin belongs to a stable loop, too: one that a lead of the phase, and no lag, makes unstable.
    """
    from orchestration.theory.stability.frequency import bode as response_of

    found = response_of(request_from(scenario, flags, timing), component)
    parts = found.components
    if out is not None:
        _draw(found.plot(), out, next(iter(parts)) if len(parts) == 1 else "")
    rows = [("loop", "cut before", "gain margin", "phase margin", "delay margin", "crossover", "peak of sensitivity")]
    for loop in found.loops:
        phase, delay, crossover = loop.phase_margin, loop.delay_margin, loop.crossover
        rows.append(
            (
                loop.output,
                loop.input,
                ", ".join(f"{one.factor:.4g} ({20.0 * math.log10(one.factor):.3g} dB)" for one in loop.gain_margins)
                or "infinite",
                "infinite" if phase is None else f"{phase:.4g}°",
                "not known" if loop.delay_reason else "infinite" if delay is None else quantity(delay, "s"),
                "-" if crossover is None else f"{crossover:.4g} rad/s ({crossover / math.tau:.4g} Hz)",
                f"{loop.sensitivity_peak:.4g}",
            )
        )
    curves = [
        {
            "dt": one.dt,
            "outputs": one.outputs,
            "frequencies": one.frequencies.tolist(),
            "gains": abs(one.gains).tolist(),
            "phases": one.phases.tolist(),
        }
        for one in parts.values()
    ]
    document = {
        "stable": found.stable,
        "sensitivity_peak": found.sensitivity_peak,
        "loops": [dataclasses.asdict(loop) for loop in found.loops],
        **(
            curves[0]
            if len(curves) == 1
            else {"components": [{"component": name, **one} for name, one in zip(parts, curves)]}
        ),
    }
    lines = list(in_columns(rows, right=True)) if found.loops else []
    lines += [f"delay margin of {loop.output}: {loop.delay_reason}" for loop in found.loops if loop.delay_reason]
    return CommandResult(document=document, verdict=found.verdict, lines=lines)


@flight_options
def step(
    scenario: ScenarioFile = None,
    timing: Timing = None,
    to: Annotated[
        str | None,
        option("--to", "The source, or input, that steps by 1, the loop closed; with --of.", "SOURCE|COMPONENT.INPUT"),
    ] = None,
    of: Annotated[
        str | None, option("--of", "The output whose response to it is computed.", "COMPONENT.OUTPUT")
    ] = None,
    component: Cut = None,
    out: Folder = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Compute how an output follows a step of an input, the loop closed; draw it.

    Without --to and --of: how each command's loop takes back a step that is added to the command.
    """
    from orchestration.systems.system.connection import component_of
    from orchestration.theory.stability.step import step as response_of

    if to is not None or of is not None:
        if to is None or of is None or component is not None:
            raise UsageError("step: expected --to and --of together, without --component, which cuts the loop open")
        return _closed_loop_step(request_from(scenario, flags, timing), to, of, out)
    found = response_of(request_from(scenario, flags, timing), component)
    if out is not None:
        _draw(found.plot(), out, component_of(found.loops[0].output))
    rows = [("loop", "rise time", "undershoot", "overshoot", "settling time", "final value")]
    for loop in found.loops:
        rise = "-" if loop.rise_time is None else quantity(loop.rise_time, "s")
        under, over = ("-" if size is None else f"{size:.3g} %" for size in (loop.undershoot, loop.overshoot))
        rows.append((loop.output, rise, under, over, quantity(loop.settling_time, "s"), f"{loop.steady_state:.4g}"))
    slowest = dataclasses.asdict(found.slowest)
    document = {
        "dt": found.dt,
        **{name: slowest[name] for name in ("rise_time", "undershoot", "overshoot", "settling_time", "steady_state")},
        "loops": [dataclasses.asdict(loop) for loop in found.loops],
        "times": found.times.tolist(),
        "responses": found.responses.tolist(),
    }
    lines = list(in_columns(rows, right=True))
    return CommandResult(document=document, verdict=found.verdict, lines=lines)


def _closed_loop_step(request: "Request", to: str, of: str, out: Path | None) -> CommandResult:
    from orchestration.theory.stability.step_response import step_response

    found = step_response(request, to=to, of=of)
    if out is not None:
        _draw(found.plot(), out, f"{to}_{of}")
    sizes = {key: value for key, value in vars(found).items() if key not in ("is_held", "in_double")}
    document = {**sizes, "times": found.times.tolist(), "response": found.response.tolist()}
    return CommandResult(document=document, verdict=found.verdict, lines=[])


@flight_options
def locus(
    scenario: ScenarioFile = None,
    timing: Timing = None,
    of: Annotated[
        str | None,
        option("--of", "The quantity, as of limit; default: the period of what is sampled.", "period|delay|PATH"),
    ] = None,
    first: Annotated[float | None, option("--from", "Its lowest value.", "A")] = None,
    last: Annotated[float | None, option("--to", "Its highest value.", "B")] = None,
    count: Annotated[int | None, option("--count", "Values from the lowest to the highest; default: 40.", "N")] = None,
    out: Folder = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Compute the poles of the sampled loop over a quantity, and where they leave the unit circle; draw them."""
    from orchestration.theory.stability.root_locus import locus as locus_of

    found = locus_of(request_from(scenario, flags, timing), of, first=first, last=last, count=count)
    if out is not None:
        _draw(found.plot(), out, found.of)
    rows = [("crossing", "value", "accuracy", "pole")]
    for one in found.crossings:
        way = "leaves" if one.leaves else "returns"
        accuracy = "-" if one.accuracy is None else quantity(one.accuracy, found.unit, 2)
        rows.append((way, found.place_of(one).removeprefix("at "), accuracy, found.pole_of(one)))
    each = [[[pole.real, pole.imag] for pole in some if pole == pole] for some in found.poles.tolist()]
    crossings = [
        {
            "value": x.value,
            "until": x.until,
            "leaves": x.leaves,
            "real": x.z.real,
            "imaginary": x.z.imag,
            "frequency": x.frequency,
            "turn": x.turn,
            "accuracy": x.accuracy,
        }
        for x in found.crossings
    ]
    document = {
        "of": found.of, "unit": found.unit, "values": found.values.tolist(), "radius": found.radius.tolist(),
        "poles": each, "crossings": crossings, "without": list(found.without),
        "tried": found.tried, "moved": found.moved,
    }  # fmt: skip
    lines = list(in_columns(rows, right=True)) if found.crossings else []
    return CommandResult(document=document, verdict=found.verdict, lines=lines)


def _draw(figures: "Figures", out: Path, of: str) -> None:
    """Draw a figure in a file that is named by what it is of, so that one of another is not replaced."""
    for path in figures.save(out, of):
        inform(str(path))
