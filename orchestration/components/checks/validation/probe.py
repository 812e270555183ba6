"""Instances and runs of an FMU under validation."""

import functools
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from orchestration.components.checks.validation.excitation import (
    PLAIN,
    STEPS,
    UNEVEN,
    ExcitationPlan,
    inputs_at,
    moved,
)
from orchestration.components.checks.validation.fmu import Fmu, is_clocked
from orchestration.components.checks.validation.instance import Beat, CheckedInstance, Row, Value, instance_of
from orchestration.components.checks.validation.memory import in_use, other_contents
from orchestration.components.checks.validation.run_comparison import deviations, difference
from orchestration.components.fmi.read_description import Model, Variable
from orchestration.components.fmi.slaves import Message
from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.processes.family import own_clock

MIN_STEPS = 3
"""steps of a run of an FMU, however slow it is"""
SHARE = 0.02
"""Share of the time for an FMU that one run may take; a slow FMU gets fewer steps"""
MAX_WATCHED = 1000
"""variables that are compared between runs, of an FMU with more"""
LEAST_THIRD, LEAST_GROWTH = 10, 16
"""Steps of each third of a run, and bytes in each step, from which growth is told from what a library keeps"""


@dataclass(frozen=True, kw_only=True, slots=True)
class FirstRun:
    """The first run at start values."""

    steps: int
    is_complete: bool
    """whether it did all intended steps"""
    seconds: float
    messages: tuple[Message, ...]


