"""The numbers that a page lets its reader change, and the two of its map."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.components.fmi.read_description import Model
from orchestration.experiments.live.known_sliders import KNOWN_SLIDERS
from orchestration.systems.system.component import Sampling, has_scheduled_instants
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Request


@dataclass(frozen=True, kw_only=True)
class Slider:
    """One number that the reader changes."""

    path: str
    """Path in the request"""
    words: str
    """Name in words"""
    low: float
    high: float
    group: str = ""
    logarithmic: bool = False
    whole: bool = False


@dataclass(frozen=True, kw_only=True)
class Sliders:
    """The sliders of a page, and its map."""

    sliders: Sequence[Slider] = field(default_factory=list)
    map: tuple[str, str] | None = None
    """Paths along its axes; None: there is no map"""
    measure: str | None = None
    """The objective that the map shows"""


_MOST_PARAMETERS = 12


def usual_sliders(request: Request, system: System, models: Mapping[str, Model]) -> Sliders:
    """The sliders of a request: those of its kind, or timing, and parameters with declared ranges."""
    known = KNOWN_SLIDERS.of(request.kind)
    return known(request) if known is not None else _of_any(system, models)


def _of_any(system: System, models: Mapping[str, Model]) -> Sliders:
    sliders, axes = [], []
    for name, component in system.components.items():
        sampling, place = component.sampling, f"components.{name}.sampling"
        if sampling is None or has_scheduled_instants(sampling):
            continue
        sliders += _of_sampling(name, place, sampling)
        axes.append(f"{place}.period")
    longest = max((c.sampling.period for c in system.components.values() if c.sampling is not None), default=0.1)
    for x in system.connections:
        sender, receiver = (system.components[name].sampling is not None for name in (x.sender, x.receiver))
        place = f"connections.{x.name}"
        if sender and not isinstance(x.delay, Distribution):
            sliders.append(Slider(path=f"{place}.delay", words=f"Delay of {x.name}", low=0.0, group="Clock",
                                  high=_rounded(max(5.0 * longest, 2.0 * x.delay))))  # fmt: skip
            axes.append(f"{place}.delay")
        if (sender or receiver) and not isinstance(x.loss, Distribution) and x.burst_length is None:
            sliders.append(Slider(path=f"{place}.loss", words=f"Loss of {x.name}", low=0.0, high=0.9, group="Clock"))
    if system.depends_on_seed:
        sliders.append(Slider(path="seed", words="Seed", low=0.0, high=20.0, group="Clock", whole=True))
    sliders += _of_parameters(system, models)[:_MOST_PARAMETERS]
    return Sliders(sliders=sliders, map=(axes[0], axes[1]) if len(axes) > 1 else None)


def _of_sampling(name: str, place: str, sampling: Sampling) -> list[Slider]:
    period = sampling.period
    found = [Slider(path=f"{place}.period", words=f"Period of {name}", low=_rounded(period / 10.0),
                    high=_rounded(20.0 * period), group="Clock", logarithmic=True)]  # fmt: skip
    if not isinstance(sampling.jitter, Distribution):
        found.append(Slider(path=f"{place}.jitter", words=f"Jitter of {name}", low=0.0, high=_rounded(0.95 * period),
                            group="Clock"))  # fmt: skip
    return found


def _of_parameters(system: System, models: Mapping[str, Model]) -> list[Slider]:
    found = []
    for name in system.components:
        for variable in models[name].variables.values():
            low, high = variable.minimum, variable.maximum
            if variable.causality != "parameter" or variable.kind != "Real" or low is None or high is None:
                continue
            if math.isfinite(low) and math.isfinite(high) and high - low < 1e6:
                path = f"components.{name}.parameters.{variable.name}"
                found.append(Slider(path=path, words=f"{name}.{variable.name}", low=low, high=high, group="Parameters"))
    return found


def parameters_without_ranges(system: System, models: Mapping[str, Model]) -> list[Slider]:
    """Sliders of positive parameters, from a fifth of their values to five times these."""
    found = []
    for name, component in system.components.items():
        for variable in models[name].variables.values():
            value = component.parameters.get(variable.name, variable.start)
            is_one = variable.causality == "parameter" and variable.kind == "Real" and not variable.is_constant
            if not is_one or variable.name in (SAMPLE_PERIOD, SAMPLE_OFFSET):
                continue
            if isinstance(value, (int, float)) and 0.0 < value < math.inf:
                path = f"components.{name}.parameters.{variable.name}"
                found.append(Slider(path=path, words=f"{name}.{variable.name}", low=value / 5.0, high=5.0 * value,
                                    group="Parameters", logarithmic=True))  # fmt: skip
    return found[:_MOST_PARAMETERS]


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")
