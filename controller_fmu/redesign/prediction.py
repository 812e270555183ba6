"""Where the vehicle will be when a command acts that is computed now, with a known delay."""

from collections.abc import Callable
from typing import NamedTuple

from fmu_kit.algebra import Vec3
from fmu_kit.rigid_body import RigidState, Wrench
from fmu_kit.scalar import Scalar, repeat

MOST_ON_THEIR_WAY = 32
"""Commands that are remembered; in C, each turn of the loop below moves all of them."""


class Sent(NamedTuple):
    """A command that is on its way, or has arrived."""

    time: Scalar
    """[s], when it was given; with a delay d it acts from time + d on"""
    command: Wrench


Pending = tuple[Sent, ...]
"""The last commands that were given, the oldest first; always as many."""


def at_rest(t: Scalar, command: Wrench) -> Pending:
    """What is pending where `command` acts, and has been given at `t` [s] at the latest."""
    return tuple(Sent(t, Wrench(command.thrust, Vec3(*command.torque))) for _ in range(MOST_ON_THEIR_WAY))


def with_newest(pending: Pending, t: Scalar, command: Wrench) -> Pending:
    """What is pending after a `command` given at `t` [s]: the oldest is forgotten."""
    return (*pending[1:], Sent(t, command))


def predicted(
    advanced: Callable[[RigidState, Wrench, Scalar], RigidState],
    state: RigidState,
    t: Scalar,
    delay: Scalar,
    pending: Pending,
) -> RigidState:
    """x̂(t + delay) from `state` at `t` [s], under the commands that act until then.

    `advanced` is the model after a time [s] under a held command. Of a command given at t_j it is taken that it acts
    from t_j + delay on, until the next does; the oldest acts at `t`.
    """
    end = t + delay

    def until_the_next(i: int, now: tuple[RigidState, Scalar, Pending]) -> tuple[RigidState, Scalar, Pending]:
        x, time, (acting, following, *others) = now
        until = min(max(following.time + delay, time), end)
        return advanced(x, acting.command, until - time), until, (following, *others, acting)

    x, time, (newest, *_) = repeat(len(pending) - 1, until_the_next, (state, t, pending))
    return advanced(x, newest.command, end - time)
