"""The nominal model of the vehicle, under a held command or in closed loop with the law.

The nominal model is the rigid body (4)-(5) without wind, limits and lag. Everything here is a pure function, on any
scalar; laws are functions of time and state.
"""

from collections.abc import Callable

from fmu_kit.algebra import ZERO
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import Body, RigidState, Wrench, derivative
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps, repeat

Law = Callable[[Scalar, RigidState], Wrench]
"""The command at a time [s] in a state of unit quaternion."""


def under_command(
    model: Body, state: RigidState, command: Wrench, step: Scalar, count: int, ops: ScalarOps = FLOAT
) -> RigidState:
    """The state of the nominal model after `count` steps of `step` [s] under a held command."""

    def f(t: Scalar, x: RigidState) -> RigidState:
        return derivative(x, command, ZERO, model)

    return repeat(count, lambda i, x: rk4_step(f, 0.0, x, step).normalised(ops), state)


class StateAndImpulse:
    """A state, and the time integral of the command up to it; or the rates of both."""

    __slots__ = ("impulse", "state")

    def __init__(self, state: RigidState, impulse: Wrench) -> None:
        self.state = state
        self.impulse = impulse
        """Impulse of thrust and torque [N·s, N·m·s]"""

    def plus(self, factor: Scalar, rate: "StateAndImpulse") -> "StateAndImpulse":
        """self + factor * rate, componentwise."""
        a, b = self.impulse, rate.impulse
        impulse = Wrench(a.thrust + factor * b.thrust, a.torque.plus(factor, b.torque))
        return StateAndImpulse(self.state.plus(factor, rate.state), impulse)


def closed_loop(
    law: Law, model: Body, t: Scalar, state: RigidState, step: Scalar, count: int, ops: ScalarOps = FLOAT
) -> StateAndImpulse:
    """The nominal closed loop from `state` at `t` [s], after `count` steps of `step` [s] by RK4.

    The command is integrated with the state, by Simpson's rule on the stages: 4 evaluations of the law per step.
    """

    def f(time: Scalar, x: StateAndImpulse) -> StateAndImpulse:
        command = law(time, x.state.normalised(ops))  # the stages of a step leave the unit sphere
        return StateAndImpulse(derivative(x.state, command, ZERO, model), command)

    def advanced(i: int, x: StateAndImpulse) -> StateAndImpulse:
        after = rk4_step(f, t + i * step, x, step)
        return StateAndImpulse(after.state.normalised(ops), after.impulse)

    return repeat(count, advanced, StateAndImpulse(state, Wrench(0.0, ZERO)))
