"""The ensembles of `findings/` that no study file holds, and what is concluded from what became of them."""

from typing import Any

import numpy as np

from fmu_kit.trajectory import Trajectory
from orchestration.basics.statistics import first_end
from orchestration.quadrotor.scenario import FmuChoice, Scenario
from orchestration.system.model import Parameter

Array = Any

PAPER = Scenario(
    controller=FmuChoice(fmu="native/UnifiedController"), plant=FmuChoice(fmu="native/QuadrotorPlant")
).with_changes(timing={"plant_interval": 0.005}, parameters={"plant.max_internal_step": 0.005})
"""The paper's flight, as in the study files, by native FMUs"""

SIZES = (1.0, 2.0, 3.0, 4.0, 5.0)
"""[m], of the initial position error"""
DIRECTIONS = 30
DIRECTIONS_SEED = 1
CASES = (
    ("κ = 1", 1.0, 0.0),
    ("κ = 0", 0.0, 0.0),
    ("κ = 1, lag of 10 ms", 1.0, 0.01),
    ("κ = 0, lag of 10 ms", 0.0, 0.01),
)
"""name, kappa, time constant of the actuators [s]"""
PERIODS = np.round(np.arange(2, 49) * 0.0025, 4)
"""[s], at which every start is flown"""
STARTS = (len(CASES), len(SIZES), DIRECTIONS, len(PERIODS))
"""How many of each make the flights of the random starts"""


def random_starts() -> Array:
    """Initial positions [m], shape (sizes, directions, 3): the same directions from the path's start at each size."""
    directions = np.random.default_rng(DIRECTIONS_SEED).standard_normal((DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.array(list(Trajectory().position(0.0))) + np.array(SIZES)[:, None, None] * directions


def flights_of_starts() -> list[Scenario]:
    """Every case from every start at every period, in the order of `STARTS`, the periods varying fastest."""
    starts = random_starts()
    return [flight_from(starts, *place) for place in np.ndindex(STARTS)]


def flight_from(starts: Array, case: int, size: int, direction: int, period: int) -> Scenario:
    """The flight of one case from one of `starts`, at one of `PERIODS`."""
    _, kappa, lag = CASES[case]
    return flight(period=PERIODS[period], kappa=kappa, lag=lag, start=starts[size, direction])


def first_ends(flew: Array) -> Array:
    """For each start the last period before the first that does not fly [s]; 0: not even the first.

    `flew` has the periods along its last axis.
    """
    return np.apply_along_axis(lambda one: first_end(PERIODS, one) or 0.0, -1, flew)


def some_flights(number: int) -> list[Scenario]:
    """Flights as in all the experiments of the page, drawn at random."""
    generator = np.random.default_rng(2)
    starts = random_starts()[generator.integers(0, len(SIZES), number), generator.integers(0, DIRECTIONS, number)]
    drawn = {
        "period": generator.uniform(0.005, 0.1, number),
        "delay": generator.uniform(0.0, 0.02, number) * generator.integers(0, 2, number),
        "kappa": generator.uniform(0.0, 2.0, number),
        "gain_factor": generator.uniform(0.7, 1.4, number),
        "surface": generator.uniform(2.5, 7.5, number),
        "lag": generator.choice([0.0, 0.01], number),
        "start": starts,
    }
    return [flight(**{name: values[i] for name, values in drawn.items()}) for i in range(number)]


def flight(
    *, period: float = 0.01, delay: float = 0.0, kappa: float = 1.0, gain_factor: float = 1.0,
    surface: float = 5.0, lag: float = 0.0, start: Array = (0.0, 0.0, 0.0), stop_time: float = 30.0,
) -> Scenario:  # fmt: skip
    """The paper's flight with other times [s], weight of the coupling, gains and initial position [m].

    The factor is on k_eta, k_theta and k_q; kappa is not scaled with them. `lag` is that of the actuators.
    """
    parameters: dict[str, Parameter] = {
        "controller.coupling": float(kappa),
        "controller.gain.surface": float(surface),
        **{f"controller.gain.{name}": 15.0 * float(gain_factor) for name in ("eta", "theta", "attitude")},
        **{f"plant.initial.position.{axis}": float(x) for axis, x in zip("xyz", start, strict=True)},
        "plant.actuator_time_constant": float(lag),
    }
    return PAPER.with_changes(
        timing={"period": float(period), "delay": float(delay)}, parameters=parameters, stop_time=stop_time
    )


def ranks(values: Array) -> Array:
    """Ranks from 0 to 1, equal values sharing theirs; what is missing comes last."""
    from scipy.stats import rankdata

    return (rankdata(np.where(np.isfinite(values), values, np.inf)) - 1.0) / (len(values) - 1)
