"""The commands of linear theory: tolerated delays and their variation, and the linearised loop."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.command.flags import FlightFlags, Timing, flight_options, request_from
from orchestration.command.loops import Cut
from orchestration.command.options import option
from orchestration.command.registry import CommandResult
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import in_columns, inform
from orchestration.foundation.basics.unit_algebra import counted, time_text

if TYPE_CHECKING:
    from orchestration.systems.system.request import Request
    from orchestration.theory.stability.state_space import StateSpace


@flight_options
def margin(
    scenario: Annotated[
        Path | None,
        typer.Argument(help="System or scenario file, or SSP; without one, the paper's flight, or with --check none."),
    ] = None,
    timing: Timing = None,
    of: Annotated[
        str | None,
        option(
            "--of",
            "The quantity that varies: the path of a delay_jitter, of a sampling.jitter, of a task's execution or "
            "jitter, or of a loss (here the longest run of losses). Default: the delays of the quadrotor's command, by "
            "bounds.",
            "PATH",
        ),
    ] = None,
    and_of: Annotated[
        str | None, option("--and", "With --of: a second quantity that varies; draws a region.", "PATH")
    ] = None,
    to: Annotated[
        float | None,
        option("--to", "With --of: the end of the range. Default: 8 losses, or what a draw may last.", "B"),
    ] = None,
    check: Annotated[
        Path | None, option("--check", "Verify a certificate, and with a file that it belongs to that loop.", "FILE")
    ] = None,
    out: Annotated[
        Path | None, option("--out", "File of the certificate; with --and the folder.", "CERTIFICATE")
    ] = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Find how late, and how irregular, messages and samples may be with the linear loop provably stable."""
    if of is None and (and_of is not None or to is not None or (check is None and out is not None)):
        flag = "--and" if and_of is not None else "--to" if to is not None else "--out"
        raise UsageError(f"{flag}: expected --of PATH beside it")
    if and_of is not None and to is not None:
        raise UsageError("--to: expected no --and beside it")
    if check is not None:
        if of is not None or out is not None:
            raise UsageError("--check: expected neither --of nor --out; the certificate has what varies")
        has_loop = scenario is not None or flags != FlightFlags()
        return _checked(check, request_from(scenario, flags, timing) if has_loop else None)
    request = request_from(scenario, flags, timing)
    if of is None:
        return _of_hover(request)
    return _certified(request, of, to, out) if and_of is None else _region(request, of, and_of, out)


def _certified(request: "Request", of: str, to: float | None, out: Path | None) -> CommandResult:
    from orchestration.theory.certificates.margin import margin as certify

    found = certify(request, of, last=to, progress="bar")
    written = None if out is None or found.certificate is None else found.save(out)
    document = dataclasses.asdict(found) | {"certificate": written}
    unit = "" if of.endswith("loss") else " s"
    sequence = "; ".join(" ".join([name, *(f"{x:.6g} s" for x in at)]) for name, at in found.breaking_sequence)
    shown = {
        "of": found.of,
        "certified": _number(found.certified, unit, ".9g"),
        "breaking": _number(found.breaking, unit),
        "breaking_sequence": sequence or "-",
        "searched": found.searched,
        "small_gain": _number(found.small_gain, unit),
        "states": found.states,
        "certificate": written or "-",
    }
    lines = [f"{name:<17}  {value}" for name, value in shown.items()]
    return CommandResult(document=document, verdict=found.verdict, lines=lines)


def _region(request: "Request", of: str, and_of: str, out: Path | None) -> CommandResult:
    from orchestration.theory.certificates.region import margin_region

    found = margin_region(request, of, and_of, progress="bar")
    written = [] if out is None else found.save(out)
    for path in written:
        inform(str(path))
    document = dataclasses.asdict(found) | {"certificates": written}
    lines = [f"{of} and {and_of}", f"searched           {found.searched}"]
    lines += [f"certified          {a:.9g} s and {b:.9g} s" for a, b in found.certified]
    lines += [f"breaking           {a:.6g} s and {b:.6g} s" for a, b in found.breaking]
    return CommandResult(document=document, verdict=found.verdict, lines=lines)


def _checked(path: Path, request: "Request | None") -> CommandResult:
    from orchestration.theory.certificates.check_file import check_certificate

    found = check_certificate(path, request)
    parts = dict[tuple[str, int | None], list[tuple[tuple[float, float], ...]]]()
    for name, ranges in found.ranges.items():
        parts.setdefault((name.partition(", ")[0], found.runs[name]), []).append(ranges)
    lines = []
    for (name, run), each in parts.items():
        ends = [(min(low for low, _ in of), max(high for _, high in of)) for of in zip(*each)]
        values = " and ".join(f"{time_text(low)} to {time_text(high)}" for low, high in ends)
        values = values if len(each) == 1 else f"{len(each)} parts (each with --json) within {values}"
        often = "any number of times in a row" if run is None else f"at most {run} times in a row"
        lines.append(f"{name:<17}  {', '.join(filter(None, [values, often]))}")
    lines.append(f"{'radius':<17}  {found.radius:g} of the measured one")
    if not found.of:
        lines.append(f"{'loop':<17}  the matrices in the file; no system was given")
    return CommandResult(document=found, verdict=found.verdict, lines=lines)


