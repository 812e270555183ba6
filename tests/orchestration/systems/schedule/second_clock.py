"""A second clock, written from `docs/timing.md`: nothing of the project is imported here.

It makes all samples and messages of a system before it runs, where the project's clock makes each from the one before.
"""

import hashlib
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

C0, C1 = 0.0013498980316301035, 0.9986501019683699
Values = dict[str, float]
System = Mapping[str, Any]
"""The tables of a file, as dictionaries; `start` and `end` of a connection are its `from` and `to`."""


class Model(NamedTuple):
    """A component: its outputs as initialisation ends, and `move(t, h, inputs) -> outputs`."""

    first: Values
    move: Callable[[float, float, Values], Values]


class Step(NamedTuple):
    """A step of a component, with its inputs."""

    t: float
    h: float
    inputs: Values


class Seen(NamedTuple):
    """The steps, rows and events of a run."""

    rows: list[Values]
    steps: dict[str, list[Step]]
    events: list[tuple[int, str, str, int]]


class Message(NamedTuple):
    """Message k of a connection, with all its random numbers."""

    k: int
    sent: int
    """when it leaves or, of a reading, is read"""
    arrival: int
    lost: bool
    z: list[float]


# -- times and numbers ----------------------------------------------------------------------------------------


def exactly(seconds: float) -> Fraction:
    """The decimal that a double stands for, in nanoseconds."""
    decimal = Fraction(repr(float(seconds))) * 10**9
    return Fraction(round(decimal)) if abs(decimal - round(decimal)) <= abs(round(decimal)) / 2**50 else decimal


def points(step: float, after: int) -> list[int]:
    """Of a component's own grid, up to the first that is not before `after`."""
    period = exactly(step)
    found = [0]
    while found[-1] < after:
        found.append(round(len(found) * period))
    return found


def stream(system: System, name: str) -> np.random.Generator:
    """The random numbers of one cause."""
    seed, numbered = system["seed"], system["streams"]
    if name in numbered:
        sequence = np.random.SeedSequence(seed).spawn(numbered[name] + 1)[-1]
    else:
        digest = hashlib.sha256(name.encode()).digest()
        words = tuple(int.from_bytes(digest[i : i + 4], "big") for i in (0, 4, 8, 12))
        sequence = np.random.SeedSequence(seed, spawn_key=words)
    return np.random.Generator(np.random.PCG64(sequence))


def uniform(numbers: np.random.Generator) -> float:
    """From the next word of the stream."""
    return (int(numbers.bit_generator.random_raw()) >> 11) * 2.0**-53


def drawn(numbers: np.random.Generator, given: Any, k: int) -> float | Fraction:
    """The k-th number of a distribution; a span is of whole nanoseconds, everything else as given."""
    if isinstance(given, (int, float)):
        return given
    if given["file"] is not None:
        header, *rows = [line.split(",") for line in given["file"].read_text().split()]
        table = [float(row[header.index(given["column"])]) for row in rows]
        if given["order"] == "as recorded":
            return table[k % len(table)]
    elif given["values"] is not None:
        table = list(given["values"])
    u = uniform(numbers)
    if given["uniform"] is not None:
        a, b = (round(exactly(end)) for end in given["uniform"])
        return Fraction(a + math.floor(u * (b - a)), 10**9)
    if given["normal"] is not None:
        (m, s), (a, b) = given["normal"], given["range"]
        p, q = (math.erfc((m - end) / (s * math.sqrt(2.0))) / 2.0 for end in (a, b))
        x = math.floor((m + s * NormalDist().inv_cdf(p + u * (q - p))) * 1e9)
        return Fraction(min(max(x, round(exactly(a))), round(exactly(b))), 10**9)
    if given["probabilities"] is None:
        return table[math.floor(u * len(table))]
    sums = list(itertools.accumulate(given["probabilities"]))
    return table[next(i for i, total in enumerate(sums) if u < total)]


def longest(given: Any) -> Fraction:
    """The largest value, in nanoseconds."""
    if isinstance(given, (int, float)):
        return exactly(given)
    if given["file"] is not None:
        return max(longest(drawn(np.random.default_rng(), given | {"order": "as recorded"}, k)) for k in range(99))
    return exactly(max(given["values"] or given["uniform"] or given["range"]))


def whole(seconds: float | Fraction) -> int:
    """In nanoseconds."""
    return round(seconds * 10**9 if isinstance(seconds, Fraction) else exactly(seconds))


def lateness(numbers: np.random.Generator, largest: Any, distribution: str, k: int) -> int:
    """Of sample or message k, in nanoseconds."""
    if largest == 0:
        return 0
    if isinstance(largest, dict):
        return whole(drawn(numbers, largest, k))
    u = uniform(numbers)
    if distribution == "normal":
        u = min(max(NormalDist(0.5, 1 / 6).inv_cdf(C0 + u * (C1 - C0)), 0.0), 1.0)
    return math.floor(u * round(exactly(largest)))


