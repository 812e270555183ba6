"""Steps of inputs of a closed loop about its operating point: what an output does."""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from orchestration.components.fmi.read_description import Model
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError, did_you_mean, listed
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import progress_bar
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.foundation.processes.passable import passable
from orchestration.simulation.requests.request import RequestLike
from orchestration.simulation.results.units import column_infos
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request, errors_in_own_terms
from orchestration.theory.stability.in_double import of_code
from orchestration.theory.stability.known_loops import rested
from orchestration.theory.stability.linearise import NEAR_ONE, in_isolation
from orchestration.theory.stability.loop_at_rest import ExtraSignals, whole_at_rest
from orchestration.theory.stability.period_map import StepMap, step_map
from orchestration.theory.stability.step import NOTHING, SETTLED, StepSizes, periods_until_left, sizes_of

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Figures

WITHIN = f"within {100.0 * SETTLED:.0f} %"


@passable
@dataclass(frozen=True, kw_only=True)
class StepResponse(StepSizes):
    """The deviation of an output from rest after a step of 1 of an input, the loop closed."""

    input: str
    """The input, or the source that feeds it."""
    input_unit: str | None
    """Its unit, as its FMU declares it."""
    output: str
    """The output, as COMPONENT.VARIABLE."""
    unit: str | None
    """Its unit, as its FMU declares it."""
    remaining_error: float | None
    """One less the final value, of an input in the unit of the output that moves it its own way; None: of any other."""
    peak: float
    """The value that is farthest from 0."""
    peak_time: float
    """Its time [s]."""
    times: Floats = field(repr=False)
    """Times after the step [s]: its own, and those at which something is exchanged; shape (n,)."""
    response: Floats = field(repr=False)
    """The deviation at them, shape (n,)."""
    is_held: bool
    """Whether the output is that of a sampled component, and stays from sample to sample."""
    in_double: tuple[str, ...] = ()
    """The components whose float code in C is taken in double precision."""

    def __repr__(self) -> str:
        return f"<StepResponse: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """What the output does after the step, and how long it takes."""
        step = f"a step of {quantity(1.0, self.input_unit)} of {self.input}"
        small = f" (small deviations{of_code(self.in_double)})"
        settled, peak = quantity(self.settling_time, "s"), quantity(self.peak, self.unit, 4)
        if not self.peak:
            return f"{step} does not move {self.output}{small}"
        if self.rise_time is None:
            at = quantity(self.peak_time, "s")
            return (
                f"{step} moves {self.output} by {peak} after {at}, and back: {WITHIN} of that from {settled} on, "
                f"final value 0{small}"
            )
        final = quantity(self.steady_state, self.unit, 4)
        sizes = f"rises in {quantity(self.rise_time, 's')}, {', '.join(self.shoots)}, settles {WITHIN} in"
        if self.remaining_error is None:
            return f"{step} moves {self.output} to {final}: {sizes} {settled}{small}"
        error = quantity(self.remaining_error, self.unit)
        return f"{self.output} follows {step}: {sizes} {settled}, remaining error {error}{small}"

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """The deviation over time; a notebook shows it.

        `style` sets its size and fonts. Raises `UsageError` for an unknown style.
        """
        from orchestration.simulation.figures.style import Figures, style_named
        from orchestration.theory.stability.loop_figures import response_figure

        chosen = style_named(style)
        with chosen.applied():
            return Figures({"step": response_figure(self, chosen)}, chosen)


def step_response(request: RequestLike, *, to: str, of: str) -> StepResponse:
    """What an output does after a step of 1 of an input, about the operating point, all loops closed.

    The loop is that of `linearise`, with all holds, delays and rates. `to`: a source, which feeds its inputs, or a
    Real input as COMPONENT.VARIABLE; to one that is connected 1 is added. `of`: a Real output, or a local variable, as
    COMPONENT.VARIABLE. At time 0 all rates meet, and the samples then see the step.

    Raises `UsageError` as `linearise`, for other names, and where the loop, or what is seen of it, does not settle.
    """
    return in_isolation(request, _found, (to, of))


def _found(request: Request, asked: tuple[str, str]) -> StepResponse:
    to, of = asked
    with errors_in_own_terms(request), closing(Instances()) as instances:
        system = rested(request)
        models = files_of(system).models_of(system)
        inputs = _inputs(system, models, to)
        _expect_output(models, of)
        extra = ExtraSignals(inputs=inputs, outputs=(of,))
        with progress_bar("linear models"), whole_at_rest(system, instances, extra, models=models) as loop:
            found, dt = step_map(loop, inputs, of), float(loop.period) / NANOSECONDS
            in_double = loop.in_double
    times, response, final = _response(found, dt, f"from {to} to {of}")
    farthest = int(np.abs(response).argmax())
    has_value = abs(final) > NOTHING * abs(response[farthest])
    sizes = sizes_of(times, response, final, has_value=has_value)
    units = {end: column_infos(system, models, [end])[end].unit for end in (inputs[0], of)}
    error = 1.0 - sizes.steady_state if sizes.steady_state > 0.0 and units[inputs[0]] == units[of] else None
    return StepResponse(
        input=to, input_unit=units[inputs[0]], output=of, unit=units[of], **vars(sizes),
        remaining_error=0.0 if error is not None and abs(error) < NOTHING else error,
        peak=float(response[farthest]), peak_time=float(times[farthest]), times=times, response=response,
        is_held=system.components[component_of(of)].sampling is not None, in_double=in_double,
    )  # fmt: skip


def _response(found: StepMap, dt: float, way: str) -> tuple[Floats, Floats, float]:
    """The times of rows [s], the output at them, and its final value, at the last row of a period."""
    radius = float(np.abs(np.linalg.eigvals(found.A)).max(initial=0.0))
    if radius > 1.0 - NEAR_ONE:
        raise UsageError(
            f"step: expected a loop that settles; {way} the spectral radius is {radius:.9g}, with what the output shows"
        )
    count, state = periods_until_left(radius, len(found.A), len(found.d)), found.x
    rows = np.zeros((count, len(found.d)))
    for k in range(count):
        rows[k] = found.C @ state + found.d
        state = found.A @ state + found.b
    final = found.C @ np.linalg.solve(np.eye(len(found.A)) - found.A, found.b) + found.d
    times = np.round(np.add.outer(dt * np.arange(count), found.times), 9)
    return np.append(0.0, times), np.append(found.y, rows), float(final[-1])


def _inputs(system: System, models: Mapping[str, Model], to: str) -> tuple[str, ...]:
    """The inputs that the name of a source, of one of its signals, or of an input means."""
    reals = set(_reals(models, "input"))
    sources = {name: one for name, one in system.sources.items() if one.to and reals.issuperset(one.to)}
    named = {name: one.to for name, one in sources.items() if one.constant is not None or len(one.to) == 1}
    several = {name: one for name, one in sources.items() if len(one.to) > 1}
    named |= {each: (end,) for name, one in several.items() for each, end in zip(one.signals(name), one.to)}
    named |= {end: (end,) for end in _reals(models, "input")}
    if to not in named:
        raise _unknown(f"{to}: no source and no Real input", to, [*named])
    return named[to]


def _expect_output(models: Mapping[str, Model], of: str) -> None:
    if of not in _reals(models, "output", "local"):
        raise _unknown(f"{of}: no Real output", of, _reals(models, "output"))


def _unknown(given: str, name: str, known: list[str]) -> UsageError:
    return UsageError(given + (did_you_mean(name, known, most=3) or f"; expected one of {listed(known)}"))


def _reals(models: Mapping[str, Model], *causalities: str) -> list[str]:
    return [
        f"{name}.{one.name}"
        for name, model in models.items()
        for one in model.variables.values()
        if one.kind == "Real" and one.causality in causalities and one.name not in model.for_solvers
    ]