def _of_hover(request: "Request") -> CommandResult:
    """The delays of the quadrotor about hover: constant ones exactly, varying ones by bounds."""
    from orchestration.components.fmi.foreign_calls import isolated_call
    from orchestration.quadrotor.flight.hover_limit import margin_of
    from orchestration.quadrotor.scenarios.scenario import Scenario
    from orchestration.systems.system.files import files_of
    from orchestration.systems.system.request import system_of
    from orchestration.theory.stability.known_loops import warned_of_timing

    if not isinstance(request, Scenario):
        raise UsageError(
            "margin: expected a scenario of the quadrotor, or --of PATH, as connections.NAME.delay_jitter; the margins "
            "of gain, phase and a constant delay are those of quadcosim bode"
        )
    files = files_of(system := system_of(request))
    with warned_of_timing(system, files):
        found = isolated_call(files.fmus.values(), margin_of, request)
    document, lines = dataclasses.asdict(found), []
    for name, value in ((name, value) for name, value in document.items() if name != "in_double"):  # the verdict has it
        shown = " ".join(f"{share:g}" for share in value) if isinstance(value, tuple) else value
        lines.append(f"{name:<17}  {f'{value:.6g} s' if isinstance(value, float) else '-' if value is None else shown}")
    return CommandResult(document=document, verdict=found.verdict, lines=lines)


def _number(value: float | None, unit: str, form: str = ".6g") -> str:
    return "-" if value is None else f"{value:{form}}{unit}"


@flight_options
def linearise(
    scenario: Annotated[
        Path | None, typer.Argument(help="System or scenario file, or SSP; without one, the paper's loop about hover.")
    ] = None,
    timing: Timing = None,
    component: Cut = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Linearise a loop about its operating point, from sample to sample: a component, and the rest of the loop.

    Poles are those of the closed loop, in the z-plane, but for those at 0; frequency and damping are of log(z) / dt.
    With --json A, B, C and D of both, and the names of their inputs and outputs.

    Of one FMU: A, B, C and D about its start, with the poles of A; in continuous time by model exchange, with --period
    from sample to sample by any interface.
    """
    if scenario is not None and scenario.suffix.lower() == ".fmu" and component is None:
        return _of_plant(request_from(scenario, dataclasses.replace(flags, period=None), timing), flags.period)
    from orchestration.theory.stability.linearise import linearise as linearised_loop
    from orchestration.theory.stability.poles import REAL, in_words, or_alias

    loop = linearised_loop(request_from(scenario, flags, timing), component)
    halves = {loop.name: loop.component, "rest": loop.rest}
    document = {
        "name": loop.name,
        "component": _matrices(loop.component),
        "rest": _matrices(loop.rest),
        "poles": [
            {"real": one.z.real, "imaginary": one.z.imag, "frequency": one.frequency, "damping": one.damping}
            for one in loop.poles
        ],
        "turn": loop.turn,
    }
    lines = [f"{name:<17}  {_summary(half, loop.samples)}" for name, half in halves.items()]
    rows = [("pole", "size", "frequency", "damping")]
    for pole in loop.poles:
        if pole.z.imag >= -REAL:
            damped = "-" if pole.damping is None else f"{pole.damping:.3f}"
            rows.append((in_words(pole.z), f"{abs(pole.z):.4f}", f"{pole.frequency:.4g} rad/s", damped))
    lines += in_columns(rows, right=True) if loop.poles else ()
    if loop.turn:
        lines.append(f"frequencies are these{or_alias(loop.turn)}: poles of several rates do not tell which")
    if len(loop.poles) < len(loop.component.A) + len(loop.rest.A):
        lines.append("poles at z = 0 are not listed: they are of what a period forgets")
    return CommandResult(document=document, verdict=loop.verdict, lines=lines)


def _of_plant(request: "Request", period: float | None) -> CommandResult:
    """The matrices of one FMU about its start, as tables, and its poles."""
    import numpy as np

    from orchestration.theory.stability.plant_at_start import plant_at_start

    plant = plant_at_start(request, period)
    lines = list[str]()
    for name, rows, columns in (
        ("A", plant.states, plant.states),
        ("B", plant.states, plant.inputs),
        ("C", plant.outputs, plant.states),
        ("D", plant.outputs, plant.inputs),
    ):
        if rows and columns:
            entries = [[f"{entry:.6g}" for entry in row] for row in getattr(plant, name).tolist()]
            table = [(name, *columns), *((row, *cells) for row, cells in zip(rows, entries))]
            lines += ["", *in_columns(table, right=True)]
    poles = np.linalg.eigvals(plant.A).astype(complex).tolist()
    lines += ["", f"poles  {', '.join(f'{pole:.4g}' for pole in poles)}"] if poles else []
    document = {
        **{name: getattr(plant, name).tolist() for name in "ABCD"}, "states": plant.states, "inputs": plant.inputs,
        "outputs": plant.outputs, "operating_point": plant.operating_point, "rates": plant.rates, "dt": plant.dt,
        "poles": [{"real": pole.real, "imaginary": pole.imag} for pole in poles],
    }  # fmt: skip
    return CommandResult(document=document, verdict=plant.verdict, lines=lines)


def _matrices(system: "StateSpace") -> dict[str, object]:
    """A system as a document."""
    matrices = {name: getattr(system, name).tolist() for name in "ABCD"}
    return {**matrices, "dt": system.dt, "inputs": system.inputs, "outputs": system.outputs}


def _summary(system: "StateSpace", samples: int) -> str:
    inputs, outputs = (
        ", ".join(name.removesuffix("[0]") if samples > 1 else name for name in names[: len(names) // samples])
        for names in (system.inputs, system.outputs)
    )
    each = "" if samples == 1 else f", each at {samples} samples"
    return f"{inputs} → {outputs}{each}; {counted(len(system.A), 'state')}, every {time_text(system.dt)}"
