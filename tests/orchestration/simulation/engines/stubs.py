"""Small simulators that record how they are called."""

import numpy as np

from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System


class Stub:
    """A simulator with named values; `move(values, t, h)` is its step."""

    def __init__(self, move=lambda values, t, h: None, **values):
        self.values, self.move, self.steps, self.calls = dict(values), move, [], []

    def reader(self, names, into):
        def read():
            into[:] = [self.values[name] for name in names]

        return read

    def writer(self, names, source):
        def write():
            self.values |= dict(zip(names, source.tolist()))

        return write

    def enter_initialization(self, start, stop):
        self.calls.append("enter")

    def exit_initialization(self):
        self.calls.append("exit")

    def step(self, t, h):
        self.steps.append((t, h, dict(self.values)))
        self.move(self.values, t, h)

    def save(self):
        return repr(self.values).encode()

    def restore(self, state):
        self.values = eval(state)


class Direct(Stub):
    """One whose output y follows its input u at once, by a rule."""

    def __init__(self, rule, **values):
        super().__init__(**values)
        self.rule = rule

    def reader(self, names, into):
        read = super().reader(names, into)
        return lambda: (self.values.update(y=self.rule(self.values["u"])), read())


def clock(values, t, h):
    """A component whose output is the time it has reached."""
    values["y"] = t + h


def continuous(step=0.1, **keys):
    return Component(fmu="stub", step=step, **keys)


def sampled(period=0.1, **keys):
    return Component(fmu="stub", sampling=Sampling(period=period, **keys))


def wire(start, end, name=None, **keys):
    starts, ends = ([start], [end]) if isinstance(start, str) else (start, end)
    return Connection(name=name or f"{starts[0]}>{ends[0]}", start=tuple(starts), end=tuple(ends), **keys)


def system(components, connections=(), stop_time=1.0, **keys):
    return System(stop_time=stop_time, components=components, connections=tuple(connections), **keys)


def column(master, name):
    """A column of what a master has recorded in memory."""
    chunks = master.recorder.chunks()
    return np.concatenate([chunk.rows[:, chunk.columns.index(name)] for chunk in chunks])


def events(master):
    """What happened, in order of time."""
    return [event for chunk in master.recorder.chunks() for event in chunk.events]


def near(values):
    return np.round(np.asarray(values, dtype=float), 9).tolist()
