"""The experiments of `findings/` that stand beside theory: how an error decays, what sets the limit, which delays."""

from dataclasses import dataclass
from typing import Any

import numpy as np

import quadcosim
from docs.experiments import random_starts
from orchestration.flight.hover_loop import HoverLoop
from orchestration.flight.local_limit import local_limit
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.timing import Timing

Array = Any

NATIVE = Scenario(timing=Timing(plant_interval=0.005)).with_fmus(
    plant="native/QuadrotorPlant", controller="native/UnifiedController"
)

# -- how an error decays ---------------------------------------------------------------------------------------------

LAYER = 1e-3
"""ε [m]"""
EXPONENTS = (1.0, 0.99, 0.95, 0.9, 0.85, 0.8, 0.7, 0.5)
"""β_t"""
DECAY_PERIODS = (0.001, 0.01, 0.05)
"""[s]"""
DECADES = ((0.1, 0.01), (0.01, LAYER), (LAYER, 1e-4), (1e-4, 1e-5))
"""[m], of the largest position error of the three axes; the first two lie outside of the boundary layer"""
STAYS = 2.0
"""[s], for which an error has to be inside, lest a swing through zero at the end counts"""
DECAY_STARTS = 20
"""1 m from the path in random directions, beside the paper's start"""


@dataclass(frozen=True, kw_only=True)
class Decay:
    """A flight without wind, from the paper's attitude."""

    exponent: float
    period: float
    start: tuple[float, float, float]
    stop_time: float = 25.0


def decays() -> list[Decay]:
    """Every exponent at every period from every start; the paper's start comes first."""
    starts = [(0.0, 0.0, 0.0), *(tuple(start) for start in random_starts()[0][:DECAY_STARTS].tolist())]
    return [Decay(exponent=b, period=T, start=P) for b in EXPONENTS for T in DECAY_PERIODS for P in starts]


def error_over_time(flight: Decay) -> tuple[Array, Array, Array]:
    """Time [s], the largest error of the three axes [m] and the energy L_κ [J], at samples."""
    calm = {f"plant.wind.amplitude.{axis}": 0.0 for axis in "xyz"}
    at = {f"plant.initial.position.{axis}": x for axis, x in zip("xyz", flight.start, strict=True)}
    own = {"controller.surface_exponent": flight.exponent, "controller.boundary_layer": LAYER}
    timing = {"period": flight.period, "plant_interval": min(flight.period, 0.005)}
    scenario = NATIVE.with_changes(parameters={**calm, **at, **own}, stop_time=flight.stop_time, timing=timing)
    signals = quadcosim.run(scenario).signals
    every = slice(None, None, round(flight.period / timing["plant_interval"]))
    error = np.max([np.abs(signals[f"plant.position.{a}"] - signals[f"reference.position.{a}"]) for a in "xyz"], axis=0)
    return signals["time"][every], error[every], signals["controller.energy"][every]


def decay_of(flight: Decay) -> dict[str, Any]:
    """Since when the error stays inside ε, at what rate error and energy fall in each decade, and what remains."""
    time, error, energy = error_over_time(flight)
    since = {bound: _since(time, error, bound) for decade in DECADES for bound in decade}
    rates: list[float | None] = []
    energy_rates: list[float | None] = []
    for high, low in DECADES:
        begin, end = since[high], since[low]
        if begin is None or end is None or end <= begin:
            rates.append(None)
            energy_rates.append(None)
            continue
        rates.append(np.log(high / low) / (end - begin))
        energy_rates.append(_slope(time, energy, begin, end))
    last = float(error[time >= flight.stop_time - 5.0].max()) if time[-1] >= flight.stop_time - 1e-6 else None
    return {"inside": since[LAYER], "rates": rates, "energy_rates": energy_rates, "remains": last}


def _since(time: Array, error: Array, bound: float) -> float | None:
    """The time [s] from which the error stays below a bound; None: not for `STAYS` up to the end."""
    outside = time[error > bound]
    since = float(time[time > outside[-1]].min(initial=np.inf)) if len(outside) else float(time[0])
    return since if since <= time[-1] - STAYS else None


def _slope(time: Array, energy: Array, begin: float, end: float) -> float | None:
    there = (time >= begin) & (time <= end) & (energy > 0.0)
    if there.sum() < 5:
        return None
    return float(-np.polyfit(time[there], np.log(energy[there]), 1)[0])


def expected_rate(exponent: float, gain: float = 2.99) -> float:
    """Of the error [1/s] under an attitude that follows at once: 2k/(3 + β_t), inside or outside of any layer.

    Near the surface ds = γ' ev - k s leaves ë + k ė + k k_s |e|^β_t sgn e = 0: a spring of power β_t under linear
    damping. Over a swing ⟨ė²⟩ = 2 (1 + β_t)/(3 + β_t) of the energy, which goes as |e|^(1 + β_t) and falls by k ⟨ė²⟩.
    """
    return 2.0 * gain / (3.0 + exponent)


# -- what sets the limit ---------------------------------------------------------------------------------------------

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
    """`scenario` with these gains of the paper times a factor."""
    values = {f"controller.{gain}": factor * value for name in names for gain, value in GAINS[name].items()}
    return scenario.with_changes(parameters=values)


def limits_over_gains(kappa: float) -> dict[str, list[float | None]]:
    """Local limits of the period [s] by what is scaled, for each of `FACTORS`."""
    base = NATIVE.with_changes(parameters={"controller.coupling": kappa})
    plant = HoverLoop.of(base)
    found: dict[str, list[float | None]] = {}
    for name, names in LOOPS.items():
        loops = [(scaled(names, factor, base)) for factor in FACTORS]
        found[name] = [local_limit(plant.with_law(one), one, "period") for one in loops]
    return found


def of_attitude_alone(k_theta: float, k_eta: float, k_q: float) -> float:
    """The largest period [s] of the attitude loop about hover by itself, J = 1 kg·m².

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


# -- which delays ----------------------------------------------------------------------------------------------------

MARGIN_PERIODS = (0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07)
"""[s]"""
