"""The placement of components on computers and of connections on networks."""

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.component import Component, Sampling, SamplingOnArrival, TaskSampling
from orchestration.systems.system.computers import Computer, Message, Network, Task
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import content, lowest
from orchestration.systems.system.requirements import require

if TYPE_CHECKING:
    from orchestration.systems.system.model import System


Shared = TypeVar("Shared", Task, Message)
SHARED: Mapping[str, tuple[str, type]] = {"computers": ("tasks", Task), "networks": ("messages", Message)}
"""The tables of shared resources, with the key of their users, and the record of one"""


@dataclass(frozen=True)
class PlacedTask:
    """A task with its computer."""

    computer_name: str
    name: str
    computer: Computer
    task: Task

    @property
    def place(self) -> str:
        """Its path."""
        return f"computers.{self.computer_name}.tasks.{self.name}"


@dataclass(frozen=True)
class PlacedMessage:
    """A message with its network."""

    network_name: str
    name: str
    network: Network
    message: Message

    @property
    def place(self) -> str:
        """Its path."""
        return f"networks.{self.network_name}.messages.{self.name}"


def placed_tasks(computers: Mapping[str, Computer]) -> Iterator[PlacedTask]:
    """All tasks, in the order of the file."""
    for computer_name, computer in computers.items():
        for name, task in computer.tasks.items():
            yield PlacedTask(computer_name, name, computer, task)


def placed_messages(networks: Mapping[str, Network]) -> Iterator[PlacedMessage]:
    """All messages, in the order of the file."""
    for network_name, network in networks.items():
        for name, message in network.messages.items():
            yield PlacedMessage(network_name, name, network, message)


def tasks_of(system: "System") -> dict[str, PlacedTask]:
    """Tasks by the component whose steps are their jobs."""
    return {each.task.component: each for each in placed_tasks(system.computers) if each.task.component is not None}


def messages_by_connection(system: "System") -> dict[str, PlacedMessage]:
    """The messages of connections, by connection."""
    found = placed_messages(system.networks)
    return {each.message.connection: each for each in found if each.message.connection is not None}


def released_by(system: "System") -> dict[str, tuple[str, ...]]:
    """The paths of tasks and names of components that arrivals of messages release, by connection."""
    found: dict[str, tuple[str, ...]] = {}
    for each in placed_tasks(system.computers):
        if each.task.on is not None:
            found[each.task.on] = (*found.get(each.task.on, ()), each.place)
    for name, connection in _by_arrivals(system).items():
        found[connection] = (*found.get(connection, ()), name)
    return found


def _by_arrivals(system: "System") -> dict[str, str]:
    """The connections whose messages release components, by component."""
    samplings = {name: one.sampling for name, one in system.components.items()}
    return {name: each.on for name, each in samplings.items() if isinstance(each, SamplingOnArrival)}


def has_random_schedule(system: "System") -> bool:
    """Whether the seed changes when its tasks run and its frames are sent."""
    tasks, messages = placed_tasks(system.computers), [*placed_messages(system.networks)]
    has_random = any(each.task.is_random for each in tasks) or any(each.message.is_random for each in messages)
    return has_random or any(each.network.error > 0.0 for each in messages)


def content_of(system: "System") -> Hashable:
    """A key of everything in its computers and networks that determines their timing."""
    shared = [(each.place, *_values(each.computer), *_values(each.task)) for each in placed_tasks(system.computers)]
    shared += [
        (each.place, *_values(each.network), *_values(each.message)) for each in placed_messages(system.networks)
    ]
    return tuple(shared)


def _values(of: Any) -> tuple[Hashable, ...]:
    found = (getattr(of, field.name) for field in fields(of))
    return tuple(content(value) for value in found if not isinstance(value, Mapping))


def punctual(system: "System") -> dict[str, Any]:
    """Its computers and networks without lateness, errors and variation: tasks take their least execution time.

    Random arrivals remain.
    """
    computers = {
        name: replace(
            one, tasks={key: _punctual(task, execution=lowest(task.execution)) for key, task in one.tasks.items()}
        )
        for name, one in system.computers.items()
    }
    networks = {
        name: replace(one, error=0.0, messages={key: _punctual(each) for key, each in one.messages.items()})
        for name, one in system.networks.items()
    }
    return {"computers": computers, "networks": networks}


def _punctual(of: Shared, **changes: Any) -> Shared:
    return replace(of, jitter=0.0, **changes)


def with_tasks(
    components: Mapping[str, Component], connections: tuple[Connection, ...], computers: Mapping[str, Computer],
    networks: Mapping[str, Network],
) -> dict[str, Component]:  # fmt: skip
    """The components, with a `TaskSampling` for those that are tasks, and a period for those that messages release."""
    tasks: dict[str, PlacedTask] = {}
    for each in placed_tasks(computers):
        name = each.task.component
        if name is None:
            continue
        known = ", ".join(components) or "(there is none)"
        require(name in components, f"{each.place}.component", name, f"one of the components {known}")
        taken = tasks.get(name)
        require(taken is None, f"{each.place}.component", name, f"another one than {taken and taken.place} has")
        tasks[name] = each
    periods = _Periods(components, connections, tasks, networks)
    return {name: _with_task(name, one, tasks.get(name), periods) for name, one in components.items()}


