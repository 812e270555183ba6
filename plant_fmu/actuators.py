"""Actuators between the commanded and the acting wrench: a box of limits, or four motors on an X frame.

Inertial frame north-east-down, body frame forward-right-down, thrust along -z of the body, SI units.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from fmu_kit.algebra import Vec3
from fmu_kit.errors import require
from fmu_kit.mixer import Mixer
from fmu_kit.rigid_body import Wrench
from fmu_kit.scalar import Scalar


class Channels(NamedTuple):
    """Four numbers with independent lags: thrust and torques x, y, z [N, N·m], or `Thrusts` of four motors [N]."""

    a: Scalar
    b: Scalar
    c: Scalar
    d: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Box:
    """Limits of thrust and of each torque, then a first-order lag of each, without motors."""

    thrust_max: float = 1e6
    """Largest thrust [N]; thrust is limited to [thrust_min, thrust_max]"""
    thrust_min: float = 0.0
    """Least thrust [N]; negative where propellers can push downwards"""
    torque_max: float = 1e6
    """Largest torque [N·m]; each torque is limited to ±torque_max"""
    time_constant: float = 0.0
    """Time constant of the lag [s]; 0: no lag"""

    def limited(self, command: Wrench) -> Wrench:
        """`command` within the limits."""
        highest = self.torque_max
        return Wrench(
            min(max(command.thrust, self.thrust_min), self.thrust_max),
            command.torque.map(lambda component: min(max(component, -highest), highest)),
        )

    def response(self, start: Channels, target: Channels, elapsed: float) -> Channels:
        """Thrust and torques `elapsed` [s] after `start`, with the limited command held at `target`.

        This is the exact solution of the lag, for any integration step.
        """
        if self.time_constant == 0.0:
            return target
        left = math.exp(-elapsed / self.time_constant)
        return Channels(
            target.a + left * (start.a - target.a),
            target.b + left * (start.b - target.b),
            target.c + left * (start.c - target.c),
            target.d + left * (start.d - target.d),
        )

    def rate(self, now: Channels, target: Channels) -> Channels:
        """The derivative of thrust and torques [1/s of them]; without a lag they need none."""
        return Channels(*(_rate(x, to, self.time_constant, self.time_constant) for x, to in zip(now, target)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Motors(Mixer):
    """Four motors, each with its limits and its lag.

    A saturated command is not reallocated: each motor is clamped to its own limits, and thrust and torques follow. So
    a large torque reduces or increases the thrust, and a large thrust reduces the torque.
    """

    thrust_max: float = 0.0
    """Largest thrust of one motor [N]; 0: no motors, only the box acts"""
    thrust_min: float = 0.0
    """Least thrust of one motor [N]"""
    arm_x: float = 0.1
    arm_y: float = 0.1
    drag_to_thrust: float = 0.016
    up: float = 0.0
    """Time constant of increasing thrust [s]; 0: no lag"""
    down: float = 0.0
    """Time constant of decreasing thrust [s]; 0: no lag"""

    def limited(self, command: Wrench) -> Channels:
        """The thrusts for `command`, each within its limits."""
        return Channels(*(self._clamped(thrust) for thrust in self.thrusts(command)))

    def response(self, start: Channels, target: Channels, elapsed: float) -> Channels:
        """The thrusts `elapsed` [s] after `start`, with the limited command held at `target`: the exact solution."""
        rising, falling = _remaining(elapsed, self.up), _remaining(elapsed, self.down)
        return Channels(
            _between(start.a, target.a, rising, falling),
            _between(start.b, target.b, rising, falling),
            _between(start.c, target.c, rising, falling),
            _between(start.d, target.d, rising, falling),
        )

    def rate(self, now: Channels, target: Channels) -> Channels:
        """The derivative of the thrusts [N/s]; without a lag they need none."""
        up, down = self.up, self.down
        both = (up > 0.0) == (down > 0.0)
        require(both, "motor.time_constant.up", up, f"a lag where motor.time_constant.down = {down} is one")
        return Channels(*(_rate(x, to, up, down) for x, to in zip(now, target)))

    def _clamped(self, thrust: Scalar) -> Scalar:
        return min(max(thrust, self.thrust_min), self.thrust_max)


@dataclass(frozen=True, kw_only=True, slots=True)
class Actuators:
    """The limits of the box, followed by the motors with their lag if there are any, else by the lag of the box."""

    box: Box = Box()
    motors: Motors = Motors()

    def limited(self, command: Wrench) -> Channels:
        """The channels for `command`, within the limits."""
        allowed = self.box.limited(command)
        if self.motors.thrust_max > 0.0:
            return self.motors.limited(allowed)
        return Channels(allowed.thrust, allowed.torque.x, allowed.torque.y, allowed.torque.z)

    def response(self, start: Channels, target: Channels, elapsed: float) -> Channels:
        """The channels `elapsed` [s] after they were `start`, with the limited command held at `target`."""
        if self.motors.thrust_max > 0.0:
            return self.motors.response(start, target, elapsed)
        return self.box.response(start, target, elapsed)

    def rate(self, now: Channels, target: Channels) -> Channels:
        """The derivative of the channels under a limited command that is `target` now."""
        if self.motors.thrust_max > 0.0:
            return self.motors.rate(now, target)
        return self.box.rate(now, target)

    def wrench(self, channels: Channels) -> Wrench:
        """The wrench that acts on the body."""
        if self.motors.thrust_max > 0.0:
            return self.motors.wrench(channels)
        return Wrench(channels.a, Vec3(channels.b, channels.c, channels.d))


def _remaining(elapsed: float, time_constant: float) -> float:
    """The share of a difference that remains after `elapsed` [s]."""
    if time_constant == 0.0:
        return 0.0
    return math.exp(-elapsed / time_constant)


def _rate(now: Scalar, target: Scalar, up: float, down: float) -> Scalar:
    """The derivative of a value that follows `target` with these time constants [s]."""
    if up == 0.0:
        return 0.0
    return (target - now) / (up if target > now else down)


def _between(start: Scalar, target: Scalar, rising: float, falling: float) -> Scalar:
    """A value between `start` and `target`, with the remaining shares for a rising and a falling value."""
    remaining = rising if target > start else falling
    return target + remaining * (start - target)
