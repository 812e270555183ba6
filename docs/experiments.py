"""The experiments of `findings.md` that take thousands of flights, flown in batches."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from docs.batch import Flights, Outcomes, fly, fly_continuously
from fmu_kit.trajectory import Trajectory
from orchestration.studies import sensitivity
from orchestration.studies.axes import unit_points
from orchestration.studies.study import Study

Array = Any

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

CONTINUOUS_KAPPAS = (0.0, 0.5, 1.0, 2.0, *(round(2.9 + 0.01 * i, 2) for i in range(11)), 5.0, 15.0)
CONTINUOUS_STEP = 0.001
"""[s], of the integration; 5 ms is too long for kappa = 15"""

SAMPLES, DESIGNS = 1024, 4
"""base samples of a design of Sobol indices, and how many such designs"""
FEW, FEW_DESIGNS = 64, 16
"""likewise, for what fewer samples would have said"""


def random_starts() -> Array:
    """Initial positions [m], shape (sizes, directions, 3): the same directions from the path's start at each size."""
    directions = np.random.default_rng(DIRECTIONS_SEED).standard_normal((DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.array(list(Trajectory().position(0.0))) + np.array(SIZES)[:, None, None] * directions


def starts_flown(stop_time: float = 30.0) -> Array:
    """Whether each start flies: booleans of shape (cases, sizes, directions, periods)."""
    shape = (len(CASES), len(SIZES), DIRECTIONS, len(PERIODS))
    case, size, direction, period = (index.ravel() for index in np.indices(shape))
    kappas, lags = (np.array([entry[i] for entry in CASES]) for i in (1, 2))
    start = random_starts()[size, direction].T
    flown = fly(Flights(period=PERIODS[period], kappa=kappas[case], lag=lags[case], start=tuple(start)), stop_time)
    return flown.flies.reshape(shape)


def first_ends(flew: Array) -> Array:
    """For each start the last period before the first that does not fly [s]; 0: not even the first."""
    failed = np.concatenate([~flew, np.ones((*flew.shape[:-1], 1), bool)], axis=-1)
    return np.concatenate([[0.0], PERIODS])[failed.argmax(axis=-1)]


def continuous(stop_time: float = 30.0) -> Outcomes:
    """The paper's start in continuous time, for each of `CONTINUOUS_KAPPAS`."""
    return fly_continuously(Flights(kappa=np.array(CONTINUOUS_KAPPAS)), stop_time, CONTINUOUS_STEP)


def continuous_gains(factors: list[float]) -> dict[str, Outcomes]:
    """The paper's start in continuous time for each gain factor, with kappa = 1, scaled with the gains, and 0."""
    factor = np.array(factors)
    held = {"1": 0.0 * factor + 1.0, "scaled": factor, "0": 0.0 * factor}
    found = fly_continuously(
        Flights(gain_factor=np.tile(factor, 3), kappa=np.concatenate(list(held.values()))), step=0.0025
    )
    split = {name: np.split(values, 3) for name, values in vars(found).items()}
    return {name: Outcomes(**{key: parts[i] for key, parts in split.items()}) for i, name in enumerate(held)}


def some_flights(number: int) -> dict[str, Array]:
    """Flights as in all the experiments here, drawn at random: what a `Flights` takes."""
    generator = np.random.default_rng(2)
    start = random_starts()[generator.integers(0, len(SIZES), number), generator.integers(0, DIRECTIONS, number)]
    return {
        "period": generator.uniform(0.005, 0.1, number),
        "delay": generator.uniform(0.0, 0.02, number) * generator.integers(0, 2, number),
        "kappa": generator.uniform(0.0, 2.0, number),
        "gain_factor": generator.uniform(0.7, 1.4, number),
        "surface": generator.uniform(2.5, 7.5, number),
        "lag": generator.choice([0.0, 0.01], number),
        "start": tuple(start.T),
    }


@dataclass(frozen=True, kw_only=True)
class Design:
    """One design of Sobol indices, flown."""

    flies: float
    """share"""
    diverged: float
    """share"""
    outcome: tuple[sensitivity.Index, ...]
    """of whether a flight flies, 0 or 1"""
    rank: tuple[sensitivity.Index, ...]
    """of the rank of the ultimate bound, what has diverged last"""


def sobol_designs(study: Study, samples: int, seeds: range) -> list[Design]:
    """The indices of `study`, one design for each seed, all flown in one batch."""
    names = [axis.name for axis in study.axes]
    designs = [unit_points("saltelli", len(names), samples, seed) for seed in seeds]
    flown = fly(_flights(study, np.concatenate(designs)), study.base.stop_time)
    found = []
    for i, design in enumerate(designs):
        part = slice(i * len(design), (i + 1) * len(design))
        flies, diverged, bound = flown.flies[part], flown.diverged[part], flown.ultimate_bound[part]
        outcome = sensitivity.analyse("saltelli", names, design, flies.astype(float), "outcome")
        rank = sensitivity.analyse("saltelli", names, design, ranks(bound), "ultimate_bound")
        found.append(
            Design(flies=float(flies.mean()), diverged=float(diverged.mean()), outcome=tuple(outcome), rank=tuple(rank))
        )
    return found


def _flights(study: Study, shares: Array) -> Flights:
    low_high = {axis.name: axis for axis in study.axes}
    values = {
        name: np.array([axis.at(share) for share in column]) for (name, axis), column in zip(low_high.items(), shares.T)
    }
    values["kappa"] = values.pop("coupling")
    return Flights(**values)


def ranks(values: Array) -> Array:
    """Ranks from 0 to 1, equal values sharing theirs; what is missing comes last."""
    from scipy.stats import rankdata

    return (rankdata(np.where(np.isfinite(values), values, np.inf)) - 1.0) / (len(values) - 1)