def losses(numbers: np.random.Generator, p: Any, n: float | None, count: int) -> list[bool]:
    """Of the first `count` messages."""
    if isinstance(p, dict):
        return [drawn(numbers, p, k) == 1 for k in range(count)]
    if p == 0:
        return [False] * count
    lost: list[bool] = []
    for _ in range(count):
        u = uniform(numbers)
        if n is None or p == 1 or not lost:
            lost.append(u < p)
        elif lost[-1]:
            lost.append(u >= 1 / n)
        else:
            lost.append(u < p / (n * (1 - p)))
    return lost


# -- the timetable, before any step ---------------------------------------------------------------------------


class Wire:
    """A connection: its kind, and the conversion of the values of a message."""

    def __init__(self, system: System, given: Mapping[str, Any]) -> None:
        self.given = given
        self.name: str = given["name"]
        self.sender, self.receiver = (given[end][0].partition(".")[0] for end in ("start", "end"))
        self.outputs, self.inputs = ([each.partition(".")[2] for each in given[end]] for end in ("start", "end"))
        self.sigma, self.q = (self.by_output(given[key]) for key in ("noise", "quantisation"))
        tasks = [name for name, c in system["components"].items() if c["sampling"] is not None]
        self.is_sent = self.sender in tasks
        self.is_read = not self.is_sent and self.receiver in tasks
        dull = not any(given[key] for key in ("delay", "delay_jitter", "loss")) and given["hold"] == "zero"
        dull = dull and not any(self.sigma) and not any(self.q)
        self.is_plain = not self.is_sent and not self.is_read and dull
        self.is_prompt = given["order"] == "gauss-seidel" and not given["delay"] and not given["delay_jitter"]

    def by_output(self, values: Values) -> list[float]:
        """One for each signal; a vector's name stands for its components."""
        found = dict.fromkeys(self.outputs, 0.0)
        for name, value in values.items():
            found.update({each: value for each in found if each == name or each.rsplit(".", 1)[0] == name})
        return list(found.values())

    def carried(self, outputs: Values, z: Sequence[float] | None = None, rounded: bool = True) -> list[float]:
        """The received values of the outputs of the sender."""
        m = [outputs[name] for name in self.outputs]
        if z is not None and any(self.sigma):
            m = [y + s * n for y, s, n in zip(m, self.sigma, z, strict=True)]
        if rounded:
            m = [round(y / q) * q if q else y for y, q in zip(m, self.q, strict=True)]
        scale, offset = self.given["scale"], self.given["offset"]
        return m if (scale, offset) == (1.0, 0.0) else [scale * y + offset for y in m]


def samples(system: System, name: str, until: int, grids: Iterable[float]) -> list[int]:
    """Of a task, two or more beyond `until`; `grids` are the steps of what it reads and must wait for."""
    sampling = system["components"][name]["sampling"]
    numbers = stream(system, f"components.{name}.jitter")
    r = Fraction(repr(float(sampling["clock_ratio"])))
    offset, period = exactly(sampling["offset"]) / r, exactly(sampling["period"]) / r
    times: list[int] = []
    while len(times) < 2 or times[-2] <= until:
        late = lateness(numbers, sampling["jitter"], sampling["jitter_distribution"], len(times))
        t = round(offset + len(times) * period) + late
        while t < until and any(t not in points(step, t) for step in grids):
            t = max(points(step, t)[-1] for step in grids)
        times.append(t)
    return times


def leaving(system: System, wire: Wire, times: Mapping[str, list[int]], stop: int) -> list[int]:
    """When each message leaves; of a reading, when it is to be there."""
    if wire.is_read:
        return times[wire.receiver]
    if wire.is_sent:
        own = times[wire.sender]
        taken = [k for k, t in enumerate(own) if t < stop]
        return [own[k] if wire.given["order"] == "gauss-seidel" else own[k + 1] for k in taken]
    return [t for t in points(system["components"][wire.sender]["step"], stop) if t <= stop]


def messages(
    system: System, wire: Wire, instants: Sequence[int], stop: int, grids: Mapping[str, float]
) -> list[Message]:
    """All of a connection; `grids` are the steps of components that move what happens to them to their next point."""
    given = wire.given
    causes = ("loss", "delay", "delay_jitter", "noise")
    numbers = {kind: stream(system, f"connections.{wire.name}.{kind}") for kind in causes}
    lost = losses(numbers["loss"], given["loss"], given["burst_length"], len(instants))
    moved = grids.get(wire.sender if wire.is_read else wire.receiver)
    made, last = [], 0
    for k, t in enumerate(instants):
        late = whole(drawn(numbers["delay"], given["delay"], k))
        late += lateness(numbers["delay_jitter"], given["delay_jitter"], given["jitter_distribution"], k)
        then = max(last, t - late if wire.is_read else t + late)
        then = then if moved is None else points(moved, then)[-1]
        last = last if lost[k] and not wire.is_read else then
        z = [float(numbers["noise"].standard_normal()) for _ in wire.outputs] if any(wire.sigma) else []
        made.append(Message(k, then, t, lost[k], z) if wire.is_read else Message(k, t, then, lost[k], z))
    return [m for m in made if m.sent < stop or not wire.is_read]


