"""Runs as environments of Gymnasium; it needs `pip install 'quadcosim[gym]'`.

Importing this registers `quadcosim/Quadrotor-v0`, the paper's flight with your policy as its controller::

    import gymnasium
    import quadcosim.gym

    environment = gymnasium.make("quadcosim/Quadrotor-v0")
    many = gymnasium.make_vec("quadcosim/Quadrotor-v0", num_envs=1024)  # in SIMD lanes

| | of `quadcosim/Quadrotor-v0` |
|---|---|
| observation | position [m], velocity [m/s], attitude as a quaternion x, y, z, w, angular velocity [rad/s], and the \
reference's position [m] now: 16 numbers. Positions and velocities are in the inertial frame (north, east, down), \
angular velocity is in the body frame (front, right, down); the quaternion rotates from body to inertial frame |
| action | thrust [N], along the body's axis that points up, from 0 to 30; torque about the body's axes [N.m], from -5 \
to 5: 4 numbers, held over a period, and as late and lossy as the scenario has it. Until the first one arrives \
`initial` stands; default: hover, m·g of the plant and no torque |
| reward | 1 / (1 + d²), with the distance d from the reference [m] after the step |
| episode | the paper's flight of 30 s, a step each 10 ms; terminated 100 m from the reference, or at 1000 rad/s |

`make` and `make_vec` take `scenario`, the flight with its timing, and all that `Environment` takes, as `reward`, `low`,
`high`, `starts`, `initial`. Without lanes (no C compiler), `make_vec` needs `vectorization_mode="sync"`.

An environment of anything else, as one that rewards little torque::

    from quadcosim import Scenario
    from quadcosim.gym import Environment

    def reward(now):
        return -sum(now[f"plant.torque.{a}"] ** 2 for a in "xyz")

    environment = Environment(Scenario(), reward, low=[0, -5, -5, -5], high=[30, 5, 5, 5])
"""

from typing import TYPE_CHECKING, Any

from orchestration.foundation.basics.errors import QuadcosimError, UsageError, shown
from orchestration.foundation.basics.extras import explains_missing

if TYPE_CHECKING:
    from orchestration.quadrotor.scenarios.scenario import Scenario
    from orchestration.simulation.runs.environment import Environment, VectorEnvironment

__all__ = ["Environment", "VectorEnvironment", "register"]

NAME = "quadcosim/Quadrotor-v0"


def nearness(now: Any) -> Any:
    """The default reward of `quadcosim/Quadrotor-v0`: 1 / (1 + d²), d [m] from the reference; also of arrays."""
    away = [now[f"plant.position.{axis}"] - now[f"reference.position.{axis}"] for axis in "xyz"]
    return 1.0 / (1.0 + sum(x * x for x in away))  # ** 2 of a number and of an array may differ in the last bit


def quadrotor(**settings: Any) -> "Environment":
    """What `gymnasium.make` makes of `quadcosim/Quadrotor-v0`."""
    environment: Environment = __getattr__("Environment")(**_flight(settings))
    return environment


def quadrotor_vector(num_envs: int = 1, **settings: Any) -> "VectorEnvironment":
    """What `gymnasium.make_vec` makes of `quadcosim/Quadrotor-v0`."""
    if "autoreset_mode" in settings:
        from gymnasium.vector import AutoresetMode

        if (mode := settings.pop("autoreset_mode")) != AutoresetMode.NEXT_STEP:
            raise UsageError(f"autoreset_mode = {mode}: expected NEXT_STEP; vectorization_mode='sync' takes the others")
    many: VectorEnvironment = __getattr__("VectorEnvironment")(num_envs=num_envs, **_flight(settings))
    return many


@explains_missing
def register() -> None:
    """Register `quadcosim/Quadrotor-v0`, if it is not yet."""
    import gymnasium

    if NAME not in gymnasium.registry:
        gymnasium.register(NAME, "quadcosim.gym:quadrotor", vector_entry_point="quadcosim.gym:quadrotor_vector")


def _flight(settings: dict[str, Any]) -> dict[str, Any]:
    """The arguments of an environment of the flight: the defaults that are not given."""
    from orchestration.quadrotor.scenarios.scenario import Scenario
    from orchestration.simulation.requests.request import request_of

    scenario = request_of(Scenario() if (given := settings.pop("scenario", None)) is None else given)
    if not isinstance(scenario, Scenario):
        raise UsageError(f"scenario = {shown(repr(given))}: expected a Scenario, no other system")
    flight = {
        "request": _fastest(scenario),
        "reward": nearness,
        "low": [0.0, -5.0, -5.0, -5.0],
        "high": [30.0, 5.0, 5.0, 5.0],
        "observe": [f"reference.position.{axis}" for axis in "xyz"],
    }
    return {**flight, **settings}


def _fastest(scenario: "Scenario") -> "Scenario":
    """The scenario with native twins of its FMUs, where they can be built."""
    from orchestration.components.building import fmus

    try:
        twins = fmus.native_twins(scenario)
        fmus.of_components(twins.as_system().fmus)
    except QuadcosimError:
        return scenario
    return twins


@explains_missing
def __getattr__(name: str) -> Any:
    """Load Gymnasium's classes where they are used: registering needs none of them."""
    if name not in ("Environment", "VectorEnvironment"):
        raise AttributeError(f"module {__name__} has no attribute {name}")
    from orchestration.simulation.runs import environment

    return getattr(environment, name)


register()
