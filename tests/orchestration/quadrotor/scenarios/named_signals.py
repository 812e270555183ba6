"""What the metrics of a flight name beside what the components exchange."""

from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.quadrotor.scenarios.wiring import POSITION_REFERENCE
from orchestration.systems.expressions.syntax import names, parse


def beyond_exchanged() -> dict[str, set[str]]:
    """By metric the variables, or parameters, that a plant or controller of somebody else may lack."""
    system = quadrotor()
    known = {end for x in system.connections for end in (*x.start, *x.end)} | {*POSITION_REFERENCE}
    known |= {name.rpartition(".")[0] for name in known} | {"time", "stop_time", *system.objectives}
    return {metric: {*names(parse(text))} - known for metric, text in system.objectives.items()}
