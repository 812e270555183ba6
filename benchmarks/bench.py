"""The cost of a step and of its parts: run as `make bench`. One process, one run, medians of several CPU times."""

import itertools
import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from controller_fmu.sliding_mode.law import Gains, evaluate
from controller_fmu.vehicle import Measurement, Model
from fmu_kit import packaging
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.bundle import Target
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import Body, RigidState, Wrench, derivative
from fmu_kit.trajectory import Trajectory
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.engines.wiring_by_index import Board
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.schedule.instant_arrays import Cursor
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.check import recorded_variables
from plant_fmu.wind import Wind

STEPS = 5000
REPETITIONS = 7
MILLISECOND = 1e-3
ATTITUDE = Quaternion.from_xyzw(0.1, 0.2, -0.1, 0.9).normalised()
MOTION = (Vec3(0.1, 0.2, 1.8), Vec3(0.5, 0.6, 0.1), ATTITUDE, Vec3(0.1, 0.2, 0.3))


def microseconds(work: Callable[[], object], count: int) -> float:
    """Median time of one of `count` units of `work` [µs]; the first repetition is a warm-up."""
    times = []
    for _ in range(REPETITIONS + 1):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times[1:]) / count * 1e6


def law() -> float:
    """One evaluation of the law on floats."""
    state = Measurement(*MOTION)
    reference, gains, model = Trajectory().at(0.5), Gains(), Model()

    def work() -> None:
        for _ in range(STEPS):
            evaluate(state, reference, gains, model)

    return microseconds(work, STEPS)


def plant() -> float:
    """One Runge-Kutta step of the plant."""
    state = RigidState(*MOTION)
    body, wind, wrench = Body(), Wind(), Wrench(9.0, Vec3(0.1, 0.2, 0.3))

    def f(t: float, x: RigidState) -> RigidState:
        return derivative(x, wrench, wind.force(t), body)

    def work() -> None:
        for i in range(STEPS):
            rk4_step(f, i * MILLISECOND, state, MILLISECOND)

    return microseconds(work, STEPS)


def loop(scenario: Scenario) -> float:
    """One closed-loop step of the master, recording included."""

    def work() -> float:
        with prepared(scenario) as flight:
            flight.master.initialise()
            start = time.process_time()
            flight.master.run()
            assert flight.master.running.steps == STEPS
            return time.process_time() - start

    work()
    return statistics.median(work() for _ in range(REPETITIONS)) / STEPS * 1e6


def bare(scenario: Scenario) -> float:
    """The same FMI calls as the master makes in a step, and nothing else."""
    system = scenario.as_system()
    paths = {name: Path(component.fmu) for name, component in system.components.items()}
    board = Board(system, recorded_variables(system, {name: read_model(path) for name, path in paths.items()}))
    with (
        Fmi2Instance(paths["plant"], "plant") as plant_fmu,
        Fmi2Instance(paths["controller"], "ctrl") as controller_fmu,
    ):
        received = np.zeros(len(wiring.MEASUREMENT))
        read_plant = plant_fmu.reader(board.outputs["plant"], outputs(board, "plant"))
        write_command = plant_fmu.writer(wiring.COMMAND, board.of([f"plant.{name}" for name in wiring.COMMAND]))
        read_controller = controller_fmu.reader(board.outputs["controller"], outputs(board, "controller"))
        write_measurement = controller_fmu.writer(wiring.MEASUREMENT, received)
        for fmu in (plant_fmu, controller_fmu):
            fmu.enter_initialization(0.0, math.inf)
            fmu.exit_initialization()
        step_plant, step_controller = plant_fmu.step, controller_fmu.step

        instants = itertools.count()

        def work() -> None:
            for i in itertools.islice(instants, STEPS):
                step_plant(i * MILLISECOND, MILLISECOND)
                read_plant()
                write_measurement()
                step_controller(i * MILLISECOND, MILLISECOND)
                read_controller()
                write_command()

        return microseconds(work, STEPS)


def outputs(board: Board, component: str) -> Floats:
    """The part of the row with the values read from a component."""
    return board.of([f"{component}.{name}" for name in board.outputs[component]])


def clock(timing: Timing) -> float:
    """One instant of the timing alone, without FMUs."""

    system = Scenario(timing=timing, stop_time=STEPS * MILLISECOND).as_system()

    def work() -> int:
        return sum(1 for _ in Cursor(Timetable(system, Streams(0, system.streams))).instants())

    return microseconds(work, work())


def main() -> None:
    """Print the figures and their ratios."""
    plain = Timing(period=MILLISECOND)
    # All causes that add no instants, so that the number of FMI calls stays the same.
    on = Timing(
        period=MILLISECOND, delay=MILLISECOND, measurement_loss=1e-9, command_loss=1e-9,
        noise={"position": 1e-9, "quaternion": 1e-9}, quantisation={"position": 1e-9}, clock_ratio=1.0,
    )  # fmt: skip
    irregular = Timing(period=MILLISECOND, delay=3e-4, delay_jitter=2e-4, jitter=2e-4, command_loss=0.05)
    with tempfile.TemporaryDirectory() as folder:
        for name in ("EmptyPlant", "EmptyController"):
            packaging.build(Target("benchmarks.empty", name), Path(folder))

        def empty(timing: Timing) -> Scenario:
            return Scenario(
                stop_time=STEPS * MILLISECOND,
                timing=timing,
                plant=FmuChoice(fmu=f"{folder}/EmptyPlant.fmu"),
                controller=FmuChoice(fmu=f"{folder}/EmptyController.fmu"),
            )

        law_us, plant_us = law(), plant()
        loop_us = loop(Scenario(stop_time=STEPS * MILLISECOND, timing=plain))
        floor_us, bare_us, on_us = loop(empty(plain)), bare(empty(plain)), loop(empty(on))
    clock_us, irregular_us = clock(plain), clock(irregular)
    rows = [
        ("law, called directly", law_us, "aim: under 40"),
        ("plant, one RK4 step, called directly", plant_us, "aim: under 30"),
        ("closed loop, FMUs through the master", loop_us, f"{1e6 / loop_us:.0f} steps/s"),
        ("same loop, empty slaves (floor)", floor_us, f"{1e6 / floor_us:.0f} steps/s, {floor_us / loop_us:.0%} of it"),
        ("same FMI calls on empty slaves, bare", bare_us, f"{bare_us / loop_us:.0%} of it"),
        ("the master's own cost", floor_us - bare_us, "aim: under 10"),
        ("law + plant as a share of the loop", law_us + plant_us, f"{(law_us + plant_us) / loop_us:.0%} of it"),
        ("delay, loss, noise, quantisation on", on_us - floor_us, "added to the floor a step; aim: under 5"),
        ("timing alone, one instant", clock_us, "within the master's own cost"),
        ("timing alone, jitter, delay, loss on", irregular_us, f"{irregular_us - clock_us:.2f} more; aim: under 5"),
    ]
    print(f"python {sys.version.split()[0]}, medians of {REPETITIONS} x {STEPS} steps of 1 ms, both FMUs at 1 kHz")
    for name, value, note in rows:
        print(f"{name:<40} {value:8.2f} µs   {note}")


if __name__ == "__main__":
    main()
