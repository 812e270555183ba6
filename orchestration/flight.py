"""From a scenario to a result: instantiates the FMUs, lets the master fly them, computes the metrics."""

import importlib.metadata
import math
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmu_kit.trajectory import Trajectory
from orchestration import fmus, metrics, wiring
from orchestration.clock import Clock, random_streams
from orchestration.errors import UsageError, expected_name
from orchestration.fleet import Loader
from orchestration.fmpy_adapter import FmuSimulator
from orchestration.interrupt import Interrupt, Interrupted, interrupts_held_back
from orchestration.master import Master, Signals
from orchestration.nominal_model import mismatch
from orchestration.recording import InMemory, Recorder, Recording
from orchestration.reference import BuiltIn, FromFile, ReferencePath
from orchestration.result import Result, rows_of
from orchestration.scenario import FmuChoice, Parameter, Scenario
from orchestration.sensors import Sensors
from orchestration.timing import NANOSECONDS

Progress = Callable[[float], None]
"""Hears the share of the run that is done."""
Announce = Callable[[str], None]
"""Hears what is done before the run begins."""


def run(
    scenario: Scenario | None = None,
    *,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
) -> Result:
    """Fly a scenario, the paper's if none is given; divergence is a result, not an error.

    Its rows are kept in memory unless a `recorder` takes them.

    Raises `UsageError` for an FMU, variable or value that does not exist, `SimulatorError` if an FMU
    refuses a call for another reason than divergence, `FlightInterrupted` after Ctrl-C.
    """
    with prepared(scenario or Scenario(), announce, recorder=recorder) as flight:
        flight.master.initialise()
        flight.master.run(progress=progress)
        return flight.result()


class FlightInterrupted(Interrupted):
    """A flight has ended at the first instant after Ctrl-C, with this `result` so far."""

    def __init__(self, text: str, result: Result) -> None:
        super().__init__(text)
        self.result = result


@dataclass(frozen=True, kw_only=True)
class Flight:
    """A master over two FMUs that have their parameters, ready to initialise or to restore."""

    scenario: Scenario
    plant: FmuSimulator
    controller: FmuSimulator
    reference: ReferencePath
    master: Master
    recorder: Recorder
    interrupt: Interrupt
    started: float
    """on the performance counter [s]"""

    def result(self) -> Result:
        """What was recorded so far, with its metrics; raises `FlightInterrupted` with it if that is why it ended."""
        master, recording = self.master, self.recorder.finish()
        computed = metrics.compute(
            lambda: _spans(recording),
            hold=self.scenario.timing.hold,
            thrust_max=_parameter(self.plant, self.scenario.plant, wiring.THRUST_MAX, math.inf),
            torque_max=_parameter(self.plant, self.scenario.plant, wiring.TORQUE_MAX, math.inf),
        )
        diverged_at = None if master.divergence_time is None else master.divergence_time / NANOSECONDS
        end = float(master.board.row[0])
        horizon = end if diverged_at is None else self.scenario.stop_time
        interrupted_at = None if master.interrupted_at is None else master.interrupted_at / NANOSECONDS
        result = Result(
            scenario=self.scenario,
            recording=recording,
            metrics={
                **metrics.judged(computed, horizon=horizon, divergence_time=diverged_at),
                "diverged": diverged_at is not None,
                "divergence_time": diverged_at,
                "steps": master.steps,
            },
            divergence=master.divergence,
            interrupted_at=interrupted_at,
            provenance={**provenance(self.plant, self.controller), "wall_time": time.perf_counter() - self.started},
            warnings=(
                *self._mismatch(),
                *self.scenario.timing.warnings(self.scenario.stop_time),
                *self.plant.warnings,
                *self.controller.warnings,
            ),
        )
        if self.interrupt.requested:
            raise FlightInterrupted(f"at t = {end:g} s of {self.scenario.stop_time:g} s", result)
        return result

    def _mismatch(self) -> tuple[str, ...]:
        scenario = self.scenario
        if scenario.model_mismatch:
            return ()
        found = mismatch(_rigid_body(self.plant, scenario.plant), _rigid_body(self.controller, scenario.controller))
        return () if found is None else (found,)


def _spans(recording: Recording) -> Iterator[metrics.Span]:
    for chunk in recording.chunks(metrics.COLUMNS):
        t, events = chunk.rows[:, 0], chunk.events
        yield metrics.Span(
            signals=chunk.signals,
            desired=chunk.desired,
            measured=rows_of(t, events, "sampled") & ~rows_of(t, events, "lost", "measurement"),
            arrived=rows_of(t, events, "arrived"),
        )


