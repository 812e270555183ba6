"""Fly plant and controller in ecos, and print the plant's outputs at the end: PLANT CONTROLLER."""

import json
import sys

import orchestration.simulation.interop.tools.ecos  # noqa: F401  # oneTBB, which ecospy does not find by itself

# isort: split
from ecospy import EcosSimulation, EcosSimulationStructure

from orchestration.quadrotor.scenarios.wiring import COMMAND, MEASUREMENT

if __name__ == "__main__":
    structure = EcosSimulationStructure()
    for name, path in zip(("plant", "controller"), sys.argv[1:], strict=True):
        structure.add_model(name, path)
    for name in MEASUREMENT:
        structure.make_real_connection(f"plant::{name}", f"controller::{name}")
    for name in COMMAND:
        structure.make_real_connection(f"controller::{name}", f"plant::{name}")
    with EcosSimulation(0.01, structure=structure) as simulation:
        assert simulation.init()
        simulation.step_until(2.0)
        found = [simulation.get_real(f"plant::{name}") for name in MEASUREMENT]
        simulation.terminate()
    print(json.dumps(found))
