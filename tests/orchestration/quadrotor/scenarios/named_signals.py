"""What the metrics of a flight name beside what the components exchange."""

from controller_fmu.sliding_mode.slave import UnifiedController
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.quadrotor.scenarios.wiring import POSITION_REFERENCE
from orchestration.systems.expressions.syntax import names, parse
from orchestration.systems.system.connection import component_of, variable_of
from plant_fmu.slave import QuadrotorPlant

SLAVES = {"plant": QuadrotorPlant, "controller": UnifiedController}


def beyond_exchanged() -> dict[str, set[str]]:
    """By metric the variables, or parameters, that a plant or controller of somebody else may lack."""
    system = quadrotor()
    known = {end for x in system.connections for end in (*x.start, *x.end)} | {*POSITION_REFERENCE}
    known |= {name.rpartition(".")[0] for name in known} | {"time", "stop_time", *system.objectives}
    return {metric: {*names(parse(text))} - known for metric, text in system.objectives.items()}


def scalars_beyond_exchanged() -> list[str]:
    """Those of all metrics, with vectors as their parts."""
    found = set()
    for name in set().union(*beyond_exchanged().values()):
        own = {variable.name for variable in SLAVES[component_of(name)].variables}
        parts = {f"{name}.{axis}" for axis in "xyzw" if f"{variable_of(name)}.{axis}" in own}
        found |= parts or {name}
    return sorted(found)
