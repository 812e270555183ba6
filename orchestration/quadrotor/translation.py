"""A scenario of the quadrotor as the system that it means."""

import functools
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from orchestration.errors import UsageError
from orchestration.nominal_model import mismatch
from orchestration.scenario import Scenario
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.system_file import load_system
from orchestration.wiring import REFERENCE, RIGID_BODY, USE_REFERENCE_INPUTS


@functools.cache
def quadrotor() -> System:
    """The system that is shipped: the paper's flight."""
    return load_system(Path(__file__).with_name("system.toml"))


@contextmanager
def in_its_own_words(asked: object) -> Iterator[None]:
    """What is wrong with the system of a scenario is said of the scenario, which is what somebody wrote."""
    try:
        yield
    except UsageError as error:
        if not isinstance(asked, Scenario):
            raise
        text = str(error)
        for place, meant in PLACES.items():
            text = text.replace(place, meant)
        raise type(error)(text) from error


def warnings(scenario: Scenario, parameters: Mapping[str, float]) -> tuple[str, ...]:
    """What may not be meant: a nominal model that is not the plant's, a run too short for its timing."""
    found = []
    if not scenario.model_mismatch:
        sides = [
            {name: parameters[f"{side}.{name}"] for name in RIGID_BODY if f"{side}.{name}" in parameters}
            for side in ("plant", "controller")
        ]
        different = mismatch(*sides)
        found += [] if different is None else [different]
    return (*found, *scenario.timing.warnings(scenario.stop_time))


def system_of(scenario: Scenario) -> System:
    """The system that a scenario means: the quadrotor with the scenario's values."""
    timing, sides = scenario.timing, {"plant": scenario.plant, "controller": scenario.controller}
    changes: dict[str, Any] = {
        "stop_time": scenario.stop_time,
        "seed": scenario.seed,
        "components.plant.step": timing.plant_interval,
        **{f"components.controller.sampling.{key}": getattr(timing, key) for key in SAMPLING},
        **{f"connections.command.{key}": getattr(timing, key) for key in COMMAND},
        "connections.measurement.loss": timing.measurement_loss,
        "connections.command.loss": timing.command_loss,
        "connections.measurement.burst_length": timing.burst_length,
        "connections.command.burst_length": timing.burst_length,
    }
    for kind in ("noise", "quantisation"):
        changes |= {f"connections.measurement.{kind}.{name}": v for name, v in getattr(timing, kind).items()}
    for side, choice in sides.items():
        changes[f"components.{side}.fmu"] = choice.fmu
        changes |= {f"components.{side}.parameters.{name}": value for name, value in choice.parameters.items()}
        changes[f"components.{side}.record"] = getattr(scenario.record, side)
    if scenario.reference.file is not None:
        changes |= {
            "sources.reference.trajectory": None,
            "sources.reference.file": scenario.reference.file,
            "sources.reference.to": tuple(f"controller.{name}" for name in REFERENCE),
            f"components.controller.parameters.{USE_REFERENCE_INPUTS}": True,
        }
    elif scenario.controller.parameters.get(USE_REFERENCE_INPUTS) is True:
        raise UsageError(f"controller.{USE_REFERENCE_INPUTS}: expected [reference] file = … to feed them")
    return changed(quadrotor(), changes)


PLACES = {
    "components.controller.parameters.": "controller.",
    "components.plant.parameters.": "plant.",
    "components.controller.record": "record.controller",
    "components.plant.record": "record.plant",
    "components.controller.sampling.": "timing.",
    "components.controller.": "controller.",
    "components.plant.step": "timing.plant_interval",
    "components.plant.": "plant.",
    "connections.measurement.from": "plant.fmu",
    "connections.measurement.to": "controller.fmu",
    "connections.command.from": "controller.fmu",
    "connections.command.to": "plant.fmu",
    "connections.measurement.noise": "timing.noise",
    "connections.measurement.quantisation": "timing.quantisation",
    "connections.measurement.loss": "timing.measurement_loss",
    "connections.command.loss": "timing.command_loss",
    "connections.command.": "timing.",
    "sources.reference.": "reference.",
}
"""Where a scenario says what its system says elsewhere."""

SAMPLING = ("period", "offset", "jitter", "jitter_distribution", "clock_ratio", "clock")
COMMAND = ("order", "hold", "delay", "delay_jitter", "jitter_distribution")
"""Keys of `[timing]` that belong to the controller's sampling, and to the connection of its command."""
