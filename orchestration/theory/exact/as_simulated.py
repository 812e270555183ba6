"""The effects of events in a simulated loop: held noise, steps of components, means over the rows of the run."""

from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.model import System
from orchestration.theory.exact.branch import Piece
from orchestration.theory.exact.effects import LoopEffects, Places
from orchestration.theory.exact.flows import Flows
from orchestration.theory.exact.objectives import Mean
from orchestration.theory.exact.random_times import ATTOSECONDS, RandomLink, SampledTask, exact_seconds
from orchestration.theory.stability.matrices import Continuous


class SimulatedEffects(LoopEffects):
    """The simulated loop: all components in continuous time are stepped to each instant."""

    holds_wires = True

    _means: Sequence[Mean] = ()

    @cached_property
    def noise(self) -> list[str]:
        """The sources of noise, each value of which is held for the period of its source."""
        return [name for name, source in self.system.sources.items() if source.noise]

    @cached_property
    def _flows(self) -> dict[str, Flows]:
        return {name: Flows(*_with_held_inputs(part)) for name, part in self.continuous.items() if part.unfit is None}

    @cached_property
    def _maps(self) -> dict[int, tuple[Floats, Floats]]:
        """Those of known durations."""
        return {}

    def _add_more_places(self, places: Places) -> None:
        for name, part in self.continuous.items():
            places.add("output", name, len(part.outputs))
        for name in self.noise:
            places.add("noise", name, len(self.system.sources[name].to))

    @property
    def grids(self) -> list[Fraction]:
        """The periods [s] of noise, in their order, followed by those of steps."""
        periods = [exact_seconds(self.system.sources[name].period or 0.0) for name in self.noise]
        return periods + sorted({exact_seconds(self.system.components[name].step or 0.0) for name in self.continuous})

    def charge(self, means: Sequence[Mean]) -> None:
        """As `LoopEffects`: by the trapezoidal rule from row to row, exactly where all signals are held."""
        self._means, self.costs = means, len(means)

    # -- rows over the state -------------------------------------------------------------------------------------

    def _continuous_output_row(self, name: str, j: int) -> Floats:
        return self.row("output", name, j)

    def _source_row(self, name: str) -> Floats:
        source = component_of(name)
        if source in self.noise:
            return self.row("noise", source, self.system.sources[source].signals(source).index(name))
        return super()._source_row(name)

    def input_row(self, end: str) -> Floats:
        """As `LoopEffects`, with noise."""
        for name in self.noise:
            if end in self.system.sources[name].to:
                return self.row("noise", name, self.system.sources[name].to.index(end))
        return super().input_row(end)

    def _is_held(self, signal: str) -> bool:
        """Whether a signal is constant or linear from row to row."""
        owner = component_of(signal)
        return owner in self.sampled_parts or signal in self.fed_by or owner in self.system.sources

    # -- events ---------------------------------------------------------------------------------------------------

    def advance(self, piece: Piece, duration: int) -> Piece:
        """As `LoopEffects`."""
        if duration not in self._maps:
            self._maps[duration] = self._step(duration / ATTOSECONDS)
        change, costs = self._maps[duration]
        whole = np.eye(len(piece.Z))
        whole[: self.size, : self.size] = change
        return piece.charged(costs).mapped(whole)

    def tick(self, piece: Piece, grid: int) -> Piece:
        """As `LoopEffects`: noise is drawn anew at its points."""
        if grid >= len(self.noise):
            return piece
        source, place = self.system.sources[self.noise[grid]], self.places("noise", self.noise[grid])
        change, covariance = np.eye(len(piece.Z)), np.zeros_like(piece.W)
        change[place] = 0.0
        variance = float(source.noise or 0.0) / float(source.period or 1.0)
        covariance[place, place] = variance * np.eye(len(source.to))
        return piece.mapped(change, covariance)

    def _step(self, h: float) -> tuple[Floats, Floats]:
        """The map of the state over a step of all components, and its costs."""
        now = np.eye(self.size)
        for name in self._plan.continuous:
            part = self.continuous[name]
            for wire in self._wires_into(name, ahead=True):
                now = self._transfer(now, wire)
            inputs = self.input_rows(name) @ now
            by_state, by_input = self._derivatives(name, part, h)
            moved = by_state @ now[self.places("state", name)] + by_input @ inputs
            now = now.copy()
            now[self.places("output", name)] = moved[: len(part.outputs)]
            now[self.places("state", name)] = moved[len(part.outputs) :]
        for x in self.system.connections:
            if x.hold == "first":
                now[self.places("received", x.name)] += h * now[self.places("slope", x.name)]
        costs = self._trapezoid(now, h)
        for name in self._plan.continuous:
            for wire in self._wires_into(name, ahead=False):
                now = self._transfer(now, wire)
        return now, costs

    def _derivatives(self, name: str, part: Continuous, h: float) -> tuple[Floats, Floats]:
        """Derivatives of the outputs and the state after a step, by the state before and by the inputs."""
        if part.unfit is not None:
            assert part.step is not None
            return part.step(h)
        flow, n = self._flows[name].over(h).matrix, len(part.A)
        after, moved = flow[:n, :n], flow[:n, n:]
        return np.vstack([part.C @ after, after]), np.vstack([part.C @ moved + part.D, moved])

    def _wires_into(self, name: str, *, ahead: bool) -> list[int]:
        """The wires into a component whose values are those after the step of their sender (`ahead`), or before it."""
        order, found = self._plan.continuous, []
        for i in self._plan.wires:
            x = self.system.connections[i]
            new = x.order == "gauss-seidel" and order.index(x.sender) < order.index(x.receiver)
            if x.receiver == name and new == ahead:
                found.append(i)
        return found

    def _transfer(self, now: Floats, wire: int) -> Floats:
        x = self.system.connections[wire]
        now = now.copy()
        now[self.places("received", x.name)] = self._message_rows(x) @ now
        return now

    def _trapezoid(self, after: Floats, h: float) -> Floats:
        found: Floats = np.zeros((self.costs, self.size, self.size))
        for k, mean in enumerate(self._means):
            starts = np.array([self.signal_row(name) for name in mean.signals])
            ends = np.array(
                [
                    start if name in self.fed_by and self.fed_by[name][0].name in self.wires else start @ after
                    for name, start in zip(mean.signals, starts)
                ]
            )
            if all(map(self._is_held, mean.signals)):
                middles = 0.5 * (starts + ends)
                points = ((starts, 1.0 / 6.0), (middles, 4.0 / 6.0), (ends, 1.0 / 6.0))
            else:
                points = ((starts, 0.5), (ends, 0.5))  # type: ignore[assignment]
            found[k] = sum(h * weight * self.quadratic_form(mean, rows) for rows, weight in points)
        return found


