"""A system: components, what connects and drives them, its objectives and its criterion of good and diverged runs.

It is checked without opening any FMU.
"""

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field, replace
from typing import Any, ClassVar

from orchestration.foundation.basics.errors import UsageError, listed, prefixed, shown
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.times import is_at_least, nanoseconds
from orchestration.systems.expressions.syntax import is_number, parse
from orchestration.systems.system.component import Component, expect_partitions, has_scheduled_instants
from orchestration.systems.system.computers import Computer, Network
from orchestration.systems.system.connection import Connection, Source, component_of
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.file_tables import tables_of
from orchestration.systems.system.placement import (
    expect_placement,
    has_random_schedule,
    placed_messages,
    placed_tasks,
    with_tasks,
)
from orchestration.systems.system.requirements import is_finite, require, require_positive

DIVERGED, TERMINATED = "diverged", "terminated"
"""Outcomes whatever the criterion is: the run left the region of validity, or an FMU ended it"""
AFTER = "after"
"""Key of an operating point beside its paths"""


@record()
class Criterion:
    """The expressions by which a run is good, or has diverged."""

    good: str | None = None
    """The condition over objectives, at the end, by which a run is good; default: no run is judged."""
    diverged: str | None = None
    """The condition over signals that ends a run at the first instant at which it holds; default: none."""
    outcomes: tuple[str, str] = ("good", "bad")
    """The names of a good run and of one that is not; one that diverged or was terminated keeps that name."""

    def __post_init__(self) -> None:
        given = ", ".join(self.outcomes)
        two = len({*self.outcomes, DIVERGED, TERMINATED, ""}) == 5 and given.isprintable()
        require(two, "outcomes", ascii(given), f"two names, and neither is {DIVERGED} or {TERMINATED}")