@contextmanager
def prepared(
    scenario: Scenario,
    announce: Announce | None = None,
    *,
    load: Loader = FmuSimulator,
    recorder: Recorder | None = None,
) -> Iterator[Flight]:
    """Both FMUs of `scenario`, built if need be, instantiated by `load` and with their parameters.

    Ctrl-C ends the flight at its next instant.
    """
    started = time.perf_counter()
    recorder = InMemory() if recorder is None else recorder
    plant_path = fmus.locate(scenario.plant.fmu, announce)
    controller_path = fmus.locate(scenario.controller.fmu, announce)
    with (
        interrupts_held_back() as interrupt,
        load(plant_path, "plant") as plant,
        load(controller_path, "controller") as controller,
    ):
        for fmu in (plant, controller):
            _expect_interface(fmu)
        _set_parameters(plant, scenario.plant)
        _set_parameters(controller, scenario.controller)
        _set_clock(controller, scenario)
        reference = _reference(controller, scenario)
        streams = random_streams(scenario.seed)
        yield Flight(
            scenario=scenario,
            plant=plant,
            controller=controller,
            reference=reference,
            recorder=recorder,
            interrupt=interrupt,
            started=started,
            master=Master(
                plant,
                controller,
                clock=Clock(scenario.timing, scenario.stop_time, streams),
                timing=scenario.timing,
                sensors=Sensors(wiring.MEASUREMENT, scenario.timing, streams["noise"]),
                reference=reference,
                signals=Signals(
                    plant=_recorded(plant, scenario.record.plant),
                    controller=_recorded(controller, scenario.record.controller),
                ),
                recorder=recorder,
                interrupted=lambda: interrupt.requested,
            ),
        )


def provenance(plant: FmuSimulator, controller: FmuSimulator) -> dict[str, Any]:
    """What the numbers of a run came from: versions of the software and GUIDs of the FMUs."""
    packages = ("quadcosim", "numpy", "fmpy", "pythonfmu")
    return {
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in packages}},
        "platform": platform.platform(),
        "fmus": {
            fmu.name: {"model": fmu.description.modelName, "guid": fmu.description.guid, "path": str(fmu.path)}
            for fmu in (plant, controller)
        },
    }


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _expect_interface(fmu: FmuSimulator) -> None:
    """Raise `UsageError` naming what the FMU lacks to be that side of the loop."""
    missing = {
        causality: [name for name in names if name not in fmu.names(causality)]
        for causality, names in wiring.INTERFACE[fmu.name].items()
    }
    lacks = "; ".join(f"no {causality} {', '.join(names)}" for causality, names in missing.items() if names)
    if lacks:
        raise UsageError(f"{fmu.name}.fmu: {fmu.description.modelName} cannot be the {fmu.name}: it has {lacks}")


def _set_parameters(fmu: FmuSimulator, choice: FmuChoice) -> None:
    for name, value in choice.parameters.items():
        causality = fmu.variable(name).causality
        if causality not in ("parameter", "input") or name in wiring.MEASUREMENT + wiring.COMMAND:
            raise UsageError(f"{fmu.name}.{name}: expected a parameter or an input that nothing is connected to")
        fmu.set(name, value)


def _set_clock(controller: FmuSimulator, scenario: Scenario) -> None:
    """With the master's clock the controller samples at every step that it is given."""
    timing = scenario.timing
    by_fmu = timing.clock == "fmu"
    controller.set(wiring.SAMPLE_PERIOD, timing.period if by_fmu else 0.0)
    controller.set(wiring.SAMPLE_OFFSET, timing.offset if by_fmu else 0.0)


def _reference(controller: FmuSimulator, scenario: Scenario) -> ReferencePath:
    if scenario.reference.file is not None:
        controller.set(wiring.USE_REFERENCE_INPUTS, True)
        return FromFile(Path(scenario.reference.file), scenario.stop_time)
    if scenario.controller.parameters.get(wiring.USE_REFERENCE_INPUTS):
        raise UsageError(f"controller.{wiring.USE_REFERENCE_INPUTS}: expected [reference] file = … to feed them")
    values = {
        field: _parameter(controller, scenario.controller, name, None) for name, field in wiring.TRAJECTORY.items()
    }
    return BuiltIn(Trajectory(**values))


def _parameter(fmu: FmuSimulator, choice: FmuChoice, name: str, absent: Any) -> Any:
    """The value of a parameter in this run; `absent` if the FMU has none of that name."""
    if name not in fmu.variables and absent is not None:
        return absent
    value: Parameter = choice.parameters.get(name, float(fmu.variable(name).start))
    return float(value)


def _rigid_body(fmu: FmuSimulator, choice: FmuChoice) -> dict[str, float]:
    parameters = fmu.names("parameter")
    return {name: _parameter(fmu, choice, name, None) for name in wiring.RIGID_BODY if name in parameters}


def _recorded(fmu: FmuSimulator, chosen: tuple[str, ...] | None) -> tuple[str, ...]:
    """The Real variables to record of an FMU: those chosen, or all outputs and locals."""
    recordable = fmu.names("output", "local")
    for name in chosen or ():
        if name not in recordable:
            raise UsageError(f"record.{fmu.name}: {name} cannot be recorded; {expected_name(name, recordable)}")
    return recordable if chosen is None else chosen
