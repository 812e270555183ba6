"""Rules on interfaces beside the first that an FMU offers, on its clocks and partitions, and on FMUs of FMI 1.0."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.components.checks.validation.excitation import inputs_at
from orchestration.components.checks.validation.finding import Note
from orchestration.components.checks.validation.instance import Beat
from orchestration.components.checks.validation.probe import Probe
from orchestration.components.fmi.access import SCHEDULED, Access
from orchestration.components.fmi.adapted import adapted
from orchestration.components.fmi.fmi1 import Fmi1Instance
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.read_description import Model, declared_of, read_model
from orchestration.foundation.basics.errors import QuadcosimError, StoppedStepError, UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.processes.family import own_clock

STEPS = 20
"""steps of a run, or ticks of the clock of every sample"""
MIN_STEPS = 3
SHARE = 0.02
"""Share of the time for an FMU that one run may take"""


@dataclass(frozen=True, kw_only=True)
class Trials:
    """An FMU of any version, to be run as the master runs it."""

    path: Path
    start: float
    step: float
    """Start time and communication step of its experiment [s]"""
    budget: float
    """Time for the whole validation [s]"""
    beat: Beat

    def rows(self, model: Model) -> list[Floats]:
        """The numeric outputs after initialisation and after each step, while the inputs move."""
        kind: Any = Fmi1Instance if model.version == 1 else adapted(model)
        started = own_clock()
        with kind(self.path, model.name, model.access) as instance:
            outputs, rows = np.zeros(len(model.names("output"))), []
            inputs = [v for v in model.variables.values() if v.causality == "input" and v.kind == "Real"]
            given = np.zeros(len(inputs))
            read, write = (
                instance.reader(model.names("output"), outputs),
                instance.writer([v.name for v in inputs], given),
            )
            period = _begin(instance, self.step)
            read()
            for k in range(STEPS):
                rows.append(outputs.copy())
                if k >= MIN_STEPS and own_clock() - started > SHARE * self.budget:
                    break
                self.beat(self.start + k * period)
                given[:] = [float(value) for value in inputs_at(inputs, k).values()]
                write()
                try:
                    instance.step(k * period, period)
                except StoppedStepError as stopped:
                    if not stopped.ends:
                        raise
                    break
                read()
            return [*rows, outputs.copy()]


def _begin(instance: NativeInstance, step: float) -> float:
    """Initialise an instance; the length of its steps [s]."""
    period = step
    for clock in instance.model.ticking[:1]:
        period = float(clock.interval or step)
        instance.set_clock(period, float(clock.shift), late=False)
    instance.enter_initialization(0.0, math.inf)
    instance.exit_initialization()
    return period


def trials_of_fmi1(model: Model, budget: float, beat: Beat) -> Trials:
    """Those of an FMU of FMI 1.0 by its default experiment; without one for a second."""
    experiment = model.description.defaultExperiment
    start = float(getattr(experiment, "startTime", None) or 0.0)
    stop = float(getattr(experiment, "stopTime", None) or start + 1.0)
    step = (stop - start) / 100.0 if math.isfinite(stop) and stop > start else 0.01
    return Trials(path=model.path, start=start, step=step, budget=budget, beat=beat)


def interfaces(probe: Probe) -> Iterator[str]:
    """By each interface that it offers beside the first, it runs with finite outputs, and again with the same ones.

    In event mode its clocks tick; of scheduled execution each partition is tried alone.
    """
    trials = Trials(
        path=probe.model.path, start=probe.start, step=probe.step, budget=probe.budget,
        beat=probe.beat,
    )  # fmt: skip
    offered = [*declared_of(probe.fmu.description)]
    for interface in offered if offered == [SCHEDULED] else offered[1:]:
        try:
            clocks = [clock.name for clock in probe.model.clocks]
            if not clocks and interface == SCHEDULED:
                raise UsageError("it has no input clock")
        except UsageError as error:
            yield Note(f"{interface}: not tried: {_short(error, probe.model)}")
            continue
        for clock in clocks if interface == SCHEDULED else [None]:
            yield from _tried(trials, Access(interface=interface, clock=clock, start_time=trials.start))


def run_of_fmi1(trials: Trials) -> Iterator[str]:
    """An FMU of FMI 1.0 runs by co-simulation with finite outputs, and again with the same ones."""
    yield Note("FMI 1.0: its description was read, and it was run; no other rule was tried")
    yield from _tried(trials, Access(start_time=trials.start))


def _tried(trials: Trials, access: Access) -> Iterator[str]:
    """What two runs show."""
    where = " ".join(filter(None, (access.interface or "co-simulation", access.clock)))
    try:
        model = read_model(trials.path, access)
        one, other = trials.rows(model), trials.rows(model)
    except UsageError as error:
        yield Note(f"{where}: not tried: {_short(error, read_model(trials.path))}")
        return
    except QuadcosimError as error:
        yield f"{where}: {_short(error, read_model(trials.path))}"
        return
    names = model.names("output")
    for name, k in _first(names, [~np.isfinite(row) for row in one]):
        yield f"{where}: {name} = {one[k][names.index(name)]} {f'after step {k}' if k else 'after initialisation'}"
    for name, k in _first(names, [(a != b) & ~(np.isnan(a) & np.isnan(b)) for a, b in zip(one, other)]):
        at = names.index(name)
        yield f"{where}: {name} after step {k} is {other[k][at]}, not {one[k][at]} as in an equal run before"


def _first(names: Sequence[str], marked: Sequence[Any]) -> Iterator[tuple[str, int]]:
    """The outputs that are marked in any row, with the first of these rows."""
    table = np.array(marked).reshape(len(marked), len(names))
    for name, of in zip(names, table.T):
        if of.any():
            yield name, int(of.argmax())


def _short(error: QuadcosimError, model: Model) -> str:
    return str(error).removeprefix(f"{model.path}: ")


RULES = (interfaces,)