def turns(names: Sequence[str], feeds: Iterable[tuple[str, str]]) -> list[str]:
    """The order of components: `feeds` in the order of the file, without those that would close a cycle."""
    before: dict[str, set[str]] = {name: set() for name in names}

    def waits_for(name: str) -> set[str]:
        return {name}.union(*(waits_for(other) for other in before[name]))

    for sender, receiver in feeds:
        if receiver not in waits_for(sender):
            before[receiver].add(sender)
    order: list[str] = []
    while len(order) < len(names):
        order.append(next(name for name in names if name not in order and before[name] <= set(order)))
    return order


# -- the run ----------------------------------------------------------------------------------------------------


def held(t: int, applied: Sequence[tuple[int, list[float]]], hold: str) -> list[float]:
    """The held value at t, from all arrivals."""
    t1, u1 = applied[-1]
    if hold == "zero" or len(applied) < 2 or t == t1:
        return u1
    t0, u0 = applied[-2]
    return [b + ((t - t1) / (t1 - t0)) * (b - a) for a, b in zip(u0, u1, strict=True)]


class Run:
    """A system with its timetable, to be run once."""

    def __init__(self, system: System, models: Mapping[str, Model], fixed: Iterable[str] = ()) -> None:
        self.models, self.components = models, system["components"]
        self.stop = round(exactly(system["stop_time"]))
        self.wires = [Wire(system, given) for given in system["connections"]]
        grids = {name: self.components[name]["step"] for name in fixed}
        self.times: dict[str, list[int]] = {}
        for name in (name for name, c in self.components.items() if c["sampling"] is not None):
            read = [wire for wire in self.wires if wire.is_read and wire.receiver == name]
            latest = max((longest(w.given["delay"]) + longest(w.given["delay_jitter"]) for w in read), default=0)
            waits = [grids[wire.sender] for wire in read if wire.sender in grids]
            self.times[name] = samples(system, name, self.stop + math.ceil(latest), waits)
        self.sent = {
            wire.name: messages(system, wire, leaving(system, wire, self.times, self.stop), self.stop, grids)
            for wire in self.wires
            if not wire.is_plain
        }
        self.halts = {name: self.halts_of(name, c["step"]) for name, c in self.components.items() if c["step"]}
        self.movers = turns(list(self.halts), self.feeds(lambda w: w.is_plain and w.given["order"] == "gauss-seidel"))
        self.tasks = turns(list(self.times), self.feeds(lambda w: w.receiver in self.times and w.is_prompt))
        self.instants = self.all_instants()

        self.outputs = {name: dict(model.first) for name, model in models.items()}
        self.applied = {w.name: [(0, w.carried(self.outputs[w.sender], rounded=False))] for w in self.wires}
        self.inputs: dict[str, Values] = {name: {} for name in self.components}
        for wire in self.wires:
            self.inputs[wire.receiver] |= dict(zip(wire.inputs, self.applied[wire.name][0][1], strict=True))
        self.content: dict[tuple[str, int], list[float]] = {}
        self.leaving: dict[int, list[tuple[Wire, Message]]] = {t: [] for t in self.instants}
        self.arriving: dict[int, list[tuple[Wire, Message]]] = {t: [] for t in self.instants}
        for wire in self.wires:
            for m in self.sent.get(wire.name, ()):
                if not wire.is_sent and m.sent <= self.stop:
                    self.leaving[m.sent].append((wire, m))
                if not m.lost and m.arrival <= self.stop:
                    self.arriving[m.arrival].append((wire, m))
        self.halted = dict.fromkeys(self.halts, 0)
        self.seen = Seen([], {name: [] for name in self.components}, [])

    def feeds(self, count: Callable[[Wire], bool]) -> list[tuple[str, str]]:
        """The pairs of components over the connections that determine the order."""
        tasks = self.times
        return [(w.sender, w.receiver) for w in self.wires if count(w) and (w.sender in tasks) == (w.receiver in tasks)]

    def halts_of(self, name: str, step: float) -> set[int]:
        """The communication points of a component in continuous time."""
        found = {*points(step, self.stop), self.stop}
        for wire in self.wires:
            if not wire.is_plain and wire.receiver == name:
                found |= {m.arrival for m in self.sent[wire.name] if not m.lost}
            if wire.is_read and wire.sender == name:
                found |= {m.sent for m in self.sent[wire.name]}
        return {t for t in found if t <= self.stop}

    def all_instants(self) -> list[int]:
        """Of the run."""
        found = {0, self.stop, *itertools.chain(*self.halts.values(), *self.times.values())}
        for each in itertools.chain(*self.sent.values()):
            found |= {each.sent} if each.lost else {each.sent, each.arrival}
        return sorted(t for t in found if t <= self.stop)

    def run(self) -> Seen:
        """Run it."""
        for t, after in zip(self.instants, [*self.instants[1:], self.stop], strict=True):
            here = [name for name in self.movers if t in self.halts[name]]
            for name in here if t > 0 else ():
                self.move(name, t)
            for wire, m in self.leaving[t]:
                self.content[wire.name, m.k] = wire.carried(self.outputs[wire.sender], m.z)
            self.deliver(t)
            for name in self.tasks:
                self.sample(name, t, after)
            for name in here:
                self.take(name, t)
                self.look(name, behind=True)
            self.record(t)
        for wire in self.wires:
            self.seen.events.extend(e for m in self.sent.get(wire.name, ()) for e in self.events_of(wire, m))
        self.seen.events.sort()
        return self.seen

    def move(self, name: str, t: int) -> None:
        """Step a component in continuous time from its last communication point."""
        self.look(name, behind=False)
        start, self.halted[name] = self.halted[name], t
        self.step(name, start / 1e9, (t - start) / 1e9)

    def look(self, name: str, behind: bool) -> None:
        """Take values over plain connections: those over the next step (`behind`), or of earlier components."""
        earlier = self.movers[: self.movers.index(name)]
        for wire in self.wires:
            newest = wire.sender in earlier and wire.given["order"] == "gauss-seidel"
            if wire.is_plain and wire.receiver == name and newest != behind:
                values = wire.carried(self.outputs[wire.sender])
                self.inputs[name] |= dict(zip(wire.inputs, values, strict=True))

    def step(self, name: str, t: float, h: float) -> None:
        """Step a component with its inputs."""
        self.seen.steps[name].append(Step(t, h, dict(self.inputs[name])))
        self.outputs[name] = dict(self.models[name].move(t, h, self.inputs[name]))

    def deliver(self, t: int) -> None:
        """The messages that arrive now and are sent."""
        for wire, m in self.arriving[t]:
            applied = self.applied[wire.name]
            if (wire.name, m.k) in self.content:
                self.applied[wire.name] = [each for each in applied if each[0] < t][-1:]
                self.applied[wire.name].append((t, self.content[wire.name, m.k]))

    def take(self, name: str, t: int) -> None:
        """Set the inputs of a component to its received values."""
        for wire in self.wires:
            if wire.receiver == name and not wire.is_plain:
                values = held(t, self.applied[wire.name], wire.given["hold"])
                self.inputs[name] |= dict(zip(wire.inputs, values, strict=True))

    def sample(self, name: str, t: int, after: int) -> None:
        """Step a task, if it is due or keeps its own clock."""
        times, sampling = self.times[name], self.components[name]["sampling"]
        own, k = sampling["clock"] == "fmu", next((k for k, time in enumerate(times) if time == t), None)
        if t == self.stop or (k is None and not own):
            return
        self.take(name, t)
        until = after if own or k is None else min(times[k + 1], self.stop)
        r = float(sampling["clock_ratio"])
        self.step(name, r * (t / 1e9), r * ((until - t) / 1e9))
        for wire in self.wires:
            if wire.sender == name and k is not None:
                self.content[wire.name, k] = wire.carried(self.outputs[name], self.sent[wire.name][k].z)
        self.deliver(t)

    def record(self, t: int) -> None:
        """The row: inputs of components in continuous time, outputs of all."""
        row = {"time": t / 1e9}
        for name in self.components:
            if name in self.halts:
                row |= {f"{name}.{key}": value for key, value in self.inputs[name].items()}
            row |= {f"{name}.{key}": value for key, value in self.outputs[name].items()}
        self.seen.rows.append(row)

    def events_of(self, wire: Wire, m: Message) -> list[tuple[int, str, str, int]]:
        """The events of one message: time, kind, connection, index."""
        if wire.is_read and m.arrival >= self.stop:
            return []
        events = [(m.sent, "sampled" if wire.is_read else "sent")]
        if m.lost:
            events.append((m.sent, "lost"))
        elif not wire.is_read:
            events.append((m.arrival, "arrived"))
        return [(t, kind, wire.name, m.k) for t, kind in events if t <= self.stop]


def run(system: System, models: Mapping[str, Model], fixed: Iterable[str] = ()) -> Seen:
    """Run `system`, in which the components in `fixed` have a fixed step."""
    return Run(system, models, fixed).run()
