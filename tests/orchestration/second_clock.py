"""The loop a second time, as `docs/timing.md` says it: nothing of the project is imported here.

It makes all instants before it flies, where the project's clock makes each from the one before.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

AXES = "xyz"
STATE = (
    *(f"position.{axis}" for axis in AXES),
    *(f"velocity.{axis}" for axis in AXES),
    *(f"quaternion.{axis}" for axis in "xyzw"),
    *(f"angular_velocity.{axis}" for axis in AXES),
)
FORCES = ("thrust", *(f"torque.{axis}" for axis in AXES))
STREAMS = ("jitter", "delay_jitter", "measurement_loss", "command_loss", "noise")
C0, C1 = 0.0013498980316301035, 0.9986501019683699


class Row(NamedTuple):
    """The value just after an instant."""

    t: float
    applied: list[float]
    state: list[float]
    computed: list[float]


class Seen(NamedTuple):
    """What happened in a flight."""

    rows: list[Row]
    plant_steps: list[tuple[float, float]]
    controller_steps: list[tuple[float, float]]
    events: list[tuple[int, str, str, int]]


class Plan(NamedTuple):
    """One sample, everything about it drawn."""

    k: int
    t: int
    sent: int
    arrival: int | None
    deaf: bool
    """its measurement is lost"""


def exactly(seconds: float) -> Fraction:
    """The decimal that a double stands for, in nanoseconds."""
    return Fraction(repr(float(seconds))) * 10**9


def generators(seed: int) -> dict[str, np.random.Generator]:
    """Streams by cause."""
    children = np.random.SeedSequence(seed).spawn(5)
    return {name: np.random.Generator(np.random.PCG64(child)) for name, child in zip(STREAMS, children, strict=True)}


def uniform(stream: np.random.Generator) -> float:
    """From the next word of the stream."""
    return (int(stream.bit_generator.random_raw()) >> 11) * 2.0**-53


def lateness(stream: np.random.Generator, largest: float, distribution: str) -> int:
    """In nanoseconds."""
    if largest == 0:
        return 0
    u = uniform(stream)
    if distribution == "normal":
        u = min(max(NormalDist(0.5, 1 / 6).inv_cdf(C0 + u * (C1 - C0)), 0.0), 1.0)
    return math.floor(u * round(exactly(largest)))


def losses(stream: np.random.Generator, p: float, n: float | None, count: int) -> list[bool]:
    """Of the first `count` samples."""
    if p == 0:
        return [False] * count
    lost: list[bool] = []
    for _ in range(count):
        u = uniform(stream)
        if n is None or p == 1 or not lost:
            lost.append(u < p)
        elif lost[-1]:
            lost.append(u >= 1 / n)
        else:
            lost.append(u < p / (n * (1 - p)))
    return lost


def plans(timing: Mapping[str, Any], stop: int, streams: Mapping[str, np.random.Generator]) -> list[Plan]:
    """Of all samples before the end."""
    r = Fraction(repr(float(timing["clock_ratio"])))
    offset, period = exactly(timing["offset"]) / r, exactly(timing["period"]) / r
    times: list[int] = []
    while len(times) < 2 or times[-2] < stop:  # one more than are taken: the last one's next
        late = lateness(streams["jitter"], timing["jitter"], timing["jitter_distribution"])
        times.append(round(offset + len(times) * period) + late)
    count = len(times) - 1
    deaf = losses(streams["measurement_loss"], timing["measurement_loss"], timing["burst_length"], count)
    mute = losses(streams["command_loss"], timing["command_loss"], timing["burst_length"], count)
    made, last = [], 0
    for k in range(count):
        sent = times[k] if timing["order"] == "gauss-seidel" else times[k + 1]
        late = lateness(streams["delay_jitter"], timing["delay_jitter"], timing["jitter_distribution"])
        arrival = None
        if not mute[k]:
            arrival = last = max(last, sent + round(exactly(timing["delay"])) + late)
        made.append(Plan(k, times[k], sent, arrival, deaf[k]))
    return made


def per_component(values: Mapping[str, float]) -> list[float]:
    """One for each measurement."""
    found = dict.fromkeys(STATE, 0.0)
    for name, value in values.items():
        found.update({each: value for each in STATE if each == name or each.rsplit(".", 1)[0] == name})
    return list(found.values())


class Sensor:
    """What the controller gets of a state."""

    def __init__(self, timing: Mapping[str, Any], stream: np.random.Generator) -> None:
        self.sigma, self.q = per_component(timing["noise"]), per_component(timing["quantisation"])
        self.stream = stream

    def hear(self, state: Sequence[float], before: Sequence[float], deaf: bool) -> list[float]:
        """The measurement of one sample; `before` if it is lost."""
        z = [float(self.stream.standard_normal()) for _ in STATE] if any(self.sigma) else [0.0] * len(STATE)
        if deaf:
            return list(before)
        noisy = [y + s * n if any(self.sigma) else y for y, s, n in zip(state, self.sigma, z, strict=True)]
        return [round(y / q) * q if q else y for y, q in zip(noisy, self.q, strict=True)]


def held(t: int, applied: Sequence[tuple[int, list[float]]], hold: str) -> list[float]:
    """The command from t on, from all that were applied."""
    t1, u1 = applied[-1]
    if hold == "zero" or len(applied) < 2 or t == t1 or applied[-2][0] == t1:
        return u1
    t0, u0 = applied[-2]
    return [b + ((t - t1) / (t1 - t0)) * (b - a) for a, b in zip(u0, u1, strict=True)]


def fly(
    timing: Mapping[str, Any],
    stop_time: float,
    seed: int,
    plant: Callable[[float, float, Sequence[float]], list[float]],
    state: list[float],
    controller: Callable[[float, float, Sequence[float]], list[float]],
    first: list[float],
) -> Seen:
    """Fly `plant(t, h, command) -> state` and `controller(t, h, measurement) -> command`.

    `state` is the plant's as initialisation ends, `first` the controller's answer to it.
    """
    stop, r = round(exactly(stop_time)), float(timing["clock_ratio"])
    streams = generators(seed)
    samples = [plan for plan in plans(timing, stop, streams) if plan.t < stop]
    grid = exactly(timing["plant_interval"])
    points = itertools.takewhile(lambda t: t <= stop, (round(i * grid) for i in itertools.count()))
    arrivals = {p.arrival for p in samples if p.arrival is not None and p.arrival <= stop}
    instants = sorted({*points, *(p.t for p in samples), *arrivals, stop})
    next_sample = dict(itertools.pairwise([*(p.t for p in samples), stop]))

    sensor = Sensor(timing, streams["noise"])
    seen = Seen([], [], [], [])
    known, computed, applied, sent = list(state), first, [(0, first)], {}
    command = first
    for before, t, after in zip([0, *instants], instants, [*instants[1:], stop]):
        if t > 0:
            seen.plant_steps.append((before / 1e9, (t - before) / 1e9))
            state = plant(*seen.plant_steps[-1], command)
        now = next((p for p in samples if p.t == t), None)
        if now is not None:
            known = sensor.hear(state, known, now.deaf)
        if t < stop and (now is not None or timing["clock"] == "fmu"):
            until = after if timing["clock"] == "fmu" else next_sample[t]
            seen.controller_steps.append((r * (t / 1e9), r * ((until - t) / 1e9)))
            computed = controller(*seen.controller_steps[-1], known)
            if now is not None:
                sent[now.k] = computed
        here = [p.k for p in samples if p.arrival == t]
        if here:
            applied.append((t, sent[here[-1]]))
        command = held(t, applied, timing["hold"])
        seen.rows.append(Row(t / 1e9, command, state, computed))
    for p in samples:
        seen.events.extend(happenings(p, stop))
    return seen


def happenings(p: Plan, stop: int) -> list[tuple[int, str, str, int]]:
    """The events of one sample: time, kind, what, index."""
    events = [(p.t, "sampled", "measurement")]
    if p.deaf:
        events.append((p.t, "lost", "measurement"))
    events.append((p.sent, "sent", "command"))
    events.append((p.sent, "lost", "command") if p.arrival is None else (p.arrival, "arrived", "command"))
    return [(*event, p.k) for event in events if event[0] <= stop]
