"""Theory for the findings: the decay of errors, the limit of the period, tolerated delays, the cost of wind."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

import quadcosim
from fmu_kit.trajectory import Trajectory
from orchestration.experiments.studies.axes import Axis, LinkedSettings
from orchestration.experiments.studies.study import Study
from orchestration.quadrotor.flight.hover import at_hover
from orchestration.quadrotor.flight.hover_limit import local_limit
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.systems.system.component import Parameter
from orchestration.systems.system.connection import Source
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.theory.exact.expect import expected_of
from orchestration.theory.exact.loops import Loops

Array = Any

PAPER = Scenario(
    controller=FmuChoice(fmu="native/UnifiedController"), plant=FmuChoice(fmu="native/QuadrotorPlant"), stop_time=60.0
).with_changes(timing={"plant_interval": 0.005}, parameters={"plant.max_internal_step": 0.005})
"""The paper's flight to 60 s, as in the study files, by native FMUs"""
CALM: Mapping[str, Parameter] = {f"plant.wind.amplitude.{axis}": 0.0 for axis in "xyz"}
"""No wind"""

# -- decay of errors -------------------------------------------------------------------------------------------------

LAYER = 1e-3
"""ε [m]"""
EXPONENTS = (1.0, 0.99, 0.95, 0.9, 0.85, 0.8, 0.7, 0.5)
"""β_t"""
DECAY_PERIODS = (0.001, 0.01, 0.05)
"""Periods [s]"""
BOUNDS = (0.1, 0.01, LAYER, 1e-4, 1e-5)
"""Bounds of the largest position error of the axes [m]; the first two decades are outside of the boundary layer"""
STAYS = 2.0
"""Time for which an error must stay below a bound [s], so that a zero crossing at the end does not count"""
DECAY_STARTS = 20
"""initial conditions 1 m from the path in random directions, beside the paper's"""
_ERROR = "max({})".format(", ".join(f"abs(plant.position.{axis} - reference.position.{axis})" for axis in "xyz"))


def decaying(exponent: float = 0.99) -> Scenario:
    """The flight whose decay is measured."""
    own: dict[str, Parameter] = {"controller.surface_exponent": exponent, "controller.boundary_layer": LAYER}
    return PAPER.with_changes(parameters={**CALM, **own})