def _with_task(name: str, component: Component, of: PlacedTask | None, periods: "_Periods") -> Component:
    given = component.sampling
    if of is not None:
        for key, value in (("sampling", given), ("step", component.step)):
            own = value is not None and not isinstance(value, TaskSampling)
            require(not own, f"components.{name}.{key}", "given", f"none beside {of.place}, which says when it runs")
        ratio, task = of.computer.clock_ratio, of.task
        period = periods.of(name) * ratio if task.period is None else task.period
        sampling: Sampling = TaskSampling(period=period, offset=task.offset, clock_ratio=ratio, task=of.place)
    elif isinstance(given, SamplingOnArrival):
        sampling = replace(given, period=periods.of(name))
    else:
        stated = component.step is not None or (given is not None and not isinstance(given, TaskSampling))
        require(stated, f"components.{name}.step", "none", "step (continuous time) or sampling (a digital task)")
        return component
    return component if sampling == given else replace(component, sampling=sampling)


class _Periods:
    """Approximate periods of components [s] of true time; that of arrivals, for what they release."""

    def __init__(
        self, components: Mapping[str, Component], connections: tuple[Connection, ...],
        tasks: Mapping[str, PlacedTask], networks: Mapping[str, Network],
    ) -> None:  # fmt: skip
        self._components, self._tasks = components, tasks
        self._connections = {x.name: x for x in connections}
        self._messages = {each.message.connection: each for each in placed_messages(networks)}

    def of(self, name: str, after: tuple[str, ...] = ()) -> float:
        """The period of a component; `after` has those whose period follows from it."""
        task, sampling = self._tasks.get(name), self._components[name].sampling
        if task is not None and task.task.on is None:
            return self._of_task(task)
        if task is not None and task.task.on is not None:
            return self.of_connection(f"{task.place}.on", task.task.on, (*after, name))
        if isinstance(sampling, SamplingOnArrival):
            return self.of_connection(f"components.{name}.sampling.on", sampling.on, (*after, name))
        return sampling.period / sampling.clock_ratio if sampling is not None else 0.0

    def of_connection(self, place: str, connection: str, after: tuple[str, ...]) -> float:
        """The period of the messages of a connection; raises `UsageError`, naming the `place`, where there are none."""
        x, over = self._connections.get(connection), self._messages.get(connection)
        known = ", ".join(self._connections) or "(there is none)"
        require(x is not None, place, connection, f"one of the connections {known}")
        assert x is not None
        sender = self._components[x.sender]
        if over is not None and sender.step is not None:
            _expect_period(over, x.sender)
            return over.message.period or 0.0
        if x.sender in after:
            raise UsageError(f"{place} = {connection}: expected something that begins: each waits for the other")
        expected = "one from a sampled component, or over a network: no other has messages of its own"
        require(sender.step is None, place, connection, expected)
        return self.of(x.sender, after)

    def _of_task(self, of: PlacedTask) -> float:
        if of.task.arrivals is not None:
            return of.task.arrivals.gap
        return (of.task.period or 0.0) / of.computer.clock_ratio


def _expect_period(of: PlacedMessage, sender: str) -> None:
    """Require a period for what a component in continuous time sends over a network."""
    require(of.message.period is not None, f"{of.place}.period", "none", f"when {sender} sends, which does not say")


def expect_placement(system: "System") -> None:
    """Raise `UsageError` for a placement that is invalid with any FMUs."""
    tasks, messages, released = tasks_of(system), messages_by_connection(system), released_by(system)
    connections = {x.name: x for x in system.connections}
    periods = _Periods(system.components, system.connections, tasks, system.networks)
    for each in placed_tasks(system.computers):
        if each.task.on is not None:
            periods.of_connection(f"{each.place}.on", each.task.on, ())
    for x in system.connections:
        fits = x.order == "gauss-seidel" or x.name not in released
        require(fits, f"connections.{x.name}.order", x.order, "gauss-seidel: its arrivals release a task")
        of = [each.place for each in (tasks.get(x.sender), tasks.get(x.receiver), messages.get(x.name)) if each]
        fits = x.order == "gauss-seidel" or not of
        require(fits, f"connections.{x.name}.order", x.order, f"gauss-seidel beside {', '.join(of)}")
    seen: dict[str, str] = {}
    for one in placed_messages(system.networks):
        message, name = one.message, one.message.connection
        if name is None:
            continue
        known = ", ".join(connections) or "(there is none)"
        require(name in connections, f"{one.place}.connection", name, f"one of the connections {known}")
        require(name not in seen, f"{one.place}.connection", name, f"another one than {seen.get(name)} has")
        seen[name] = one.place
        sampled = system.components[connections[name].sender].sampling is not None
        require(message.arrivals is None, f"{one.place}.arrivals", "given", "none: it is the message of a connection")
        sender = connections[name].sender
        if sampled:
            expected = f"none: it is sent when {sender} writes"
            require(message.period is None, f"{one.place}.period", message.period, expected)
        else:
            _expect_period(one, sender)
        expect_nodes(system, one)


def expect_nodes(system: "System", of: PlacedMessage) -> None:
    """Raise `UsageError` for an Ethernet frame whose receiver is its sender."""
    if of.network.kind == "ethernet":
        start, end = nodes_of(system, of)
        require(start != end, f"{of.place}.to", end, "another node than it comes from")


def nodes_of(system: "System", of: PlacedMessage) -> tuple[str, str]:
    """The nodes at the ends of a message: its own, else the computers of the ends of its connection, or these."""
    tasks, x = tasks_of(system), next((x for x in system.connections if x.name == of.message.connection), None)
    ends = ("", "") if x is None else (x.sender, x.receiver)
    start, end = (tasks[name].computer_name if name in tasks else name for name in ends)
    return of.message.start or start, of.message.end or end
