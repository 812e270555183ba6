"""Fly several instances of both FMUs at once, each call from some thread; print what each flew, by way."""

import functools
import json
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

import fmpy

from tests.fmus.flights import FLIGHTS, STEPS
from tests.fmus.instance import Instance
from tests.fmus.process import in_a_copy

SWITCH_INTERVAL = 1e-5
"""[s]; Python's own 5 ms would let most calls run through."""

Rows = dict[str, list[list[str]]]


def in_new_threads(instances: dict[str, Instance]) -> Rows:
    """Every step from a thread that lives for this step only, those of all instances at once."""
    rows: Rows = {name: [] for name in instances}

    def step(name: str, k: int) -> None:
        rows[name] += FLIGHTS[flight_of(name)].fly(instances[name], k, k + 1)

    for k in range(STEPS):
        threads = [Thread(target=step, args=(name, k)) for name in instances]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return rows


def in_a_pool(instances: dict[str, Instance]) -> Rows:
    """Every step from whichever of a few threads is free, as libcosim does."""
    rows: Rows = {name: [] for name in instances}
    with ThreadPoolExecutor(3) as pool:
        for k in range(STEPS):
            steps = {
                name: pool.submit(FLIGHTS[flight_of(name)].fly, instance, k, k + 1)
                for name, instance in instances.items()
            }
            for name, done in steps.items():
                rows[name] += done.result()
    return rows


def each_in_its_own(instances: dict[str, Instance]) -> Rows:
    """A whole flight a thread, nobody waiting for the others."""
    with ThreadPoolExecutor(len(instances)) as pool:
        flights = {
            name: pool.submit(FLIGHTS[flight_of(name)].fly, instance, 0, STEPS) for name, instance in instances.items()
        }
        return {name: flight.result() for name, flight in flights.items()}


def flight_of(name: str) -> str:
    """An instance is named after its flight and a number."""
    return name.rpartition(" ")[0]


WAYS = (in_new_threads, in_a_pool, each_in_its_own)


def flown(fmus: dict[str, Path], way: Callable[[dict[str, Instance]], Rows]) -> Rows:
    with ExitStack() as stack:
        folders = {model: Path(stack.enter_context(TemporaryDirectory())) for model in fmus}
        for model, fmu in fmus.items():
            fmpy.extract(str(fmu), str(folders[model]))
        instances = {}
        for name, flight in FLIGHTS.items():  # the first two share a library, the third has its own
            for number, folder in enumerate([folders[flight.model], folders[flight.model], None]):
                instance = stack.enter_context(Instance(fmus[flight.model], unpacked=folder, anew=folder is None))
                flight.begin(instance)
                instances[f"{name} {number}"] = instance
        return way(instances)


def main(fmus: dict[str, Path]) -> dict[str, Rows]:
    """By each way, in processes that have loaded no other."""
    return {way.__name__: in_a_copy(functools.partial(flown, fmus, way)) for way in WAYS}


if __name__ == "__main__":
    sys.setswitchinterval(SWITCH_INTERVAL)
    plant, controller = map(Path, sys.argv[1:])
    print(json.dumps(main({"QuadrotorPlant": plant, "UnifiedController": controller})))
