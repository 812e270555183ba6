"""Loops of which exact costs are known, from matrices."""

import math
from typing import Any

import numpy as np

from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System
from orchestration.theory.exact.effects import ContinuousEffects
from orchestration.theory.exact.moments import JumpLinear
from orchestration.theory.exact.objectives import Mean
from orchestration.theory.exact.timing import links_of, sampled_tasks
from orchestration.theory.exact.timing_chain import TimingChain
from orchestration.theory.stability.matrices import Components, Continuous, SampledSystem

GAIN = 3.0 - math.sqrt(3.0)


def integrator(
    *, nodes: int = 3, sampling: dict[str, Any] | None = None, measurement: dict[str, Any] | None = None, **command: Any
) -> JumpLinear:
    """x' = u + w under u = -GAIN x every second; its cost is x²."""
    system = System(
        stop_time=10.0,
        components={
            "plant": Component(fmu="plant.fmu", step=0.1),
            "law": Component(fmu="law.fmu", sampling=Sampling(**{"period": 1.0, **(sampling or {})})),
        },
        connections=(
            Connection(name="measurement", start=("plant.x",), end=("law.x",), **(measurement or {})),
            Connection(name="command", start=("law.u",), end=("plant.u",), **command),
        ),
    )
    empty = np.zeros((0, 0))
    components: Components = {
        "plant": Continuous(
            inputs=("u", "w"), outputs=("x",), A=np.zeros((1, 1)), B=np.ones((1, 2)), C=np.eye(1), D=np.zeros((1, 2))
        ),
        "law": SampledSystem(
            inputs=("x",), outputs=("u",), A=empty, B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.array([[-GAIN]])
        ),
    }
    return loop(system, components, {"plant.w": 1.0}, ("plant.x",), nodes)


SERVO_PERIOD = 0.006


def servo(*, nodes: int = 3, K: float = 1.5, Td: float = 0.035, **command: Any) -> JumpLinear:
    """1000/(s² + s) (u + w) under a PD controller with the last sample in it; its cost is y² + u²."""
    system = System(
        stop_time=1.0,
        components={
            "servo": Component(fmu="servo.fmu", step=0.001),
            "law": Component(fmu="law.fmu", sampling=Sampling(period=SERVO_PERIOD)),
        },
        connections=(
            Connection(name="measurement", start=("servo.y",), end=("law.y",)),
            Connection(name="command", start=("law.u",), end=("servo.u",), **command),
        ),
    )
    derivative = Td / SERVO_PERIOD
    components: Components = {
        "servo": Continuous(
            inputs=("u", "w"), outputs=("y",), A=np.array([[0.0, 1.0], [0.0, -1.0]]),
            B=np.array([[0.0, 0.0], [1000.0, 1000.0]]), C=np.array([[1.0, 0.0]]), D=np.zeros((1, 2)),
        ),
        "law": SampledSystem(
            inputs=("y",), outputs=("u",), A=np.zeros((1, 1)), B=np.eye(1), C=np.array([[K * derivative]]),
            D=np.array([[-K * (1.0 + derivative)]]),
        ),
    }  # fmt: skip
    return loop(system, components, {"servo.w": 1.0}, ("servo.y", "servo.u"), nodes)


def loop(
    system: System, components: Components, noise: dict[str, float], signals: tuple[str, ...], nodes: int
) -> JumpLinear:
    """Of which the cost is the sum of the squares of some signals."""
    tasks = sampled_tasks(system)
    effects = ContinuousEffects(system, components, [task.name for task in tasks], noise)
    count = len(signals)
    effects.charge([Mean(signals=signals, c=0.0, g=np.zeros(count), Q=np.eye(count))])
    return JumpLinear(*TimingChain(tasks, links_of(system), effects, order=nodes).stages())