@record()
class System:
    """Components, what connects and drives them, the objectives of a run and the criterion of a good one.

    Raises `UsageError` for what is invalid with any FMUs.
    """

    stop_time: float
    """The end of a run [s]."""
    seed: int = 0
    """The seed of all random numbers of a run."""
    components: Mapping[str, Component] = field(default_factory=dict)
    """The FMUs by name; their order decides ties."""
    connections: tuple[Connection, ...] = ()
    """The messages from component to component."""
    sources: Mapping[str, Source] = field(default_factory=dict)
    """The sources that drive inputs from outside, by name."""
    computers: Mapping[str, Computer] = field(default_factory=dict)
    """The processors that run components as tasks, by name."""
    networks: Mapping[str, Network] = field(default_factory=dict)
    """The buses and switches over which connections go, by name."""
    objectives: Mapping[str, str] = field(default_factory=dict)
    """The expressions that are evaluated over a run, by name."""
    optional: tuple[str, ...] = ()
    """The objectives that may lack a value: where an FMU does not have one of their variables."""
    criterion: Criterion = field(default_factory=Criterion)
    """The conditions under which a run is good, and under which it has diverged."""
    streams: Mapping[str, int] = field(default_factory=dict)
    """The random streams that have a number instead of a name, as `connections.NAME.CAUSE` and
    `components.NAME.jitter`."""
    operating_point: Mapping[str, Any] = field(default_factory=dict)
    """Changes, by path, with which the system rests: where loops are linearised. With `after`, the time [s] that it
    runs with them before it is taken to rest; default: none. That it rests is checked when it is used."""

    def __repr__(self) -> str:
        named = {
            "components": self.components,
            "connections": [x.name for x in self.connections],
            "sources": self.sources,
            "computers": self.computers,
            "networks": self.networks,
            "objectives": self.objectives,
        }
        parts = [f"{what}: {listed(names, most=6)}" for what, names in named.items() if names]
        return f"<System of {self.stop_time:g} s; {'; '.join(parts)}>"

    @property
    def fmus(self) -> dict[str, str]:
        """The FMU of each component, by its name."""
        return {name: component.fmu for name, component in self.components.items()}

    @property
    def uses_scheduler(self) -> bool:
        """Whether the scheduler computes the instants of any component or connection."""
        samplings = (component.sampling for component in self.components.values())
        on_its_own = (sampling is not None and has_scheduled_instants(sampling) for sampling in samplings)
        return bool(self.computers or self.networks) or any(on_its_own)

    @property
    def has_random_timing(self) -> bool:
        """Whether the seed changes when its components are stepped, or which messages arrive and when."""
        return (
            any(one.sampling is not None and one.sampling.is_random for one in self.components.values())
            or any(x.is_random for x in self.connections)
            or (self.uses_scheduler and has_random_schedule(self))
        )

    @property
    def depends_on_seed(self) -> bool:
        """Whether the seed changes its runs."""
        return self.has_random_timing or self.has_noise

    @property
    def has_noise(self) -> bool:
        """Whether connections or sources are noisy."""
        return any(any(x.noise.values()) for x in self.connections) or any(
            source.is_random and source.noise != 0.0 for source in self.sources.values()
        )

    def to_toml(self) -> str:
        """The system file that loads as this system, wherever it lies."""
        import tomli_w

        return tomli_w.dumps({key: value for key, value in tables_of(self).items() if value not in ({}, [])})

    # The protocol `request.Request`: a system is its own system, and has no other terms.

    kind: ClassVar[str] = "run"
    title: ClassVar[str | None] = None
    description: ClassVar[str] = ""

    def as_system(self) -> "System":
        """Itself."""
        return self

    def in_own_terms(self, text: str) -> str:
        """`text` unchanged."""
        return text

    def paths_of(self, target: str) -> tuple[str, ...]:
        """`target` is a path."""
        return (target,)

    def range_of(self, quantity: str) -> None:
        """No quantity has a name."""

    def with_twins(self, twin: Callable[[str], str]) -> "System":
        """The same system with each FMU replaced by its `twin`."""
        twins = {name: twin(fmu) for name, fmu in self.fmus.items()}
        if twins == self.fmus:
            return self
        components = {name: replace(each, fmu=twins[name]) for name, each in self.components.items()}
        return replace(self, components=components)

    def near_continuous(self, period: float) -> None:
        """None: which of its components are the digital ones is not known."""

    def oversights(self) -> Iterator[str]:
        """Warnings of components and connections for which the run is too short, and for a quaternion set in part."""
        end, stop = f"the run ends at {shown(self.stop_time)} s", nanoseconds(self.stop_time)
        for name, component in self.components.items():
            for first, others in _quaternions_in_part(component.parameters):
                yield f"components.{name}.parameters.{first}: is set without {others}, which keep their start values"
            sampling, place = component.sampling, f"components.{name}.sampling"
            if sampling is None or has_scheduled_instants(sampling):
                continue
            if sampling.true_offset >= stop:
                hint = _if_milliseconds(sampling.offset)
                yield f"{place}.offset = {shown(sampling.offset)}: {end}, so {name} never samples{hint}"
            elif sampling.true_offset + sampling.true_period >= stop:
                hint = _if_milliseconds(sampling.period)
                yield f"{place}.period = {shown(sampling.period)}: {end}, so {name} samples only once{hint}"
        for place, computer in self.computers.items():
            for name, task in computer.tasks.items():
                if task.period is not None and task.offset + task.period >= self.stop_time:
                    task_period = f"computers.{place}.tasks.{name}.period = {shown(task.period)}"
                    yield f"{task_period}: {end}, so {name} runs at most once{_if_milliseconds(task.period)}"
        for x in self.connections:
            if (least := lowest(x.delay)) >= self.stop_time:
                late = f"connections.{x.name}.delay = {shown(least)}"
                yield f"{late}: {end}, so none of its messages arrives{_if_milliseconds(least)}"

    def mismatches(self, parameters: Mapping[str, float]) -> tuple[str, ...]:
        """A system does not know which parameters of its components belong together."""
        return ()

    def headline(self) -> str:
        """A system has no headline."""
        return ""

    def __post_init__(self) -> None:
        require_positive(self, "stop_time")
        require(is_at_least(self.stop_time, 1.0), "stop_time", self.stop_time, "at least a nanosecond")
        whole = isinstance(self.seed, int) and not isinstance(self.seed, bool)
        require(whole and 0 <= self.seed < 2**63, "seed", self.seed, "a whole number from 0 to 2^63 - 1")
        if "rows" in self.components:
            raise UsageError("components.rows: expected another name; this one is taken")
        require(bool(self.components or self.computers or self.networks), "components", "none", "at least one")
        _require_names("components", self.components, without=".")
        _require_names("sources", self.sources, without=".")
        for table in ("computers", "networks"):
            _require_names(table, getattr(self, table), without=".")
        for place, owner in self.computers.items():
            _require_names(f"computers.{place}.tasks", owner.tasks, without=".")
        for place, network in self.networks.items():
            _require_names(f"networks.{place}.messages", network.messages, without=".")
        is_stepped = all(one.step is not None or one.sampling is not None for one in self.components.values())
        if self.uses_scheduler or not is_stepped:
            components = with_tasks(self.components, self.connections, self.computers, self.networks)
            object.__setattr__(self, "components", components)
        if any(one.partition is not None for one in self.components.values()):
            expect_partitions(self.components)
        _require_names("connections", (x.name for x in self.connections))
        _require_names("objectives", self.objectives)
        causes = self._causes()
        after = self.operating_point.get(AFTER, 0.0)
        valid = is_finite(after) and after >= 0.0
        require(valid, f"operating_point.{AFTER}", after, "a time of zero or more seconds")
        for place, number in self.streams.items():
            require(place in causes, "streams", place, f"one of {', '.join(causes) or 'none'}")
            require(number >= 0, f"streams.{place}", number, "a number from 0 on")
        for name in self.sources:
            require(name not in self.components, f"sources.{name}", name, "another name than a component's")
        fed: dict[str, str] = {}
        for place, start, end in self._feeds():
            for what, variable in (("from", start), ("to", end)):
                if variable is not None and component_of(variable) not in self.components:
                    known = ", ".join(self.components)
                    raise UsageError(f"{place}.{what}: {variable}: no such component; expected one of {known}")
            if end in fed:
                raise UsageError(f"{place}.to: {end} is fed by {fed[end]} already; expected one connection or source")
            fed[end] = place
        names = [x.name for x in self.connections]
        for name in names:
            require(names.count(name) == 1, "connections", name, "a different name for each")
        if self.uses_scheduler:
            expect_placement(self)
        _require_expressions(tuple(expressions(self)))

    def _causes(self) -> list[str]:
        """The names of its random streams."""
        tasks = [f"components.{name}.jitter" for name, c in self.components.items() if c.sampling is not None]
        sent = [f"connections.{x.name}.{cause}" for x in self.connections for cause in _CAUSES]
        if self.uses_scheduler:
            sent += [f"{each.place}.{cause}" for each in placed_tasks(self.computers) for cause in TASK_CAUSES]
            sent += [f"{each.place}.{cause}" for each in placed_messages(self.networks) for cause in MESSAGE_CAUSES]
        return [*tasks, *sent, *(f"sources.{name}.value" for name, x in self.sources.items() if x.is_random)]

    def _feeds(self) -> list[tuple[str, str | None, str]]:
        feeds: list[tuple[str, str | None, str]] = [
            (f"connections.{x.name}", start, end) for x in self.connections for start, end in zip(x.start, x.end)
        ]
        return feeds + [(f"sources.{name}", None, end) for name, source in self.sources.items() for end in source.to]


