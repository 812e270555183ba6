"""Many flights of the paper's scenario at once: law and plant of the FMUs, called with arrays instead of floats.

For the questions of `findings.md` that take thousands of flights. No FMU and no master is in it; a sample of the
flights is flown with them too, and compared (`docs.make_findings`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller_fmu.sliding_mode.law import Gains, Measurement, Model, evaluate
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.integrator import rk4_step
from fmu_kit.rigid_body import Body, RigidState, Wrench, derivative
from fmu_kit.trajectory import Trajectory
from orchestration.master.sources import NUMPY
from orchestration.quadrotor.measures import SETTLED
from plant_fmu.wind import Wind

Array = Any
Law = Callable[[Array, RigidState], Array]

STEP = 0.005
"""[s], the longest step of the integration"""
ATTITUDE = (0.1699, 0.3058, 0.1699, 0.9212)
LARGEST_ERROR, LARGEST_RATE = 100.0, 1000.0
"""[m] and [rad/s]: beyond, a flight has diverged (docs/timing.md)"""
TRAJECTORY, WIND, MODEL, BODY = Trajectory(), Wind(), Model(), Body()


@dataclass(frozen=True, kw_only=True)
class Flights:
    """What differs between the flights: numbers, or arrays of shape (n,)."""

    period: Array = 0.01
    """[s]"""
    delay: Array = 0.0
    """[s] from a sample to its command's arrival"""
    kappa: Array = 1.0
    gain_factor: Array = 1.0
    """on k_eta, k_theta and k_q; kappa is not scaled with them"""
    surface: Array = 5.0
    """k_s"""
    start: tuple[Array, Array, Array] = (0.0, 0.0, 0.0)
    """P(0) [m]"""
    lag: Array = 0.0
    """time constant of the actuators [s]"""

    def arrays(self) -> dict[str, Array]:
        """All of them with one shape."""
        names = ("period", "delay", "kappa", "gain_factor", "surface", "lag", "x", "y", "z")
        values = (self.period, self.delay, self.kappa, self.gain_factor, self.surface, self.lag, *self.start)
        return dict(zip(names, np.broadcast_arrays(*map(np.atleast_1d, values))))


@dataclass(frozen=True, kw_only=True)
class Outcomes:
    """What became of the flights, shape (n,)."""

    diverged: Array
    ultimate_bound: Array
    """[m], largest position error of the last third; nan if diverged"""
    settling_time: Array
    """[s] since when the position error is below 5 cm; nan if it is not"""
    final_bound: Array
    """[m], position error at the end"""

    @property
    def flies(self) -> Array:
        """The criterion of `metrics.outcome`: settled."""
        return ~self.diverged & (self.ultimate_bound < SETTLED)


def fly(flights: Flights, stop_time: float = 30.0) -> Outcomes:
    """Fly all, those of similar period together, each sampled at its own period with zero-order hold."""
    given = flights.arrays()
    order = np.argsort(given["period"], kind="stable")
    classes = np.floor(np.log(given["period"][order]) / np.log(1.2))
    parts = [part for part in np.split(order, np.flatnonzero(np.diff(classes)) + 1) if len(part)]
    flown = [_sampled({name: value[part] for name, value in given.items()}, stop_time) for part in parts]
    back = np.argsort(np.concatenate(parts), kind="stable")
    return Outcomes(**{name: np.concatenate([getattr(o, name) for o in flown])[back] for name in vars(flown[0])})


def fly_continuously(flights: Flights, stop_time: float = 30.0, step: float = STEP) -> Outcomes:
    """Fly all in continuous time: the law is evaluated at every stage of the integration, nothing is sampled."""
    given = flights.arrays()
    command, state = _law(given), _start(given)
    zero = 0.0 * given["x"]
    score = _Score(zero, stop_time)

    def f(t: Array, x: RigidState) -> RigidState:
        u = command(t, x)
        return derivative(x, Wrench(u[0], Vec3(*u[1:])), WIND.force(t, NUMPY), BODY)

    for i in range(round(stop_time / step)):
        state = rk4_step(f, zero + i * step, state, step).normalised(NUMPY)
        score.see(zero + (i + 1) * step, state)
        state = _revived(state, score.gone)
    return score.outcomes()


