"""What a controller expects of the vehicle: its nominal model, held at a command or closed by its law.

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


def held(
    model: Body, state: RigidState, command: Wrench, step: Scalar, count: int, ops: ScalarOps = FLOAT
) -> RigidState:
    """The nominal model after `count` steps of `step` [s] under a held command."""

    def f(t: Scalar, x: RigidState) -> RigidState:
        return derivative(x, command, ZERO, model)

    return repeat(count, lambda i, x: rk4_step(f, 0.0, x, step).normalised(ops), state)


class Flight:
    """A state, and the integral over time of the command on the way there; equally their rates."""

    __slots__ = ("impulse", "state")

    def __init__(self, state: RigidState, impulse: Wrench) -> None:
        self.state = state
        self.impulse = impulse
        """[N·s, N·m·s]"""

    def plus(self, factor: Scalar, rate: "Flight") -> "Flight":
        """self + factor * rate, componentwise."""
        a, b = self.impulse, rate.impulse
        impulse = Wrench(a.thrust + factor * b.thrust, a.torque.plus(factor, b.torque))
        return Flight(self.state.plus(factor, rate.state), impulse)


def closed_loop(
    law: Law, model: Body, t: Scalar, state: RigidState, step: Scalar, count: int, ops: ScalarOps = FLOAT
) -> Flight:
    """The nominal closed loop from `state` at `t` [s], after `count` steps of `step` [s] by RK4.

    The command is integrated along with the state: by Simpson's rule on the stages, 4 evaluations of the law a step.
    """

    def f(time: Scalar, x: Flight) -> Flight:
        command = law(time, x.state.normalised(ops))  # the stages of a step leave the unit sphere
        return Flight(derivative(x.state, command, ZERO, model), command)

    def advanced(i: int, x: Flight) -> Flight:
        after = rk4_step(f, t + i * step, x, step)
        return Flight(after.state.normalised(ops), after.impulse)

    return repeat(count, advanced, Flight(state, Wrench(0.0, ZERO)))
