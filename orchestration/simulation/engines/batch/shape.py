"""What the runs of one batch have in common: their components, connections and expressions."""

import re
from collections.abc import Hashable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from fmu_kit.compiler.pack.lanes import Lanes
from orchestration.components.fmi.read_description import Model, Variable
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.identity import IdentityCache
from orchestration.foundation.basics.simulator import Booleans
from orchestration.simulation.engines import initial
from orchestration.simulation.engines.batch.code import ExpressionCode, expression_code
from orchestration.simulation.engines.batch.kernels import NoCode, batch, component, preferred_lanes
from orchestration.simulation.engines.batch.writing import Kind, Leaf
from orchestration.simulation.engines.structures import ONE_LANE
from orchestration.simulation.engines.wiring_by_index import Board, Wires
from orchestration.simulation.results.objectives import GOOD
from orchestration.systems.expressions.at_instant import scalars
from orchestration.systems.expressions.over_run import STOP_TIME, TIME, inlined, reductions, vectors
from orchestration.systems.expressions.syntax import Call, Node, names, names_job_measure, parse
from orchestration.systems.schedule.plan import is_plain, own_outputs
from orchestration.systems.system.check import recorded_variables
from orchestration.systems.system.computers import Network
from orchestration.systems.system.connection import Connection, Source, component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import placed_messages

Places = npt.NDArray[np.int64]
_TAKES = {"Boolean": ONE_LANE.TRUTH, "Integer": ONE_LANE.WHOLE, "Enumeration": ONE_LANE.WHOLE}
"""Conversion of an input that is not a Real, by its kind"""
_SIGNAL = re.compile(r"SIGNAL\((\d+), (\d+)\)")
"""The index of a component, and the place of a variable in its memory, in the C of expressions"""


def outline(system: System) -> Hashable:
    """The key that systems must have in common to be run in one batch."""
    components = tuple(
        (name, c.fmu, c.access, c.record, c.sampling and c.sampling.clock) for name, c in system.components.items()
    )
    others = _outline_between(system.connections, system.sources, system.networks, system.objectives)
    return components, others, system.optional, system.criterion


@IdentityCache
def _outline_between(
    connections: Sequence[Connection],
    sources: Mapping[str, Source],
    networks: Mapping[str, Network],
    objectives: Mapping[str, str],
) -> Hashable:
    return (
        tuple(map(_outline_of, connections)),
        frozenset(each.message.connection for each in placed_messages(networks)) - {None},  # load is no connection
        tuple((name, source.to, _kind(source), source.trajectory) for name, source in sources.items()),
        tuple(objectives.items()),
    )  # fmt: skip


def _outline_of(x: Connection) -> Hashable:
    late = bool(x.delay or x.delay_jitter)
    return (
        x.name, x.start, x.end, x.order, x.hold, is_plain(x), late, any(x.noise.values()), any(x.quantisation.values()),
        x.converts,
    )  # fmt: skip


def _kind(source: Source) -> str:
    return next(
        kind for kind in ("constant", "file", "noise", "signal", "trajectory") if getattr(source, kind) is not None
    )


