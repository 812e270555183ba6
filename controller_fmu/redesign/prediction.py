"""Prediction of the state at the time when a command computed now acts, for a known delay."""

from collections.abc import Callable
from typing import NamedTuple

from fmu_kit.algebra import Vec3
from fmu_kit.rigid_body import RigidState, Wrench
from fmu_kit.scalar import Scalar, repeat

MAX_PENDING = 32
"""Number of commands that are recorded; in C, each round of the loop below moves all of them."""


class SentCommand(NamedTuple):
    """A command that is pending, or acts."""

    time: Scalar
    """Time when it was sent [s]; with a delay d it acts from time + d on"""
    command: Wrench


Pending = tuple[SentCommand, ...]
"""The last commands, the oldest first; their number is fixed."""


def all_sent(t: Scalar, command: Wrench) -> Pending:
    """The pending commands if all of them are `command`, sent at `t` [s]."""
    return tuple(SentCommand(t, Wrench(command.thrust, Vec3(*command.torque))) for _ in range(MAX_PENDING))


def with_command(pending: Pending, t: Scalar, command: Wrench) -> Pending:
    """The pending commands after a `command` sent at `t` [s], without the oldest."""
    return (*pending[1:], SentCommand(t, command))


def predicted_state(
    advanced: Callable[[RigidState, Wrench, Scalar], RigidState],
    state: RigidState,
    t: Scalar,
    delay: Scalar,
    pending: Pending,
) -> RigidState:
    """x̂(t + delay) from `state` at `t` [s], under the commands that act until then.

    `advanced` is the model after a time [s] under a held command. A command sent at t_j is assumed to act from
    t_j + delay until the next does; the oldest acts at `t`.
    """
    end = t + delay

    def until_the_next(i: int, now: tuple[RigidState, Scalar, Pending]) -> tuple[RigidState, Scalar, Pending]:
        x, time, (acting, following, *others) = now
        until = min(max(following.time + delay, time), end)
        return advanced(x, acting.command, until - time), until, (following, *others, acting)

    x, time, (newest, *_) = repeat(len(pending) - 1, until_the_next, (state, t, pending))
    return advanced(x, newest.command, end - time)
