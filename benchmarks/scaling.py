"""The master's cost of an instant by number of components and connections.

`python -m benchmarks.scaling [--figure FILE]`. The simulators do nothing, so that the time is the master's alone; in
one run, the smallest CPU time of several repetitions.
"""

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.recording.recording import InMemory
from orchestration.simulation.engines.master import Master
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.simulation.figures.lines import plain
from orchestration.simulation.figures.palette import GREY, MARKS
from orchestration.simulation.figures.style import DOCS, save
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System

SIZES = (2, 4, 10, 20, 50, 100, 200)
FITTED = "fitted: a constant, and so much each"
INSTANTS = 200
REPETITIONS = 9
MILLISECOND = 1e-3
PLANT = Component(fmu="none", step=MILLISECOND, record=())
CONTROLLER = Component(fmu="none", sampling=Sampling(period=MILLISECOND), record=())


class Nothing:
    """A simulator that does nothing."""

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        return lambda: None

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        return lambda: None

    def enter_initialization(self, start: float, stop: float) -> None:
        pass

    def exit_initialization(self) -> None:
        pass

    def step(self, t: float, h: float) -> None:
        pass

    def save(self) -> bytes:
        return b""

    def restore(self, state: bytes) -> None:
        pass


def loops(components: int) -> System:
    """Half of the components plants, half controllers, in loops of two: as many connections as components."""
    members: dict[str, Component] = {}
    connections: list[Connection] = []
    for i in range(components // 2):
        members |= {f"plant{i}": PLANT, f"controller{i}": CONTROLLER}
        connections += [
            Connection(name=f"y{i}", start=(f"plant{i}.y",), end=(f"controller{i}.y",)),
            Connection(name=f"u{i}", start=(f"controller{i}.u",), end=(f"plant{i}.u",)),
        ]
    return System(stop_time=INSTANTS * MILLISECOND, components=members, connections=tuple(connections))


def messages(connections: int) -> System:
    """One plant and one controller, with as many messages of one signal each way."""
    there = [
        Connection(name=f"y{i}", start=(f"plant.y{i}",), end=(f"controller.y{i}",)) for i in range(connections // 2)
    ]
    back = [
        Connection(name=f"u{i}", start=(f"controller.u{i}",), end=(f"plant.u{i}",)) for i in range(connections // 2)
    ]
    members = {"plant": PLANT, "controller": CONTROLLER}
    return System(stop_time=INSTANTS * MILLISECOND, components=members, connections=(*there, *back))


def costs(systems: Sequence[System]) -> list[float]:
    """The cost of an instant at which every component steps and every connection carries a message, by system [µs].

    The systems take turns, so that other load of the machine affects all of them equally.
    """
    rounds = [[seconds(system) for system in systems] for _ in range(REPETITIONS)]
    return [min(times) / INSTANTS * 1e6 for times in zip(*rounds)]


def seconds(system: System) -> float:
    """CPU time of one run [s]."""
    streams = Streams(system.seed)
    running = RunningSystem(
        system,
        {name: Nothing() for name in system.components},
        timetable=Timetable(system, streams),
        streams=streams,
        recorded=dict.fromkeys(system.components, ()),
    )
    master = Master(running, InMemory())
    master.initialise()
    start = time.process_time()
    master.run()
    return time.process_time() - start


def main() -> None:
    """Print the costs; draw them if a file is given."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=__doc__)
    parser.add_argument("--figure", type=Path, help="where to draw it")
    file = parser.parse_args().figure
    made = {"components, in loops of two": loops, "connections between two components": messages}
    with DOCS.applied():
        figure = _measured(made)
    if file is not None:
        save({file.stem: figure}, file.parent, DOCS)


def _measured(made: Mapping[str, Callable[[int], System]]) -> Figure:
    """The costs, printed and drawn."""
    figure = DOCS.figure(25.0)
    axes = figure.add_subplot()
    for (what, make), mark in zip(made.items(), MARKS):
        found = costs([make(size) for size in SIZES])
        slope, constant = np.polyfit(SIZES, found, 1, w=1.0 / np.array(found))
        exponent = np.polyfit(np.log(SIZES[2:]), np.log(found[2:]), 1)[0]
        print(f"{what}: {slope:.2f} µs each and {constant:.1f} µs; from 10 to 200 as the power {exponent:.2f}")
        for size, value in zip(SIZES, found, strict=True):
            print(f"{size:>6} {value:10.1f} µs an instant {value / size:8.2f} µs each")
        line = slope * np.array(SIZES) + constant
        axes.loglog(SIZES, line, color=GREY, linewidth=1.0, zorder=1, label="_" if axes.lines else FITTED)
        axes.loglog(SIZES, found, mark, label=f"{what}: {slope:.2f} µs each")
    axes.set(xlabel="how many", ylabel="the master's cost of an instant [µs]")
    handles, labels = axes.get_legend_handles_labels()
    axes.legend([*handles[1:], handles[0]], [*labels[1:], labels[0]])
    plain(axes.xaxis)
    plain(axes.yaxis)
    return figure


if __name__ == "__main__":
    main()
