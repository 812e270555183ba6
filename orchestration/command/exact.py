"""The command `expect`, which needs no run."""

from typing import TYPE_CHECKING, Annotated

from orchestration.command.flags import AsSimulated, FlightFlags, ScenarioFile, Timing, flight_options, request_from
from orchestration.command.options import option
from orchestration.command.registry import CommandResult
from orchestration.foundation.basics.interrupt import Interrupted
from orchestration.foundation.basics.terminal import in_columns, inform, warn

if TYPE_CHECKING:
    from orchestration.systems.system.request import Request
    from orchestration.theory.exact.expect import Expected


@flight_options
def expect(
    scenario: ScenarioFile = None,
    timing: Timing = None,
    as_simulated: AsSimulated = False,
    horizon: Annotated[
        float | None, option("--horizon", "Means from the initial conditions to this time.", "SECONDS")
    ] = None,
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Compute exact expectations of mean-square objectives of the loop about its operating point, without a run."""
    from orchestration.theory.exact.expect import expect as expectations

    expected = expectations(request_from(scenario, flags, timing), as_simulated=as_simulated, horizon=horizon)
    return CommandResult(document=expected, verdict=expected.verdict, lines=_lines(expected))


def warn_if_means_are_infinite(request: "Request") -> None:
    """Warn, after a run, if averages over runs have no finite expectation."""
    from orchestration.systems.system.files import files_of
    from orchestration.systems.system.request import system_of
    from orchestration.theory.exact import mean_square

    system = system_of(request)
    try:
        (found,) = mean_square.mean_squares(request, [system], files_of(system))
    except KeyboardInterrupt:
        raise Interrupted("with the result printed, but means of squares not examined") from None
    if found.remark == mean_square.NO_EXPECTATION:
        warn(mean_square.infinite_means_in_words(mean_square.objectives_of_means(system), "", found.radius))
    if found.remark == mean_square.NOT_EXAMINED + mean_square.LONG_HYPERPERIOD:
        inform(f"means of squares {found.remark}")


def _lines(expected: "Expected") -> list[str]:
    fourth = expected.fourth_moment_radius
    texts = {
        **{name: "-" if value is None else expected.shown(value, 12) for name, value in expected.objectives.items()},
        "mean_square_radius": f"{expected.mean_square_radius:.12g} in {expected.period:g} s",
        "fourth_moment_radius": "-" if fourth is None else f"{fourth:.12g}",
        "accuracy": f"{expected.accuracy:.1g} of each",
        "method": expected.method,
    }
    warning = [f"warning: {expected.doubt}"] if expected.doubt else []
    lines = [*warning, *in_columns([*texts.items()])]
    if fourth is not None and expected.mean_square_radius < 1.0 <= fourth:
        lines.append("fourth moments are infinite: confidence intervals of mean squares over runs are meaningless here")
    names_by_reason: dict[str, list[str]] = {}
    for name, reason in expected.reasons.items():
        names_by_reason.setdefault(reason, []).append(name)
    return [*lines, *(f"no {', '.join(names)}: {reason}" for reason, names in names_by_reason.items())]