_PARTS = ("x", "y", "z", "w")
"""The parts of a quaternion"""
_CAUSES = ("delay", "delay_jitter", "loss", "noise")
"""The random streams of a connection"""
TASK_CAUSES, MESSAGE_CAUSES = ("execution", "jitter", "arrivals"), ("jitter", "arrivals", "error")
"""The random streams of a task, and of a message"""


def _quaternions_in_part(parameters: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Of each quaternion of which some parts are set, the first of these, and the others in words."""
    found: dict[str, list[str]] = {}
    for name in parameters:
        stem, _, axis = name.rpartition(".")
        if stem.endswith("quaternion") and axis in _PARTS:
            found.setdefault(stem, []).append(axis)
    for stem, axes in found.items():
        if others := [axis for axis in _PARTS if axis not in axes]:
            yield f"{stem}.{axes[0]}", ", ".join(others)


def _require_names(table: str, names: Iterable[str], without: str = "") -> None:
    """Raise `UsageError` for a name that cannot be part of a path and of a message of one line."""
    for name in names:
        if not (name.isprintable() and name == name.strip() != "" and not (without and without in name)):
            expected = "a name in printable characters" + (" without a dot" if without else "")
            require(False, table, name.encode("unicode_escape").decode(), expected)


def expressions(system: System) -> list[tuple[str, str]]:
    """Every expression of a system, with its place in the file."""
    found = [(f"objectives.{name}", text) for name, text in system.objectives.items()]
    criterion = system.criterion
    return found + [
        (f"criterion.{key}", text)
        for key, text in (("good", criterion.good), ("diverged", criterion.diverged))
        if text is not None
    ]


@functools.lru_cache(maxsize=256)
def _if_milliseconds(value: float) -> str:
    """What a time [s] would be that was meant in milliseconds, where that may be."""
    return "" if value < 1.0 else f" (times are in seconds: {value:g} ms is {value / 1000.0:g})"


def _require_expressions(texts: tuple[tuple[str, str], ...]) -> None:
    """Raise `UsageError` for one that is not valid, or for a criterion that is no condition; cached for studies."""
    for place, text in texts:
        with prefixed(f"{place}: "):
            node = parse(text)
        if place.startswith("criterion."):
            condition = parse(dict(texts).get(f"objectives.{text.strip()}", text))
            require(not is_number(condition) and not is_number(node), place, text, "a condition, as in peak < 2.5")
