"""Fail, then go on calling: again, free, reset. The native part of pythonfmu drops references twice there.

Prints what happened; a crash of this process is the failure that the test is about.
"""

import contextlib
import gc
import io
import json
import math
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import fmpy
from fmpy.fmi1 import FMICallException

from tests.fmus.instance import Instance

REPETITIONS = 60
FAILURE = int(sys.argv[3])
NAMES = {3: "[ERROR]", 4: "[FATAL]"}


def fails(call: Callable[[], object]) -> bool:
    """Whether the call ends with the status of a failure."""
    try:
        call()
    except FMICallException as error:
        return bool(error.status == FAILURE)
    return False


def diverge(instance: Instance) -> bool:
    """A failure of category `divergence`, in a step."""
    instance.initialise({})
    if instance.description.modelName == "QuadrotorPlant":
        instance.set({"external_force.x": 1.7e308})
        return fails(lambda: instance.step(0.0, 1.0))
    instance.set({"position.x": 1.0, "velocity.x": 1e200})
    return fails(lambda: instance.step(0.0, 0.01))


FIRST_FAILURES: tuple[Callable[[Instance], bool], ...] = (
    lambda instance: fails(lambda: instance.set({"mass": math.nan})),
    lambda instance: fails(lambda: instance.initialise({"mass": -1.0})),
    lambda instance: fails(lambda: instance.step(0.0, 0.01)),
    lambda instance: fails(lambda: instance.fmu.getReal([10_000])),
    diverge,
)

CALLS_AGAIN: tuple[Callable[[Instance], object], ...] = (
    lambda instance: instance.step(0.0, 0.01),
    lambda instance: instance.initialise({}),
    lambda instance: instance.set({"mass": math.nan}),
    lambda instance: instance.fmu.getReal([10_000]),
)


def flown(instance: Instance) -> list[str]:
    """A short flight from initialisation on."""
    instance.initialise({})
    instance.step(0.0, 0.01)
    return instance.everything()


def repetition(k: int, make: Callable[[], Instance], expected: list[str]) -> tuple[bool, bool]:
    """One instance that fails, is called again, perhaps reset and flown, perhaps failing once more, and freed."""
    instance = make()
    failed = FIRST_FAILURES[k % len(FIRST_FAILURES)](instance)
    for call in CALLS_AGAIN[: k % 3 + 1]:
        failed &= fails(partial(call, instance))
        gc.collect()
    revived = True
    if k % 4:
        instance.fmu.reset()
        revived = flown(instance) == expected
    if k % 4 == 2:  # fail again after the reset
        failed &= fails(lambda: instance.step(0.0, -1.0))
    if k % 4 == 3:
        instance.fmu.reset()
        revived &= flown(instance) == expected
    instance.free()
    gc.collect()
    return failed, revived


def main(fmu: Path, logger: str) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(str(fmu), folder)

        def make() -> Instance:
            return Instance(fmu, unpacked=Path(folder), default_logger=logger == "default")

        with make() as untouched:
            expected = flown(untouched)
        results = [repetition(k, make, expected) for k in range(REPETITIONS)]
        with make() as after:
            results.append((True, flown(after) == expected))
    return {
        "repetitions": len(results) - 1,
        "failures as expected": all(failed for failed, _ in results),
        "revived as new": all(revived for _, revived in results),
    }


if __name__ == "__main__":
    log = io.StringIO()  # fmpy's default logger prints
    with contextlib.redirect_stdout(log):
        result = main(Path(sys.argv[1]), sys.argv[2])
    if sys.argv[2] == "default":
        assert NAMES[FAILURE] in log.getvalue()
    print(json.dumps(result))