def _sampled(given: dict[str, Array], stop_time: float) -> Outcomes:
    law, state = _law(given), _start(given)
    period = given["period"]
    late = np.floor(given["delay"] / period + 1e-9).astype(int)  # whole periods of the delay
    rest = np.maximum(given["delay"] - late * period, 0.0)
    segments = [(rest, late + 1)] if rest.any() else []
    segments.append((period - rest, late))
    score = _Score(0.0 * period, stop_time)
    history = wrench = None
    for k in range(int(np.ceil(stop_time / period.min() - 1e-9))):
        t = k * period
        command = law(t, state)
        if history is None:  # the command of the initialisation holds until the first one arrives
            history, wrench = np.repeat(command[None], late.max() + 2, axis=0), command
        history = np.concatenate([command[None], history[:-1]])
        for length, age in segments:
            acting = np.take_along_axis(history, np.broadcast_to(age, (1, *command.shape)), axis=0)[0]
            substeps = int(np.ceil(length.max() / STEP - 1e-9))
            for _ in range(substeps):
                h = length / substeps
                state, wrench = _step(t, state, wrench, acting, h, given["lag"])
                t = t + h
                score.see(t, state)
        if score.diverged.all():
            break
        state = _revived(state, score.gone)
        history, wrench = (np.where(score.gone, 0.0, u) for u in (history, wrench))
    return score.outcomes()


def _step(t: Array, state: RigidState, start: Array, target: Array, h: Array, lag: Array) -> tuple[RigidState, Array]:
    """State and wrench a step `h` [s] later; the wrench follows the held command by the exact solution of the lag."""
    lags = lag.any()

    def wrench(elapsed: Array) -> Array:
        if not lags:
            return target
        return target + np.where(lag > 0.0, np.exp(-elapsed / np.maximum(lag, 1e-9)), 0.0) * (start - target)

    def f(time: Array, x: RigidState) -> RigidState:
        u = wrench(time - t)
        return derivative(x, Wrench(u[0], Vec3(*u[1:])), WIND.force(time, NUMPY), BODY)

    with np.errstate(all="ignore"):  # what diverges is found by what it has become
        return rk4_step(f, t, state, h).normalised(NUMPY), wrench(h)


def _law(given: dict[str, Array]) -> Law:
    factor, paper = given["gain_factor"], Gains()
    gains = Gains(
        k_s=given["surface"], kappa=given["kappa"],
        k_eta=factor * paper.k_eta, k_theta=factor * paper.k_theta, k_q=factor * paper.k_q,
    )  # fmt: skip

    def command(t: Array, x: RigidState) -> Array:
        measured = Measurement(x.position, x.velocity, x.quaternion, x.angular_velocity)
        with np.errstate(all="ignore"):
            found = evaluate(measured, TRAJECTORY.at(t, NUMPY), gains, MODEL, NUMPY)
        return np.stack([found.thrust, *found.torque])

    return command


def _start(given: dict[str, Array]) -> RigidState:
    zero = 0.0 * given["x"]
    attitude = Quaternion.from_xyzw(*(zero + component for component in ATTITUDE)).normalised(NUMPY)
    rest = Vec3(zero, zero, zero)
    return RigidState(Vec3(given["x"], given["y"], given["z"]), rest, attitude, rest)


def _revived(state: RigidState, gone: Array) -> RigidState:
    """What is gone goes on from rest, so that no array holds what is no number; nobody looks at it again."""
    if not gone.any():
        return state
    still = lambda v: v.map(lambda component: np.where(gone, 0.0, component))  # noqa: E731
    Q = state.quaternion
    return RigidState(
        still(state.position), still(state.velocity),
        Quaternion(still(Q.vector), np.where(gone, 1.0, Q.scalar)), still(state.angular_velocity),
    )  # fmt: skip


class _Score:
    """Follows the position error of all flights to the stop time."""

    def __init__(self, zero: Array, stop_time: float) -> None:
        self._stop = stop_time
        self.diverged = zero > 1.0
        self.gone = self.diverged
        """diverged, or wild after the stop time, where others still fly"""
        self._bound, self._last, self._outside = zero, zero, zero

    def see(self, t: Array, state: RigidState) -> None:
        with np.errstate(all="ignore"):
            e = (state.position - TRAJECTORY.position(t, NUMPY)).norm(NUMPY)
            wild = ~(e <= LARGEST_ERROR) | ~(state.angular_velocity.norm(NUMPY) <= LARGEST_RATE)
        there = t <= self._stop + 1e-9
        self.diverged, self.gone = self.diverged | (there & wild), self.gone | wild
        seen = there & ~self.diverged
        self._last = np.where(seen, e, self._last)
        self._outside = np.where(seen & (e > SETTLED), t, self._outside)
        late = seen & (t >= self._stop * 2.0 / 3.0 - 1e-9)
        self._bound = np.where(late, np.maximum(self._bound, e), self._bound)

    def outcomes(self) -> Outcomes:
        gone = self.diverged
        return Outcomes(
            diverged=gone,
            ultimate_bound=np.where(gone, np.nan, self._bound),
            settling_time=np.where(gone | (self._last > SETTLED), np.nan, self._outside),
            final_bound=np.where(gone, np.nan, self._last),
        )