def decay_study() -> Study:
    """Every exponent at every period from every initial condition, the paper's first."""
    system = decaying().as_system()
    measured = {_within(bound): f"settling_time({_ERROR}, {bound})" for bound in BOUNDS}
    remains = {"remains": f"max({_ERROR} * (time >= stop_time - 5))"}
    generator = np.random.default_rng(1)
    directions = generator.standard_normal((DECAY_STARTS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    places = [np.zeros(3), *(np.array([*Trajectory().position(0.0)]) + directions)]
    return Study(
        name="decay",
        base=replace(system, objectives={**system.objectives, **measured, **remains}),
        axes=(
            Axis(name="exponent", targets=("components.controller.parameters.surface_exponent",), values=EXPONENTS),
            Axis(name="period", targets=("components.controller.sampling.period",), values=DECAY_PERIODS),
            Axis(name="start", targets=(), values=tuple(range(len(places)))),
        ),
        together=(
            LinkedSettings(axes=("start",), sets={(i,): _initial_position(place) for i, place in enumerate(places)}),
        ),
    )


def since(table: Any) -> Array:
    """The time from which each flight's error stays below each of `BOUNDS` [s], shape (flights, bounds); nan: never."""
    found = table[[_within(bound) for bound in BOUNDS]].to_numpy(float)
    return np.where(found <= PAPER.stop_time - STAYS, found, np.nan)


def rates_of(times: Array) -> Array:
    """The rates at which the error falls from each bound to the next [1/s], from the result of `since`."""
    spans = np.diff(times, axis=1)
    return np.log(np.divide(BOUNDS[:-1], BOUNDS[1:])) / np.where(spans > 0.0, spans, np.nan)


def error_over_time(exponent: float) -> tuple[Array, Array, Array]:
    """Time [s], the largest error of the three axes [m] and the energy L_κ [J] of the paper's flight at 1 ms."""
    signals = quadcosim.run(decaying(exponent).with_changes(timing={"period": 0.001})).signals
    error = np.max([np.abs(signals[f"plant.position.{a}"] - signals[f"reference.position.{a}"]) for a in "xyz"], axis=0)
    return signals["time"], error, signals["controller.energy"]


def promised(exponent: float, time: Array, error: Array) -> dict[str, float | None]:
    """The settling time on the surface that the theorem promises [s], and from when on the error is below 1 cm [s]."""
    above = np.flatnonzero(error > 0.01)[-1]
    since = float(time[above + 1]) if above + 1 < len(time) else None
    gain = float(GAINS["k_s"]["gain.surface"])
    bound = float(error[0] ** (1.0 - exponent) / (gain * (1.0 - exponent)))
    return {"exponent": exponent, "promised": bound, "below_1_cm": since}


ENERGIES = (0.0, 1.0, 15.0)
"""κ of the flights whose energy is drawn"""
RISES = 6.0
"""Time over which its rises are counted [s]"""


def energy_over_time(kappa: float) -> tuple[Array, Array, Array]:
    """Time [s], L_κ [J] and |e| [m] of the paper's flight without wind at 1 ms, for 15 s."""
    own = {**CALM, "controller.coupling": kappa}
    signals = quadcosim.run(PAPER.with_changes(timing={"period": 0.001}, stop_time=15.0, parameters=own)).signals
    e = [signals[f"plant.position.{axis}"] - signals[f"reference.position.{axis}"] for axis in "xyz"]
    return signals["time"], signals["controller.energy"], np.linalg.norm(e, axis=0)


def rises_of(kappa: float, time: Array, energy: Array, error: Array) -> dict[str, float | None]:
    """The highest rise of L_κ, from trough to peak, the share of samples at which it rises, and where it misleads most.

    That is where |e| is largest while L_κ is below 0.01 J; None: it never is.
    """
    early = time <= RISES
    peak = int(np.argmax((energy - np.minimum.accumulate(energy))[early]))
    trough = int(np.argmin(energy[: peak + 1]))
    small = np.where(early & (energy < 0.01), error, 0.0)
    far = int(np.argmax(small)) if small.any() else None
    return {
        "coupling": kappa, "begins": float(energy[0]),
        "trough": float(energy[trough]), "trough_at": float(time[trough]),
        "peak": float(energy[peak]), "peak_at": float(time[peak]),
        "rises": float(np.mean(np.diff(energy[early]) > 0.0)),
        "small": None if far is None else float(energy[far]),
        "small_at": None if far is None else float(time[far]),
        "error_there": None if far is None else float(error[far]),
    }  # fmt: skip


def energy_rates() -> list[float]:
    """The rates at which L_κ falls while the error falls from each bound to the next, β_t = 1 [1/s]."""
    time, error, energy = error_over_time(1.0)
    ends = [int(np.flatnonzero(error > bound)[-1]) for bound in BOUNDS]
    return [-float(np.polyfit(time[a:b], np.log(energy[a:b]), 1)[0]) for a, b in pairwise(ends)]


def expected_rate(exponent: float, gain: float = 2.99) -> float:
    """The decay rate of the error [1/s] with an ideal attitude loop: 2k/(3 + β_t), inside and outside of any layer.

    Near the surface ds = γ' ev - k s leaves ë + k ė + k k_s |e|^β_t sgn e = 0: a spring of power β_t under linear
    damping. Over a period ⟨ė²⟩ = 2 (1 + β_t)/(3 + β_t) of the energy, which goes as |e|^(1 + β_t) and falls by k ⟨ė²⟩.
    """
    return 2.0 * gain / (3.0 + exponent)


def _within(bound: float) -> str:
    return f"within_{round(bound * 1e6)}_um"


def _initial_position(place: Array) -> dict[str, float]:
    return {f"components.plant.parameters.initial.position.{axis}": float(x) for axis, x in zip("xyz", place)}


# -- the limit of the period -----------------------------------------------------------------------------------------

FACTORS = tuple(float(factor) for factor in np.geomspace(0.25, 4.0, 9))
GAINS = {
    "k_θ": {"gain.theta": 15.0},
    "k_η": {"gain.eta": 15.0},
    "k_q": {"gain.attitude": 15.0},
    "k_t + β": {**{f"gain.translation.{axis}": 2.0 for axis in "xyz"}, "gain.disturbance": 0.99},
    "k_s": {"gain.surface": 5.0},
}
ATTITUDE, TRANSLATION = ("k_θ", "k_η", "k_q"), ("k_t + β", "k_s")
LOOPS = {**{name: (name,) for name in GAINS}, "attitude": ATTITUDE, "translation": TRANSLATION}


def scaled(names: tuple[str, ...], factor: float, scenario: Scenario) -> Scenario:
    """`scenario` with these of the paper's gains times a factor."""
    values = {f"controller.{gain}": factor * value for name in names for gain, value in GAINS[name].items()}
    return scenario.with_changes(parameters=values)


def limits_over_gains(kappa: float) -> dict[str, Array]:
    """Local limits of the period [s] for each of `FACTORS`, by scaled gains."""
    base = PAPER.with_changes(parameters={"controller.coupling": kappa})
    plant = HoverLoop.of(base)
    return {
        name: np.array([local_limit(plant.with_law(one), one, "period") for one in loops], float)
        for name, names in LOOPS.items()
        for loops in [[scaled(names, factor, base) for factor in FACTORS]]
    }


def of_attitude_alone(k_theta: float, k_eta: float, k_q: float) -> float:
    """The largest period [s] of the attitude loop alone about hover, J = 1 kg·m².

    It is a double integrator under -k_p θ - k_d ω, k_d = k_θ + k_η/2, k_p = (k_θ k_η + k_q)/2: min(2/k_d, 2 k_d/k_p).
    """
    k_d, k_p = k_theta + 0.5 * k_eta, 0.5 * (k_theta * k_eta + k_q)
    return min(2.0 / k_d, 2.0 * k_d / k_p)


def exponent_of(factors: Array, values: Array) -> tuple[float, float, float]:
    """The slope of log value over log factor by least squares, with its 95 % interval (Student)."""
    from scipy.stats import linregress, t

    fit = linregress(np.log(factors), np.log(values))
    half = float(t.ppf(0.975, len(factors) - 2)) * fit.stderr
    return float(fit.slope), float(fit.slope - half), float(fit.slope + half)


# -- tolerated delays -----------------------------------------------------------------------------------------------

MARGIN_PERIODS = (0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07)
"""Periods [s]"""


# -- the exact cost of wind about hover -----------------------------------------------------------------------------

WIND = 1e-6
"""Intensity of a white force along each axis [N² s], so that the error stays within the boundary layer of 1 mm"""
WIND_PERIODS = tuple(0.005 * k for k in range(1, 21))
WIND_DELAYS = tuple(0.0025 * k for k in range(21))
"""Delays [s]"""
WIND_RUNS = ((0.01, 0.0), (0.06, 0.02))
"""Periods and delays of runs for comparison [s]"""
WIND_COSTS = ("position_rmse", "torque_rms")


def in_wind(period: float = 0.01, delay: float = 0.0) -> System:
    """The paper's law about hover under a white force, with the rms of its error and of its command as objectives."""
    hover = at_hover(PAPER)
    to = tuple(f"plant.{name}" for name in wiring.EXTERNAL_FORCE)
    force = Source(noise=WIND, period=PAPER.timing.plant_interval, to=to)
    objectives = {**hover.objectives, "torque_rms": "rms(norm(plant.torque))"}
    return quadcosim.changed(
        replace(hover, sources={**hover.sources, "wind": force}, objectives=objectives),
        {"components.controller.sampling.period": period, "connections.command.delay": delay},
    )


def costs_of_wind() -> dict[str, Array]:
    """By objective: its exact value, shape (delays, periods), nan where not finite; and the mean-square `radius`."""
    loops = Loops(files_of(in_wind()).models)
    found = [[expected_of(in_wind(T, d), loops) for T in WIND_PERIODS] for d in WIND_DELAYS]
    costs = {name: [[each.objectives[name] for each in row] for row in found] for name in WIND_COSTS}
    radius = np.array([[each.mean_square_radius for each in row] for row in found])
    return {**{name: np.array(each, float) for name, each in costs.items()}, "radius": radius}


def squares_in_wind(period: float, delay: float) -> dict[str, Array]:
    """The squares of the same objectives in 16 runs of 60 s."""
    runs = [quadcosim.run(replace(in_wind(period, delay), seed=seed)).metrics for seed in range(16)]
    return {name: np.array([run[name] for run in runs]) ** 2 for name in WIND_COSTS}
