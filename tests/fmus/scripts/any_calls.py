"""Call instances of an FMU at random, in and out of order; print how often that failed and whether reset revived.

Out of order, a call may fail, but the process must live, and a reset must give an FMU as new.
"""

import ctypes
import gc
import json
import math
import random
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import fmpy
from fmpy.fmi1 import FMICallException

from tests.extent import tries
from tests.fmus.instance import Instance

CALLS, MAX_INSTANCES = tries(2000, sampled=250), 4
VALUES = (0.0, 1.0, -1.0, 0.5, 1e200, 1e308, math.nan)
GARBAGE = (b"", b"{}", b"[]", b'{"model": 1, "reals": 3}', b'{"model": "QuadrotorPlant", "reals": []}')


def flown(instance: Instance) -> list[str]:
    """Every variable after a short flight."""
    instance.initialise({})
    instance.step(0.0, 0.01)
    return instance.everything()


class Caller:
    """Some instances of one FMU, the states taken of them, and what happened."""

    def __init__(self, make: Callable[[], Instance], seed: int) -> None:
        self.make, self.random = make, random.Random(seed)
        with make() as untouched:
            self.expected = flown(untouched)
        self.instances = [make()]
        self.states: list[ctypes.c_void_p] = []
        self.failures = self.revived = 0

    def call(self) -> None:
        """One call of one instance."""
        instance = self.random.choice(self.instances)
        try:
            self.random.choice(self.choices(instance))()
        except FMICallException:
            self.failures += 1

    def choices(self, instance: Instance) -> tuple[Callable[[], object], ...]:
        """What may be called."""
        fmu, choose, between = instance.fmu, self.random.choice, self.random.uniform
        name = choose(list(instance.variables))
        value = choose(VALUES) if instance.variables[name].type == "Real" else choose((0, 1))
        return (
            partial(fmu.setupExperiment, startTime=choose((0.0, 1.0, math.nan))),
            fmu.enterInitializationMode,
            fmu.exitInitializationMode,
            partial(instance.initialise, {}),
            partial(instance.step, between(0.0, 1.0), choose((0.01, 0.005, 1e-13, -1.0))),
            fmu.terminate,
            fmu.reset,
            partial(instance.set, {name: value}),
            partial(instance.set, {choose(instance.names("input")): between(-1.0, 1.0)}),
            partial(instance.value, name),
            instance.everything,
            partial(fmu.getReal, [choose((9999, 2**31 - 1, 2**32 - 1))]),
            partial(fmu.getString, [0]),
            partial(fmu.setDebugLogging, choose((True, False)), choose(((), ("divergence",), ("other", "logAll")))),
            lambda: self.states.append(fmu.getFMUstate()),
            lambda: self.states and fmu.setFMUstate(choose(self.states)),
            lambda: self.states and fmu.freeFMUstate(self.states.pop()),
            lambda: instance.restore(instance.save()),
            partial(instance.restore, choose(GARBAGE)),
            partial(self.free, instance),
            partial(self.revive, instance),
            gc.collect,
        )

    def free(self, instance: Instance) -> None:
        """Another takes its place, perhaps two."""
        self.instances.remove(instance)
        instance.free()
        while len(self.instances) < self.random.randint(1, MAX_INSTANCES):
            self.instances.append(self.make())

    def revive(self, instance: Instance) -> None:
        """Whatever happened before."""
        instance.fmu.reset()
        assert flown(instance) == self.expected
        self.revived += 1


def main(fmu: Path, seed: int) -> dict[str, int]:
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(str(fmu), folder)
        caller = Caller(lambda: Instance(fmu, unpacked=Path(folder)), seed)
        for _ in range(CALLS):
            caller.call()
        for instance in caller.instances:
            instance.free()
    return {"failures": caller.failures, "revived": caller.revived}


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), int(sys.argv[2]))))
