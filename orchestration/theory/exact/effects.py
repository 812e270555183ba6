"""The effects of events on the state of a loop: time passes, messages are sent and arrive, tasks sample.

The numbers of the loop in it are: the states of components in continuous time; of each connection the value received
last, and of a first-order hold its slope and the last arrival; of tasks their states and outputs. As simulated, held
noise and outputs as of the last step follow.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.engines.wiring_by_index import of_each
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.connection import Connection, component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.theory.exact.branch import BranchEvent, Piece
from orchestration.theory.exact.flows import Flows
from orchestration.theory.exact.initial_state import InitialState
from orchestration.theory.exact.objectives import Mean
from orchestration.theory.exact.random_times import ATTOSECONDS
from orchestration.theory.stability.matrices import Components, Continuous, SampledSystem


class Places:
    """The layout of the state."""

    def __init__(self) -> None:
        self.size = 0
        self._known: dict[tuple[str, str], slice] = {}

    def add(self, kind: str, name: str, count: int) -> None:
        """Append numbers."""
        self._known[kind, name] = slice(self.size, self.size + count)
        self.size += count

    def __call__(self, kind: str, name: str) -> slice:
        """The place of the numbers of a kind of a component or connection."""
        return self._known[kind, name]

    def has(self, kind: str, name: str) -> bool:
        """Whether the state has such numbers."""
        return (kind, name) in self._known


class LoopEffects(ABC):
    """What events do to the state: the numbers of the loop, followed by those of the messages in transit, in order."""

    def __init__(
        self,
        system: System,
        components: Components,
        tasks: Sequence[str],
        *,
        with_means: bool = False,
        steps: Mapping[str, float] | None = None,
    ) -> None:
        """`with_means` one number of the state is the constant 1, so that second moments contain means.

        Then sources, by name, may take `steps` from rest at the begin.
        """
        self.system, self.parts, self.tasks = system, components, list(tasks)
        self.places = places = Places()
        self._plan = Plan(system)
        self.wires = {system.connections[i].name for i in self._plan.wires}
        self.fed_by = {end: (x, j) for x in system.connections for j, end in enumerate(x.end)}
        self.continuous = {n: c for n, c in components.items() if isinstance(c, Continuous)}
        self.sampled_parts = {n: c for n, c in components.items() if isinstance(c, SampledSystem)}
        for name, part in self.continuous.items():
            places.add("state", name, len(part.A))
        for x in system.connections:
            if x.name not in self.wires or self.holds_wires:
                places.add("received", x.name, len(x.start))
            if x.hold == "first":
                places.add("slope", x.name, len(x.start))
                places.add("last", x.name, len(x.start))
        for name, task in self.sampled_parts.items():
            places.add("state", name, len(task.A))
            places.add("output", name, len(task.outputs))
        self._add_more_places(places)
        if with_means:
            places.add("constant", "", 1)
        self.size = places.size
        self.costs = 0
        self._noise = {x.name: _noise_of(x) for x in system.connections}
        self._steps = steps or {}
        self._stepped = {end: step for name, step in self._steps.items() for end in system.sources[name].to}
        for end in self._stepped:
            if variable_of(end) not in components[component_of(end)].inputs:
                raise UsageError(f"{end} takes a step: expected a Real input")

    holds_wires = False
    """whether the value of a wire is held from step to step"""

    @abstractmethod
    def _add_more_places(self, places: Places) -> None:
        """Add the places of a subclass."""

    @property
    def grids(self) -> Sequence[Fraction]:
        """Periods [s] of points at which it ticks."""
        return ()

    @abstractmethod
    def charge(self, means: Sequence[Mean]) -> None:
        """Set the costs to the time integrals of these means."""

    def initial_vector(self, initial: InitialState) -> Floats:
        """The initial state as one vector."""
        vector = np.zeros(self.size)
        vector[self.places("constant", "")] = 1.0
        for name in self.parts:
            vector[self.places("state", name)] = initial.states[name]
            if self.places.has("output", name):
                vector[self.places("output", name)] = initial.outputs[name]
        for x in self.system.connections:
            for kind in ("received", "last"):
                if self.places.has(kind, x.name):
                    vector[self.places(kind, x.name)] = initial.received[x.name]
        return vector

    def quadratic_form(self, mean: Mean, rows: Floats) -> Floats:
        """Q of z'Q z, the integrand of a mean by the rows of its signals, without its constant.

        Without a constant 1 in the state, it is also without its linear part, whose stationary mean is 0.
        """
        found: Floats = rows.T @ mean.Q @ rows
        if self.places.has("constant", ""):
            linear = np.outer(rows.T @ mean.g, self.row("constant", "", 0))
            found += 0.5 * (linear + linear.T)
        return found

    # -- rows over the state -------------------------------------------------------------------------------------

    def row(self, kind: str, name: str, j: int) -> Floats:
        """The row that selects one number."""
        row: Floats = np.zeros(self.size)
        row[self.places(kind, name).start + j] = 1.0
        return row

    def signal_row(self, name: str) -> Floats:
        """The row of a signal, COMPONENT.VARIABLE or of a source; zero for a constant one.

        Raises `UsageError` for an unknown one.
        """
        owner, variable = component_of(name), variable_of(name)
        if owner in self.system.sources:
            return self._source_row(name)
        part = self.parts.get(owner)
        if part is None:
            raise UsageError(f"the linear loop has no {name}")
        if variable in part.outputs:
            return self.output_row(owner, part.outputs.index(variable))
        return self.input_row(name)

    def input_row(self, end: str) -> Floats:
        """The row of an input."""
        if end in self.fed_by:
            x, j = self.fed_by[end]
            if self.places.has("received", x.name):
                return self.row("received", x.name, j)
            sender = self.continuous[x.sender]
            return x.scale * self.output_row(x.sender, sender.outputs.index(variable_of(x.start[j])))
        return self._step_row(self._stepped.get(end, 0.0))

    def input_rows(self, name: str) -> Floats:
        """The rows of all inputs of a component."""
        ends = self.parts[name].inputs
        return np.array([self.input_row(f"{name}.{end}") for end in ends]).reshape(len(ends), self.size)

    def output_row(self, name: str, j: int) -> Floats:
        """The row of an output of a component."""
        if name in self.sampled_parts:
            return self.row("output", name, j)
        return self._continuous_output_row(name, j)

    @abstractmethod
    def _continuous_output_row(self, name: str, j: int) -> Floats:
        """The row of an output of a component in continuous time."""

    def _source_row(self, name: str) -> Floats:
        return self._step_row(self._steps.get(component_of(name), 0.0))

    def _step_row(self, step: float) -> Floats:
        """The row of what takes a step from rest at the begin; 0: none."""
        return step * self.row("constant", "", 0) if step else np.zeros(self.size)

    # -- events ---------------------------------------------------------------------------------------------------

    def start(self, in_transit: Sequence[int]) -> Piece:
        """No time, with messages of these links in transit."""
        return Piece.start(self.size + sum(len(self.system.connections[i].start) for i in in_transit), self.costs)

    def send(self, piece: Piece, link: int, at: int) -> Piece:
        """A message is put among the numbers of those in transit, at number `at`."""
        x = self.system.connections[link]
        rows = self._message_rows(x)
        message = np.hstack([rows, np.zeros((len(rows), len(piece.Z) - self.size))])
        return self._with_message(piece, message, self._noise[x.name], at)

    def repeat(self, piece: Piece, link: int, at: int, last: int | None) -> Piece:
        """The message before is put there again: number `last` of those in transit; None: it has arrived."""
        x = self.system.connections[link]
        first = self.places("received", x.name).start if last is None else self.size + last
        message = np.eye(len(piece.Z))[first : first + len(x.start)]
        return self._with_message(piece, message, np.zeros(len(message)), at)

    def _with_message(self, piece: Piece, message: Floats, variances: Floats, at: int) -> Piece:
        first, known = self.size + at, np.eye(len(piece.Z))
        change = np.vstack([known[:first], message, known[first:]])
        noise = np.zeros(len(change))
        noise[first : first + len(message)] = variances
        return piece.mapped(change, np.diag(noise))

    def _message_rows(self, x: Connection) -> Floats:
        """The rows of a message as it is sent."""
        return np.array([x.scale * self._message_row(start) for start in x.start]).reshape(len(x.start), self.size)

    def _message_row(self, start: str) -> Floats:
        """The row of an output as it is sent."""
        owner, variable = component_of(start), variable_of(start)
        outputs = self.parts[owner].outputs
        return self.output_row(owner, outputs.index(variable)) if variable in outputs else np.zeros(self.size)

    def receive(self, piece: Piece, link: int, since: int, gap: int | None) -> Piece:
        """The first message in transit arrives, and leaves the state.

        The one before arrived `since` ago. Where that is 0, it arrived `gap` after the one before it.
        """
        x = self.system.connections[link]
        size, leaves = len(piece.Z), slice(self.size, self.size + len(x.start))
        message = np.eye(size)[leaves]
        change = np.eye(size)
        change[self.places("received", x.name)] = message
        if x.hold == "first":
            slope, last = self.places("slope", x.name), self.places("last", x.name)
            before = np.eye(size)[last]
            if since > 0:
                change[slope] = (message - before) * (ATTOSECONDS / since)
            elif gap is not None:  # it replaces one that arrived at the same instant
                change[slope] += (message - before) * (ATTOSECONDS / gap)
            change[last] = message
        return piece.mapped(np.delete(change, leaves, axis=0))

    def sample(self, piece: Piece, task: int, number: int) -> Piece:
        """A task takes a sample of a number."""
        name = self.tasks[task]
        turns = self.sampled_parts[name].turns
        part = turns[number % len(turns)]
        size = len(piece.Z)
        state, output = self.places("state", name), self.places("output", name)
        inputs = self.input_rows(name)
        before = np.eye(self.size)[state]
        change = np.eye(size)
        change[output, : self.size] = part.C @ before + part.D @ inputs
        change[state, : self.size] = part.A @ before + part.B @ inputs
        return piece.mapped(change)

    @abstractmethod
    def advance(self, piece: Piece, duration: int) -> Piece:
        """Time passes."""

    def tick(self, piece: Piece, grid: int) -> Piece:
        """A point of a grid of known times is reached."""
        return piece

    def done(self, piece: Piece, event: BranchEvent, in_transit: Sequence[int]) -> Piece:
        """All of an event has happened; messages of these links are in transit."""
        return piece


def _noise_of(x: Connection) -> Floats:
    """The variance of noise and quantisation of each number of a message, as it arrives."""
    sigma, quantum = of_each(x, x.noise), of_each(x, x.quantisation)
    return x.scale**2 * (sigma**2 + quantum**2 / 12.0)


class ContinuousEffects(LoopEffects):
    """The loop in continuous time: components evolve continuously, noise of sources is white."""

    def __init__(
        self,
        system: System,
        components: Components,
        tasks: Sequence[str],
        noise: Mapping[str, float] | None = None,
        *,
        with_means: bool = False,
        steps: Mapping[str, float] | None = None,
    ) -> None:
        """`noise` has the intensities of white noise by input."""
        super().__init__(system, components, tasks, with_means=with_means, steps=steps)
        self._outputs = self._algebra(noise or {})

    def _algebra(self, noise: Mapping[str, float]) -> dict[str, Floats]:
        """The rows of all outputs in continuous time, through wires and direct feedthrough."""
        rows = {name: np.zeros((len(part.outputs), self.size)) for name, part in self.continuous.items()}
        noisy = {name: np.zeros((len(part.outputs), len(noise))) for name, part in self.continuous.items()}
        names = list(noise)
        for _ in range(len(self.continuous) + 1):
            before = {name: each.copy() for name, each in rows.items()}
            for name, part in self.continuous.items():
                held, white = self._inputs_of(name, part, before, noisy, names)
                own = np.eye(self.size)[self.places("state", name)]
                rows[name], noisy[name] = part.C @ own + part.D @ held, part.D @ white
        if any(not np.array_equal(before[name], rows[name]) for name in rows):
            raise UsageError("a loop of components in continuous time with direct feedthrough: expected a state in it")
        for name, part in self.continuous.items():
            for j in np.flatnonzero(noisy[name].any(axis=1)):
                raise UsageError(
                    f"white noise reaches {name}.{part.outputs[j]} directly, and has no finite variance there; "
                    "expected --as-simulated of expect"
                )
        F, R = np.zeros((self.size, self.size)), np.zeros((self.size, self.size))
        for name, part in self.continuous.items():
            place = self.places("state", name)
            held, white = self._inputs_of(name, part, rows, noisy, names)
            F[place] += part.B @ held
            F[place, place] += part.A
            driven = np.zeros((self.size, len(names)))
            driven[place] = part.B @ white
            for k, input_ in enumerate(names):
                R += noise[input_] * np.outer(driven[:, k], driven[:, k])
        for x in self.system.connections:
            if x.hold == "first":
                F[self.places("received", x.name), self.places("slope", x.name)] = np.eye(len(x.start))
        self.F, self.R = F, R
        return rows

    def _inputs_of(
        self, name: str, part: Continuous, rows: Mapping[str, Floats], noisy: Mapping[str, Floats], noise: Sequence[str]
    ) -> tuple[Floats, Floats]:
        """The inputs of a component as rows over the state and over white noise."""
        held, white = np.zeros((len(part.inputs), self.size)), np.zeros((len(part.inputs), len(noise)))
        for j, variable in enumerate(part.inputs):
            end = f"{name}.{variable}"
            if end in noise:
                white[j, noise.index(end)] = 1.0
            elif end in self.fed_by:
                x, i = self.fed_by[end]
                if x.name not in self.wires:
                    held[j] = self.row("received", x.name, i)
                elif variable_of(x.start[i]) in self.continuous[x.sender].outputs:
                    k = self.continuous[x.sender].outputs.index(variable_of(x.start[i]))
                    held[j], white[j] = x.scale * rows[x.sender][k], x.scale * noisy[x.sender][k]
            else:
                held[j] = self.input_row(end)
        return held, white

    def _continuous_output_row(self, name: str, j: int) -> Floats:
        return np.asarray(self._outputs[name][j])

    def _add_more_places(self, places: Places) -> None:
        """There are none."""

    def charge(self, means: Sequence[Mean]) -> None:
        """As `LoopEffects`, by integrals."""
        self.costs = len(means)
        Q = np.zeros((self.costs, self.size, self.size))
        for k, mean in enumerate(means):
            rows = np.array([self.signal_row(name) for name in mean.signals])
            Q[k] = self.quadratic_form(mean, rows)
        self._flows = Flows(self.F, self.R, Q)

    def advance(self, piece: Piece, duration: int) -> Piece:
        """As `LoopEffects`."""
        return piece.flowed(self._flows.over(duration / ATTOSECONDS))