@dataclass(frozen=True, eq=False)
class Probe:
    """An FMU and the folder that it is unpacked in."""

    fmu: Fmu
    model: Model
    """Model of the same file, as the master reads it"""
    folder: Path
    budget: float
    """Time for the whole validation [s]"""
    beat: Beat = lambda *_: None
    _numbers: Iterator[int] = field(default_factory=itertools.count)

    def instance(self) -> CheckedInstance:
        """A fresh instance with a unique name."""
        return instance_of(self.model, self.folder, f"{self.fmu.model_identifier} {next(self._numbers)}", self.beat)

    # -- time -----------------------------------------------------------------------------------------------

    @functools.cached_property
    def start(self) -> float:
        """Start time of the default experiment, in seconds."""
        return self.fmu.experiment.get("startTime", 0.0)

    @functools.cached_property
    def step(self) -> float:
        """Communication step of the default experiment, in seconds; if it has none, the internal step of the FMU.

        Without either a hundredth of the experiment, or 10 ms.
        """
        experiment = self.fmu.experiment
        share = (experiment.get("stopTime", self.start + 1.0) - self.start) / STEPS
        step = experiment.get("stepSize", float(getattr(self.fmu.interface, "fixedInternalStepSize", None) or share))
        return step if math.isfinite(step) and step > 0.0 else 0.01

    def points(self, plan: ExcitationPlan) -> list[tuple[float, float]]:
        """Communication point and step size of each step, up to the end of the default experiment.

        Times are not accumulated. No more steps than there is time for.
        """
        return self._points(plan)[: self.first.steps]

    def _points(self, plan: ExcitationPlan) -> list[tuple[float, float]]:
        shares = UNEVEN if plan.uneven else (1.0,)
        stop = self.fmu.experiment.get("stopTime", math.inf) + 1e-6 * self.step
        points: list[tuple[float, float]] = []
        for k in range(plan.steps):
            done = k // len(shares) * math.fsum(shares) + math.fsum(shares[: k % len(shares)])
            t, h = self.start + done * self.step, shares[k % len(shares)] * self.step
            if t + h <= stop or not points:
                points.append((t, h))
        return points

    # -- values ---------------------------------------------------------------------------------------------

    @functools.cached_property
    def elements(self) -> tuple[Variable, ...]:
        """All that has a value at any time: scalars and the elements of arrays, without clocked ones."""
        names = {v.name for v in self.fmu.variables if not is_clocked(v)}
        return tuple(v for v in self.model.variables.values() if v.whole in names)

    def elements_of(self, causality: str) -> tuple[Variable, ...]:
        """Scalars and elements of arrays of this causality."""
        return tuple(v for v in self.elements if v.causality == causality)

    @functools.cached_property
    def inputs(self) -> tuple[Variable, ...]:
        """All inputs."""
        return self.elements_of("input")

    @functools.cached_property
    def outputs(self) -> tuple[Variable, ...]:
        """All outputs."""
        return self.elements_of("output")

    @functools.cached_property
    def general_parameters(self) -> dict[str, Value]:
        """Real parameters a little away from their starts.

        At its defaults a model may leave out parts: a lag of time constant zero has no state to lose.
        """
        return {v.name: moved(v) for v in self.elements_of("parameter") if v.kind == "Real" and v.start}

    def inputs_at(self, k: int) -> dict[str, Value]:
        """As `excitation.inputs_at`."""
        return inputs_at(self.inputs, k)

    @functools.cached_property
    def watched(self) -> tuple[Variable, ...]:
        """Variables that are compared between runs: all, or of very many the outputs and some of the others."""
        every = self.elements
        if len(every) <= MAX_WATCHED or self.fmu.is_ours:
            return every
        some = every[:: math.ceil(len(every) / MAX_WATCHED)]
        return tuple({v.name: v for v in (*self.outputs[:MAX_WATCHED], *some)}.values())

    # -- runs -----------------------------------------------------------------------------------------------

    @functools.cached_property
    def first(self) -> FirstRun:
        """The first run, which determines the number of steps for the others; raises `SimulatorError`."""
        started = own_clock()
        points = self._points(PLAIN)
        with self.instance() as instance:
            self.begin(instance, PLAIN)
            done, goes_on = 0, True
            for t, h in points:
                if done >= MIN_STEPS and own_clock() - started > SHARE * self.budget:
                    break
                goes_on = instance.advance(t, h)
                done += 1
                if not goes_on:
                    break
            instance.terminate()
            return FirstRun(
                steps=max(done, 1) if done < len(points) and goes_on else STEPS,
                is_complete=done == len(points) or not goes_on,
                seconds=own_clock() - started,
                messages=tuple(instance.messages),
            )

    def begin(self, instance: CheckedInstance, plan: ExcitationPlan) -> None:
        """Initialise an instance."""
        instance.start({**plan.parameters, **(self.inputs_at(0) if plan.moving else {})}, self.start)

    def run_steps(
        self, instance: CheckedInstance, plan: ExcitationPlan, first: int = 0, last: int | None = None
    ) -> list[Row]:
        """Do the steps `first` to before `last`; the watched variables after each of them."""
        rows = []
        for k, (t, h) in list(enumerate(self.points(plan)))[first:last]:
            for _ in range(plan.times_set if plan.moving else 0):
                instance.put(self.inputs_at(k))
            if not instance.advance(t, h):
                break
            rows.append(instance.row(self.watched))
        return rows

    def run(self, plan: ExcitationPlan) -> list[Row]:
        """A complete run of a fresh instance."""
        with self.instance() as instance:
            self.begin(instance, plan)
            return self.run_steps(instance, plan)

    @functools.cached_property
    def full_plan(self) -> ExcitationPlan:
        """Parameters near their starts, moving inputs, and uneven steps if the FMU declares that it takes them."""
        uneven = self.model.varies_step
        return ExcitationPlan(parameters=self.general_parameters, moving=True, uneven=uneven, steps=40)

    @functools.cached_property
    def _general_run(self) -> tuple[ExcitationPlan, list[Row]]:
        plan = self.full_plan
        at_starts = replace(plan, parameters={})
        for candidate in (plan, at_starts, replace(at_starts, uneven=False), replace(at_starts, moving=False)):
            try:
                return candidate, self.run(candidate)
            except SimulatorError:
                continue
        plain = ExcitationPlan(steps=plan.steps)
        return plain, self.run(plain)

    @property
    def general_plan(self) -> ExcitationPlan:
        """As much of `full_plan` as the FMU accepts; it need not accept all."""
        return self._general_run[0]

    @property
    def expected_rows(self) -> list[Row]:
        """The rows of a run of one instance by `general_plan`."""
        return self._general_run[1]

    @functools.cached_property
    def repeats(self) -> str | None:
        """The difference of an equal run of another fresh instance to the first; None if there is none."""
        return difference(self.run(self.general_plan), self.expected_rows)

    @functools.cached_property
    def reads_unwritten(self) -> str | None:
        """The difference of a run in which fresh memory has other contents, of one that `repeats`."""
        with other_contents():
            return difference(self.run(self.general_plan), self.expected_rows)

    @functools.cached_property
    def growth(self) -> int:
        """The bytes by which the heap grows in a step at start values, time after time; 0: it does not."""
        points = self.points(PLAIN)
        third, marks = len(points) // 3, list[int]()
        with self.instance() as instance:
            self.begin(instance, PLAIN)
            for k, (t, h) in enumerate(points[: 3 * third], 1):
                if not instance.advance(t, h):
                    return 0
                if k % third == 0:
                    marks.append(in_use())
            said = len(instance.messages)
        growths = [(b - a) // third for a, b in itertools.pairwise(marks)]
        return 0 if said or third < LEAST_THIRD or min(growths) < LEAST_GROWTH else min(growths)

    def deviations(self, found: list[Row], expected: list[Row], text: str) -> Iterator[str]:
        """As `run_comparison.deviations`."""
        return deviations(found, expected, text, is_ours=self.fmu.is_ours)
