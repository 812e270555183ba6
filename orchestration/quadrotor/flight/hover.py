"""Hover: a flight whose reference is at rest, without wind, and the FMUs there.

Hover lies inside the boundary layer of the law, where its gain is constant. Outside, the gain depends on the
position error and is largest at the edge of the layer: `at_edge` is the scenario for the loop with that gain.
"""

import dataclasses
import math

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.translation import DisturbanceChoice, ReferenceChoice
from orchestration.systems.system.check import AT_REST
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System

STEP = 1e-6
"""Step of each coordinate in a difference; a thousandth of a boundary layer that is smaller than 1 mm"""
COORDINATES = wiring.POSITION + wiring.VELOCITY + wiring.QUATERNION[:3] + wiring.ANGULAR_VELOCITY
"""Coordinates of the vehicle; the attitude by its vector part"""
SCALAR_PART = wiring.QUATERNION[3]


def hover_of(scenario: Scenario) -> Scenario:
    """`scenario` with the vehicle at rest at the origin, where its reference rests too, and no wind and no payload."""
    scenario = scenario.resolved()
    plant = dict(scenario.plant.parameters) | dict.fromkeys(wiring.DISTURBANCE, 0.0)
    plant |= {wiring.PAYLOAD: 0.0} if wiring.PAYLOAD in plant else {}
    plant |= {f"initial.{name}": 0.0 for name in wiring.MEASUREMENT} | {f"initial.{SCALAR_PART}": 1.0}
    return dataclasses.replace(
        scenario,
        plant=dataclasses.replace(scenario.plant, parameters=plant),
        reference=ReferenceChoice(name=AT_REST),
        disturbance=DisturbanceChoice(),
    )


def at_hover(scenario: Scenario) -> System:
    """The system of `scenario` at hover, with values for the parameters that its FMUs have."""
    scenario = scenario.resolved()
    system = hover_of(scenario).as_system()
    own = {"plant": scenario.plant.parameters, "controller": scenario.controller.parameters}
    models = files_of(system).models_of(system)
    components = {
        name: dataclasses.replace(
            component,
            parameters={
                key: value
                for key, value in component.parameters.items()
                if key in own[name] or key in models[name].variables
            },
        )
        for name, component in system.components.items()
    }
    return dataclasses.replace(system, components=components, operating_point={})


def at_edge(scenario: Scenario) -> Scenario | None:
    """`scenario` with the gain that its law has just outside the boundary layer, used everywhere.

    That is the slope of k_s |e|^β_t sgn(e) at |e| = ε. None for a controller without parameters of these names.
    """
    scenario = scenario.resolved()
    system = scenario.as_system()
    known = files_of(system).start_values_of(system)
    own = {f"controller.{name}": value for name, value in scenario.controller.parameters.items()}
    if any(name not in known for name in wiring.SURFACE):
        return None
    gain, exponent, layer = (float(own.get(name, known[name])) for name in wiring.SURFACE)
    return scenario.with_changes(parameters={wiring.SURFACE[0]: exponent * gain * layer ** (exponent - 1.0)})


def displaced(name: str, size: float) -> dict[str, float]:
    """Initial values of a vehicle at hover but for one coordinate, the quaternion of unit length."""
    moved = {f"initial.{name}": size}
    if name in wiring.QUATERNION:
        moved[f"initial.{SCALAR_PART}"] = math.sqrt(1.0 - size * size)
    return moved


def measurement_at(initial: dict[str, float]) -> Floats:
    """The measurement of a vehicle at hover but for these initial values, shape (13,)."""
    at_rest = {f"initial.{SCALAR_PART}": 1.0} | initial
    return np.array([at_rest.get(f"initial.{name}", 0.0) for name in wiring.MEASUREMENT])
