"""Random loops under random timing: the means of simulated runs compared with `expect --as-simulated`, loop by loop.

    python -m benchmarks.random_loops --count 30

Loops of one or two rates around an integrator or a servo, of the examples, with delays beyond a period, jitter, losses
in bursts, both holds and orders, and noise. For each with a fourth-moment radius below 0.95, a number of runs gives a
mean and its standard error; z is its distance from the expected value in standard errors.
"""

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.components.building import fmus
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.workers.many_runs import fly
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection, Source
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from orchestration.theory.exact.expect import Expected, expect

EXAMPLES = Path(__file__).parents[1] / "examples"
LARGEST_FOURTH = 0.95
STEPS = 8
"""Steps of a plant in a period"""
PERIODS = 500
"""Periods of a run"""
SETTLED = 0.3
"""fraction of a run that is left out, since runs begin at rest"""


def random_loop(number: int) -> System:
    """The random loop of this number."""
    draw = np.random.default_rng(number)
    return (integrator_of, servo_of)[int(draw.integers(2))](draw)


def integrator_of(draw: np.random.Generator) -> System:
    """x' = u + w, sampled once a second or by a filter at twice that rate before the law."""
    plant, law = (f"{EXAMPLES}/minimum_variance/{name}.fmu" for name in ("Integrator", "Feedback"))
    gain = float(draw.uniform(0.2, 0.8))
    components = {
        "plant": Component(fmu=plant, step=1.0 / STEPS),
        "law": Component(fmu=law, parameters={"gain": gain}, sampling=sampling(draw, 1.0)),
    }
    noise = {"x": float(draw.uniform(0.0, 0.3))}
    if draw.random() < 0.5:
        components["filter"] = Component(fmu=law, parameters={"gain": -1.0}, sampling=Sampling(period=0.5))
        components["law"] = dataclasses.replace(components["law"], sampling=Sampling(period=1.0))
        late = float(draw.integers(0, 12)) / STEPS
        connections: tuple[Connection, ...] = (
            Connection(name="measurement", start=("plant.x",), end=("filter.x",), noise=noise),
            Connection(name="between", start=("filter.u",), end=("law.x",), delay=late, stated=True, **losses(draw)),
            Connection(name="command", start=("law.u",), end=("plant.u",), **timing(draw, 1.0)),
        )
    else:
        connections = (
            Connection(name="measurement", start=("plant.x",), end=("law.x",), noise=noise, **losses(draw)),
            Connection(name="command", start=("law.u",), end=("plant.u",), **timing(draw, 1.0)),
        )
    return System(
        stop_time=float(PERIODS), components=components, connections=connections,
        sources={"noise": Source(noise=1.0, period=1.0 / STEPS, to=("plant.w",))},
        objectives={"variance": "mean(plant.x ** 2)", "cost": "mean(plant.x ** 2 + 0.3 * plant.u ** 2)"},
    )  # fmt: skip


def servo_of(draw: np.random.Generator) -> System:
    """The servo under PID, driven by measurement noise."""
    servo = load_system(EXAMPLES / "dc_servo/system.toml")
    period = 0.006
    law = dataclasses.replace(
        servo.components["controller"], sampling=sampling(draw, period),
        parameters={"K": float(draw.uniform(0.3, 0.9)), "Td": float(draw.uniform(0.03, 0.05))},
    )  # fmt: skip
    command = dataclasses.replace(
        servo.connections[1], **{"delay": 0.0, "delay_jitter": 0.0, "loss": 0.0, **timing(draw, period)}
    )
    return dataclasses.replace(
        servo, stop_time=PERIODS * period,
        components={
            "servo": dataclasses.replace(
                servo.components["servo"], step=period / STEPS, parameters={"initial.angle": 0.0}
            ),
            "controller": law,
        },
        connections=(
            dataclasses.replace(servo.connections[0], noise={"angle": 0.01}, **losses(draw)), command,
        ),
        objectives={"variance": "mean(servo.angle ** 2)", "cost": "rms(servo.angle + 0.05 * servo.speed)"},
        criterion=dataclasses.replace(servo.criterion, good=None, diverged=None),
    )  # fmt: skip


def sampling(draw: np.random.Generator, period: float) -> Sampling:
    """Sampling with or without jitter."""
    jitter = float(draw.choice([0.0, 0.3])) * period
    normal = draw.random() < 0.3
    return Sampling(period=period, jitter=jitter, jitter_distribution="normal" if normal else "uniform")


def timing(draw: np.random.Generator, period: float) -> dict[str, Any]:
    """Delays up to more than a period, with either order and either hold."""
    found: dict[str, Any] = {"delay": float(draw.choice([0.0, 0.2, 0.7, 1.1])) * period}
    found["delay_jitter"] = float(draw.choice([0.0, 0.25, 0.6])) * period
    found["jitter_distribution"] = str(draw.choice(["uniform", "normal"]))
    found["order"] = str(draw.choice(["gauss-seidel", "gauss-seidel", "jacobi"]))
    first = draw.random() < 0.15
    return found | ({"hold": "first"} if first else losses(draw))


def losses(draw: np.random.Generator) -> dict[str, Any]:
    """No losses, independent ones, or bursts."""
    kind = int(draw.integers(3))
    loss = float(draw.uniform(0.02, 0.2))
    return ({}, {"loss": loss}, {"loss": loss, "burst_length": float(draw.uniform(1.3, 3.0))})[kind]


def compare_means(system: System, found: Expected, runs: int) -> dict[str, tuple[float, float, float]]:
    """By objective: the mean over runs, its standard error, and the expected value."""
    later = f"(time > {SETTLED} * stop_time) / (1 - {SETTLED})"
    counted = {name: f"mean(({_averaged(text)}) * {later})" for name, text in system.objectives.items()}
    simulated = fly(
        fmus.native_twins(dataclasses.replace(system, objectives=counted)),
        {"seed": np.arange(runs)},
        outputs=list(found.objectives),
    )
    compared = {}
    for name, expected in found.objectives.items():
        values = simulated[name]
        assert expected is not None
        exact = expected**2 if "rms" in system.objectives[name] else expected
        compared[name] = float(values.mean()), float(values.std(ddof=1) / np.sqrt(runs)), exact
    return compared


def _averaged(objective: str) -> str:
    """The expression of which an objective is the mean."""
    inner = objective.partition("(")[2].removesuffix(")")
    return f"({inner}) ** 2" if objective.startswith("rms") else inner


def main() -> None:
    """Print a line for each."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--runs", type=int, default=128)
    options = parser.parse_args()
    number, done, worst = options.first, 0, 0.0
    while done < options.count:
        system = random_loop(number)
        number += 1
        try:
            found = expect(system, as_simulated=True)
        except UsageError as refusal:
            print(f"{number - 1:4} {refusal}", flush=True)
            continue
        if found.fourth_moment_radius is None or found.fourth_moment_radius >= LARGEST_FOURTH:
            continue
        done += 1
        for name, (mean, error, exact) in compare_means(system, found, options.runs).items():
            z = (mean - exact) / error
            worst = max(worst, abs(z))
            print(f"{number - 1:4} {name:<9} {mean:12.6g} ± {error:8.2g}  {exact:12.6g}  z {z:6.2f}", flush=True)
    print(f"farthest: {worst:.2f} standard errors")


if __name__ == "__main__":
    main()
