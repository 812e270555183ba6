"""A batch of runs that waits wherever one component is to be stepped, whose outputs the caller computes."""

from collections.abc import Mapping, Sequence

import numpy as np

from orchestration.foundation.basics.errors import Named, SimulatorError, UsageError
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.foundation.basics.times import seconds
from orchestration.simulation.engines.batch.batch import Batch, Group
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.systems.expressions.syntax import Call
from orchestration.systems.schedule.schedule_cache import ScheduleCache

_NOTHING_KNOWN: Mapping[Call, Floats] = {}


class SteppedBatch(Batch):
    """Runs in lanes, step by step, in which the caller computes the outputs of one component."""

    def __init__(
        self, shape: Shape, schedules: ScheduleCache, measured: Sequence[str], commanded: Sequence[str]
    ) -> None:
        """`measured` and `commanded` are the names of the inputs and outputs of `shape.replaced` that are connected."""
        super().__init__(shape, schedules)
        if not hasattr(self._library, "proceed"):
            raise UsageError("runs in lanes that are stepped: expected Linux with the C library of GNU")
        component = str(shape.replaced)  # it has no code to step it: C waits there
        index, model = shape.names.index(component), shape.models[component]
        self._memory = self.arrays.memories[index]
        self._inputs = np.array([model.variables[name].reference for name in measured], dtype=np.int64)
        self._outputs = np.array([model.variables[name].reference for name in commanded], dtype=np.int64)
        self._into = [
            (i, [measured.index(end.partition(".")[2]) for end in x.end])
            for i, x in enumerate(shape.system.connections)
            if x.receiver == component
        ]
        places = {int(reference): i for i, reference in enumerate(self._inputs)}
        self._fed = [(number, places[place]) for number, place in shape.fed[component] if place in places]
        """Numbers of the values that sources give, and the places in a measurement that get them"""
        seen = zip((name for names in shape.seen.values() for name in names), self.arrays.seen)
        self._views: dict[str, Floats] = {"time": np.zeros(shape.lanes), **dict(seen)}
        columns = [column for column in shape.board.columns if column != "time"]
        self._places = Named({column: shape.place(column) for column in columns})
        self.count = 0
        """The number of runs; the others of its lanes are empty"""

    def begin(self, group: Group, initial: Floats) -> None:
        """Begin the runs of a group, and run them to the first step of the component.

        `initial` are its outputs until then, shape (outputs, runs).
        """
        self.numbers.columns = group.parameters
        self.count = len(group.systems)
        self._stops = [system.stop_time for system in group.systems]
        padding = self._shape.lanes - self.count
        self._initialisation.outputs = self._outputs, np.pad(initial, ((0, 0), (0, padding)))
        self._set_out(group, _NOTHING_KNOWN)
        self._record(None, self.count)
        self.proceed()

    def proceed(self) -> None:
        """Run to the next step of the component, or to the end; `command` has set what it computed."""
        if self._call(self._library.proceed) != self._c.AWAITS:
            self._loop.awaiting = 0

    def leave(self, lanes: Sequence[int]) -> None:
        """End runs before their time."""
        for lane in lanes:
            self._loop.alive &= ~(1 << lane)

    @property
    def all_wait(self) -> bool:
        """Whether all runs wait for a command."""
        return bool(self._loop.awaiting & self._loop.alive == (1 << self.count) - 1)

    @property
    def waiting(self) -> Booleans:
        """Whether each run waits for a command; the others are over."""
        bits = self._loop.awaiting & self._loop.alive
        return np.array([bits >> lane & 1 for lane in range(self.count)], dtype=np.bool_)

    def diverged(self, lanes: Integers, places: Integers) -> Booleans:
        """Whether runs in these lanes have diverged; raises `SimulatorError`, with its place, for one that failed."""
        outcomes = np.array(self._loop.outcome[: self.count])[lanes]
        for i in np.flatnonzero((outcomes != self._c.RUNNING) & (outcomes != self._c.DIVERGED)).tolist():
            time = seconds(self._loop.outcome_time[lanes[i]])
            raise SimulatorError(
                f"run {places[i]}, counted from 0, has failed in lanes at t = {time:g} s, for its FMUs cannot compute "
                "a step; alone, with the same seed and values, it says which and why"
            )
        diverged: Booleans = outcomes == self._c.DIVERGED
        return diverged

    @property
    def measurement(self) -> Floats:
        """The measurement of each run, shape (runs, inputs)."""
        measured: Floats = self._memory[self._inputs, : self.count].T
        return measured

    def measurement_at_end(self) -> Floats:
        """The true values of the inputs now, as at the end of a run, where the component is not stepped."""
        values: Floats = self.measurement.copy()
        for i, places in self._into:
            sender = self.arrays.memories[self._shape.names.index(self._shape.system.connections[i].sender)]
            sent = self._initialisation.received_values(i, self._initialisation.sent_values(i, sender))
            values[:, places] = sent.T[: self.count]
        for lane in np.flatnonzero(~self.waiting).tolist() if self._fed else ():
            has_diverged = self._loop.outcome[lane] == self._c.DIVERGED
            t = seconds(self._loop.outcome_time[lane]) if has_diverged else self._stops[lane]
            given = [value for source in self._runs[lane].given for value in source.at(t)]
            for number, place in self._fed:
                values[lane, place] = given[number]
        return values

    def command(self, values: Floats) -> None:
        """Set the outputs of the component in each lane, shape (outputs, lanes)."""
        self._memory[self._outputs] = values

    def value(self, name: str) -> Floats:
        """The value now of a column, of a signal of a source that the system's expressions name, or of `time` [s].

        It has one for each lane, and changes with them.
        """
        if name not in self._views:
            index, place = self._places[name]
            self._views[name] = self.arrays.memories[index][place]
        if name == "time":
            for track in self._tracks:
                self._views[name][track.lanes] = seconds(int(track.now.max(initial=0)))
        return self._views[name]
