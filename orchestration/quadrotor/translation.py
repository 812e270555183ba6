"""A scenario of the quadrotor as the system that it means."""

import functools
from pathlib import Path
from typing import Any

from orchestration.scenario import Scenario
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.system_file import load_system
from orchestration.wiring import REFERENCE, USE_REFERENCE_INPUTS


@functools.cache
def quadrotor() -> System:
    """The system that is shipped: the paper's flight."""
    return load_system(Path(__file__).with_name("system.toml"))


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
    return changed(quadrotor(), changes)


SAMPLING = ("period", "offset", "jitter", "jitter_distribution", "clock_ratio", "clock")
COMMAND = ("order", "hold", "delay", "delay_jitter", "jitter_distribution")
"""Keys of `[timing]` that belong to the controller's sampling, and to the connection of its command."""