@dataclass(frozen=True, kw_only=True)
class Shape:
    """The common structure of systems, made from one of them that was checked against its FMUs."""

    system: System
    models: Mapping[str, Model]
    lanes: int
    replaced: str | None = None
    """The component whose outputs the caller computes; the references of its variables count them from 0 on"""

    def __post_init__(self) -> None:
        for name, one in self.system.components.items():
            if one.start_time:
                where = f"components.{name}.start_time = {one.start_time:g}"
                raise UsageError(f"{where}: expected 0 for one of many at once, or in a page")
            if one.points:
                raise UsageError(f"components.{name}.points: expected none for one of many at once, or in a page")

    # -- components and connections --------------------------------------------------------------------------------

    @cached_property
    def kernels(self) -> Mapping[str, Lanes | NoCode]:
        """The kernel of each component; raises `UsageError` naming one that has none."""
        components = self.system.components
        return {
            name: NoCode(model)
            if name == self.replaced
            else component(name, model, self.lanes, several=components[name].sampling is None)
            for name, model in self.models.items()
        }

    @cached_property
    def waits(self) -> Set[str]:
        """The components whose own time begins with their first sample."""
        return {name for name, model in self.models.items() if model.waits}

    @cached_property
    def wires(self) -> Wires:
        """How the components are connected, and which variables are read."""
        return Wires(self.system, recorded_variables(self.system, self.models))

    @property
    def board(self) -> Board:
        """The variables that are read."""
        return self.wires.board

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the components."""
        return self.wires.names

    def variable(self, end: str) -> Variable:
        """The variable of COMPONENT.VARIABLE."""
        return self.models[component_of(end)].variables[variable_of(end)]

    def place(self, end: str) -> tuple[int, int]:
        """The component's index, and the place in its memory, of COMPONENT.VARIABLE.

        Raises `UsageError` for one that is none of its memory.
        """
        if variable_of(end) in self.models[component_of(end)].for_solvers:
            raise UsageError(f"{end}: expected none of the variables that are for solvers, for one of many at once")
        return self.names.index(component_of(end)), self.variable(end).reference

    @cached_property
    def on_board(self) -> Sequence[tuple[int, int, int]]:
        """Of each recorded column its place in a row, its component's index, and its place in the memory of that."""
        return [(i, *self.place(column)) for column, i in self.board.place.items() if column != "time"]

    @cached_property
    def first_exchange(self) -> tuple[tuple[int, ...], ...]:
        """Connections in the order of the first exchange."""
        return initial.groups(self.system.connections, lambda name, output: self.models[name].depends_on(output))

    @cached_property
    def fed(self) -> Mapping[str, list[tuple[int, int]]]:
        """By component, its inputs from sources: the index among all their signals, and the place in its memory."""
        inputs: dict[str, list[tuple[int, int]]] = {name: [] for name in self.names}
        number = 0
        for source in self.system.sources.values():
            for end in source.to:
                inputs[component_of(end)].append((number, self.place(end)[1]))
                number += 1
        return inputs

    @cached_property
    def connected(self) -> Mapping[str, Places]:
        """By component, the places of its connected outputs in its memory."""
        return {
            name: np.array([self.place(output)[1] for output in self.wires.connected(name)], dtype=np.int64)
            for name in self.names
        }

    def read(self, name: str) -> Booleans:
        """Whether a connection or an expression reads each variable of a component."""
        index, count = self.names.index(name), 1 + max(v.reference for v in self.models[name].variables.values())
        is_read = np.zeros(count, dtype=np.bool_)
        is_read[self.connected[name]] = True
        is_read[[int(place) for owner, place in _SIGNAL.findall(self.expressions.text) if int(owner) == index]] = True
        return is_read

    @cached_property
    def seen_count(self) -> int:
        """The number of values of sources that expressions read."""
        return sum(map(len, self.seen.values()))

    @cached_property
    def given_count(self) -> int:
        """The number of values of sources that inputs get; 0 if none of them changes in a run."""
        changing = any(source.to and source.constant is None for source in self.system.sources.values())
        return sum(len(source.to) for source in self.system.sources.values()) if changing else 0

    @cached_property
    def ends(self) -> Sequence["Ends"]:
        """The ends of each connection."""
        return [_ends_of(self, x) for x in self.system.connections]

    # -- expressions -----------------------------------------------------------------------------------------------

    @cached_property
    def nodes(self) -> Mapping[str, Node]:
        """Objectives and the condition of a good run, by name, with the objectives that they name inlined."""
        nodes: dict[str, Node] = {}
        texts = dict(self.system.objectives)
        if self.system.criterion.good is not None:
            texts[GOOD] = self.system.criterion.good
        for name, text in texts.items():
            nodes[name] = inlined(parse(text), nodes)
        return nodes

    @cached_property
    def condition(self) -> Node | None:
        """The condition of divergence."""
        text = self.system.criterion.diverged
        return None if text is None else parse(text)

    @cached_property
    def calls(self) -> Mapping[Call, Call]:
        """The reductions in the objectives, each over signals alone; those inside others first."""
        calls = {}
        for node in self.nodes.values():
            for call in sorted(reductions(node), key=_passes):
                with_signals = scalars(call, self._vectors)[0]
                assert isinstance(with_signals, Call)
                calls[call] = with_signals
        return dict(sorted(calls.items(), key=lambda pair: _passes(pair[0])))

    @cached_property
    def passes(self) -> int:
        """How often a run is simulated: a reduction inside another one must be known before."""
        return max(map(_passes, self.calls), default=1)

    @cached_property
    def inner(self) -> tuple[Call, ...]:
        """Reductions whose values others need at every row."""
        return tuple(dict.fromkeys(part for call in self.calls for node in _at_rows(call) for part in reductions(node)))

    @cached_property
    def numbers(self) -> tuple[str, ...]:
        """Parameters that expressions name, as COMPONENT.NAME."""
        wanted = self._expression_names
        return tuple(name for name in sorted(wanted) if names_job_measure(name) or self._is_parameter(name))

    @cached_property
    def seen(self) -> Mapping[str, tuple[str, ...]]:
        """The signals of the sources that expressions name, by source."""
        return {
            name: source.signals(name)
            for name, source in self.system.sources.items()
            if any(
                signal in self._expression_names or signal.rpartition(".")[0] in self._expression_names
                for signal in source.signals(name)
            )
        }

    @cached_property
    def expressions(self) -> ExpressionCode:
        """The expressions in C; raises `UsageError` for those that cannot be evaluated."""
        known = {
            scalars(call, self._vectors)[0]: f"NUMBER({len(self.numbers) + 1 + i})" for i, call in enumerate(self.inner)
        }
        condition = None
        if self.condition is not None:
            (condition,) = scalars(self.condition, self._vectors)
        return expression_code(
            self.leaves,
            self._lines,
            known,
            list(self.calls.values()),
            condition,
            connections=[x.name for x in self.system.connections],
            observed={self.names.index(component_of(name)) for name in own_outputs(self.system, self._reduced)},
        )

    @cached_property
    def library(self) -> Any:
        """The functions that run its systems in SIMD lanes."""
        bits = ", ".join(f"1ull << {lane}" for lane in range(self.lanes))
        sizes = {  # rounded up, so that similar systems share a library
            "CHANNELS": -8 * (-len(self.system.connections) // 8) or 8,
            "HAS_CONDITION": int(self.condition is not None), "KEPT": len(self.expressions.folds.kept),
            "LANE_BITS": f"{{{bits}}}",
        }  # fmt: skip
        lines = "".join(f"#define {name} {value}\n" for name, value in sizes.items())
        return batch(lines, self.expressions.text, self.lanes)

    @cached_property
    def _expression_names(self) -> set[str]:
        nodes = [*self.nodes.values(), *([] if self.condition is None else [self.condition])]
        return {name for node in nodes for name in names(node)}

    @property
    def _reduced(self) -> Iterator[str]:
        """The signals that reductions read."""
        return (name for call in self.calls.values() for name in names(call) if name in self._signals)

    def _is_parameter(self, name: str) -> bool:
        model = self.models.get(component_of(name))
        variable = None if model is None else model.variables.get(variable_of(name))
        return variable is not None and variable.causality == "parameter"

    @cached_property
    def _signals(self) -> dict[str, Leaf]:
        """The recorded signals, and those of sources."""
        held = {end: self._kind_of(x) for x in self.system.connections for end in x.end}
        leaves = {}
        for signal in self.board.columns[1:]:
            index, place = self.place(signal)
            sampled = self.system.components[component_of(signal)].sampling is not None
            kind: Kind = "held" if sampled else held.get(signal, "continuous")
            leaves[signal] = Leaf(code=f"SIGNAL({index}, {place})", kind=kind)
        number = 0
        for name, signals in self.seen.items():
            source = self.system.sources[name]
            kind = "held" if source.is_held else "continuous"
            for signal in signals:
                leaves[signal] = Leaf(code=f"SEEN({number})", kind=kind)
                number += 1
        return leaves

    def _kind_of(self, x: Connection) -> Kind:
        return "held" if x.hold == "zero" else "line"

    @cached_property
    def _vectors(self) -> Mapping[str, tuple[str, ...]]:
        numbers = {*self.numbers, STOP_TIME, TIME}
        return {name: parts for name, parts in vectors(self._signals).items() if name not in numbers}

    @cached_property
    def _lines(self) -> Mapping[str, int]:
        return {end: i for i, x in enumerate(self.system.connections) if x.hold == "first" for end in x.end}

    @property
    def leaves(self) -> dict[str, Leaf]:
        """What expressions may name."""
        numbers = {name: Leaf(code=f"NUMBER({i})", kind="number") for i, name in enumerate((*self.numbers, STOP_TIME))}
        return {**self._signals, TIME: Leaf(code="t", kind="continuous"), **numbers}


def _at_rows(call: Call) -> tuple[Node, ...]:
    """The arguments of a reduction that must be known row by row."""
    return call.arguments[:1] if call.function == "growth_share" else call.arguments


def _passes(call: Call) -> int:
    """The pass over the run in which a reduction can be computed, counted from 1."""
    return 1 + max((_passes(inner) for node in _at_rows(call) for inner in reductions(node)), default=0)


@dataclass(frozen=True, kw_only=True)
class Ends:
    """The places of the ends of a connection, and the kinds and bounds of its receiver's inputs."""

    start: Places
    end: Places
    kinds: Places
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]


def _ends_of(shape: Shape, x: Connection) -> Ends:
    receivers = [shape.variable(end) for end in x.end]
    bounds = np.iinfo(np.int32)
    return Ends(
        start=np.array([shape.place(start)[1] for start in x.start], dtype=np.int64),
        end=np.array([variable.reference for variable in receivers], dtype=np.int64),
        kinds=np.array([_TAKES.get(v.kind, ONE_LANE.REAL) for v in receivers], dtype=np.int64),
        low=np.full(len(receivers), float(bounds.min)), high=np.full(len(receivers), float(bounds.max)),
    )  # fmt: skip


def expect_lanes(system: System, models: Mapping[str, Model], replaced: str | None = None) -> None:
    """Compile what runs a checked system in SIMD lanes, but for a component that is `replaced`.

    Raises `UsageError` if it cannot be run in lanes, naming what it lacks; `QuadcosimError` without a compiler.
    """
    shape = Shape(system=system, models=models, lanes=preferred_lanes(), replaced=replaced)
    assert shape.kernels
    assert shape.library
