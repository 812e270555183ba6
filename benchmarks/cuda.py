"""The resources and the cost of flights on a GPU: `python -m benchmarks.cuda`; without a GPU only the former.

First the resources that NVRTC reports for the straight-line code of plant and law, with and without the numbers of the
paper's flight, and the time of compiling. Then wall time of the GPU, the smallest of several repetitions, from the
start of a kernel to its end; preparing the flights, on one core, is reported separately. The smaller number of flights
is also run in lanes: the results must be the same to the bit.
"""

import time
from collections.abc import Sequence

import numpy as np

from benchmarks.batch import CASES, X, systems
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.simulation.engines.batch.batch import Batch, BatchResult, Group
from orchestration.simulation.engines.cuda.compiler import image
from orchestration.simulation.engines.cuda.driver import Gpu
from orchestration.simulation.engines.cuda.fleet import Fleet, expect_gpu
from orchestration.simulation.engines.cuda.program import Code, line, program
from orchestration.systems.schedule.schedule_cache import ScheduleCache, schedule_key
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed

REPETITIONS = 3
COUNTS = (2**12, 2**15)
"""Flights at once"""
ARCHITECTURE = "sm_90"
"""whose registers are reported"""
STOP_TIME = 2.0
"""[s]"""


def groups(one: System, count: int, lanes: int) -> list[Group]:
    """The flight from `count` initial positions, in groups."""
    crowd = [changed(one, {X: place}) for place in np.linspace(0.0, 1.0, count).tolist()]
    some = (crowd[i : i + lanes] for i in range(0, count, lanes))
    return [Group(systems=each, timings=[schedule_key(system) for system in each]) for each in some]


def expect_same(by_threads: Sequence[BatchResult], in_lanes: Sequence[BatchResult]) -> None:
    """Raise `AssertionError` for objectives that differ in a bit."""
    for one, other in zip(by_threads, in_lanes, strict=True):
        assert one.outcome.tolist() == other.outcome.tolist()
        for call, values in other.reductions.items():
            assert one.reductions[call].tobytes() == values.tobytes(), call


def print_resources(architecture: str) -> None:
    """Print the resources of straight-line code on a processor."""
    shape, (one, *_) = systems(0.01, STOP_TIME)
    batch = Batch(shape, ScheduleCache())
    next(batch.stepwise(Group(systems=[one], timings=[schedule_key(one)])))
    codes = {name: Code.of(name, model) for name, model in shape.models.items()}
    numbers = {
        name: {place: float(memory[i, 0]) for place, i in code.constant.items()}
        for (name, code), memory in zip(codes.items(), batch.memories)
    }
    for name, code in codes.items():
        for what, known in (("with none", {}), (f"with {len(numbers[name])}", numbers[name])):
            found = image(line(code, known, shape.lanes), architecture).resources
            spilled = sum(each.spilled for each in found.values())
            print(
                f"{architecture}, {name} {what} of its numbers known: {found['line'].registers} registers, {spilled} "
                "bytes spilled"
            )
    begin = time.process_time()
    image(program(shape, codes, numbers), architecture)
    print(f"{architecture}, all of a flight: compiled in {time.process_time() - begin:.0f} s of CPU")


def main() -> None:
    """Print registers, then steps a second, by timing and number of flights."""
    try:
        print_resources(ARCHITECTURE)
    except QuadcosimError as error:
        print(error)
    try:
        expect_gpu()
    except QuadcosimError as error:
        print(f"not timed: {error}")
        return
    gpu = Gpu()
    print(f"{gpu.name}, {gpu.architecture}; the smallest of {REPETITIONS}")
    for case, (period, _) in CASES.items():
        shape, (one, *_) = systems(period, STOP_TIME)
        fleet = Fleet(shape, ScheduleCache(), gpu)
        for count in COUNTS:
            flights = groups(one, count, shape.lanes)
            found = [result for _, result in fleet.run(flights)]
            if count == COUNTS[0]:
                expect_same(found, [result for _, result in Batch(shape, ScheduleCache()).each(flights, None)])
            took = []
            for _ in range(REPETITIONS):
                begin, before = time.perf_counter(), gpu.busy
                fleet.run(flights)
                took.append((gpu.busy - before, time.perf_counter() - begin))
            kernel, whole = min(took)
            steps = sum(int(result.steps.sum()) for result in found)
            print(
                f"{case:<14} {count:6d} flights   {1e-6 * steps / kernel:8.1f} M steps/s   {kernel:6.3f} s, and "
                f"{whole - kernel:5.1f} s of a core to make them ready and to sum them up"
            )


if __name__ == "__main__":
    main()