def _with_held_inputs(part: Continuous) -> tuple[Floats, Floats, Floats]:
    """The matrices of a component with its inputs as constant states."""
    n, m = part.B.shape
    F: Floats = np.zeros((n + m, n + m))
    F[:n, :n], F[:n, n:] = part.A, part.B
    return F, np.zeros_like(F), np.zeros((0, n + m, n + m))


def expect_rows(system: System, tasks: Sequence[SampledTask], links: Sequence[RandomLink]) -> None:
    """Raise `UsageError` for events between the steps of a component in continuous time."""
    continuous = [name for name, one in system.components.items() if one.sampling is None]
    steps = {exact_seconds(system.components[name].step or 0.0) for name in continuous}
    if len(steps) > 1:
        raise UsageError(f"--as-simulated: {', '.join(continuous)} have different steps: expected one step")
    if not steps:
        return
    (step,) = steps
    single = len(continuous) == 1
    plan = Plan(system)

    def on_grid_all(*times: Fraction) -> bool:
        return all(time % step == 0 for time in times)

    for i, task in enumerate(tasks):
        regular = on_grid_all(task.period, *task.offsets)
        on_grid = task.jitter.is_certain and regular
        measures = any(x.receiver == i and x.is_measured and not x.is_read_ahead for x in links)
        if not on_grid and not (single and measures):
            raise UsageError(
                f"--as-simulated: {task.name} samples between the steps of {', '.join(continuous)}, which are not all "
                "measured then"
            )
        if not task.jitter.is_certain and not regular:
            raise UsageError(f"--as-simulated: {task.name} has jitter, and is due between the steps of {continuous[0]}")
    for i, link in enumerate(links):
        if i in plan.wires:
            continue
        sender = tasks[link.sender] if link.sender is not None else None
        sends_on_grid = sender is None or (sender.jitter.is_certain and on_grid_all(sender.period, *sender.offsets))
        lateness = [Fraction(link.delay + each, ATTOSECONDS) for each in link.transit_times if each is not None]
        on_grid = sends_on_grid and link.delay_jitter.is_certain and on_grid_all(*link.send_offsets, *lateness)
        read_later = system.components[system.connections[i].receiver].sampling is not None and not link.is_measured
        if not on_grid and (not single or read_later):
            expected = "a step of which its delay is a multiple"
            if not link.delay_jitter.is_certain:
                expected = "no delay_jitter"
            elif not sends_on_grid:
                expected = "a sender without jitter, whose period and offset are multiples of a step"
            raise UsageError(
                f"--as-simulated: {link.name} arrives between the steps of {', '.join(continuous)}: expected "
                f"{expected}, or expect without --as-simulated"
            )
        if link.is_read_ahead and Fraction(link.longest_delay, ATTOSECONDS) % step:
            raise UsageError(
                f"--as-simulated: {link.name} is measured between the steps of {', '.join(continuous)}: "
                f"expected a delay of whole steps, of {float(step):g} s each"
            )
