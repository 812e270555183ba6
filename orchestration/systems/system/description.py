"""A system as text: its components with their rates, its connections with their faults."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from orchestration.foundation.basics.errors import listed
from orchestration.foundation.basics.terminal import in_columns
from orchestration.foundation.basics.unit_algebra import in_brackets, time_text
from orchestration.systems.system.component import Component, Sampling, SamplingOnArrival, TaskSampling
from orchestration.systems.system.computers import Message, Task
from orchestration.systems.system.connection import Connection, Source, variable_of
from orchestration.systems.system.distribution import Distribution, Varying
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import PlacedMessage, PlacedTask, placed_messages, placed_tasks, tasks_of

MAX_NAMES_IN_CELL = 6
"""names in a cell; more are counted"""
MAX_RATES = 3
"""rates in a sentence; more are counted"""


def as_text(
    system: System,
    units: Mapping[str, str] = {},
    follows: str = "",
    loops: Sequence[str] = (),
    events: Sequence[str] = (),
) -> str:
    """Components, connections, sources, objectives with their `units`, and the criterion, a line each, in columns.

    `follows` describes the references and the components that follow them, `loops` the algebraic loops,
    `events` the FMUs that handle their events themselves.
    """
    components = [(name, _fmu(c), describe_rate(c), _parameters(c)) for name, c in system.components.items()]
    connections = [
        (x.name, f"{x.sender} -> {x.receiver}", describe_faults(x) or "at once", describe_signals(x))
        for x in system.connections
    ]
    sources = [
        (name, describe_source(s), _shortened(s.to) if s.to else "(objectives)") for name, s in system.sources.items()
    ]
    named = [in_brackets(name, units.get(name)) for name in system.objectives]
    criterion = system.criterion
    criteria = [("good", criterion.good), ("diverged", criterion.diverged)]
    sections: list[tuple[str, Sequence[Sequence[str]]]] = [
        ("components", components),
        ("connections", connections),
        ("sources", sources),
        ("computers", [_task(each) for each in placed_tasks(system.computers)]),
        ("networks", [_message(each) for each in placed_messages(system.networks)]),
        ("follows", [(follows,)] if follows else []),
        ("loops", [(loop,) for loop in loops]),
        ("events", [(where,) for where in events]),
        (
            "objectives",
            [(name, " ".join(text.split())) for name, text in zip(named, system.objectives.values())],
        ),
        ("criterion", [(name, " ".join(text.split())) for name, text in criteria if text is not None]),
    ]
    lines = [f"{len(system.components)} components, {len(system.connections)} connections, {system.stop_time:g} s"]
    for title, rows in sections:
        if rows:
            lines += ["", title, *(f"  {row}" for row in in_columns(rows))]
    return "\n".join(lines)


def describe_rate(component: Component) -> str:
    """How a component is stepped."""
    begins = f", its time begins at {time_text(component.start_time)}" if component.start_time else ""
    return _rate(component) + begins


def _rate(component: Component) -> str:
    if component.sampling is None:
        return f"continuous, step {time_text(component.step or 0.0)}" + (
            ", moved to its own grid" if component.align == "next" else ""
        )
    if isinstance(component.sampling, TaskSampling):
        return f"by {component.sampling.task}"
    if isinstance(component.sampling, SamplingOnArrival):
        return f"on {component.sampling.on}"
    return describe_sampling(component.sampling)


def describe_clock(system: System) -> str:
    """When the digital components of a system are sampled, with their names where there are several."""
    sampled = {name: each for name, each in system.components.items() if each.sampling is not None}
    if not sampled:
        return "nothing is sampled"
    tasks = tasks_of(system)
    rates = {name: _by(tasks[name]) if name in tasks else describe_rate(each) for name, each in sampled.items()}
    several = [f"{name} {rate}" for name, rate in rates.items()]
    return f"sampled {listed(several, MAX_RATES) if len(several) > 1 else rates.popitem()[1]}"


def _by(of: PlacedTask) -> str:
    return f"by task {of.name} of {of.computer_name} {_released(of.task)}"


def _task(of: PlacedTask) -> tuple[str, ...]:
    task, computer = of.task, of.computer
    how = [computer.scheduling.replace("-", " "), *([] if computer.preemptive else ["not preemptive"])]
    how += [f"priority {task.priority}", f"{describe_varying(task.execution)} by {time_text(task.due)}"]
    how += [f"reads at {task.read}"] if task.read != "start" else []
    how += [f"writes at {task.write}"] if task.write != "end" else []
    how += [f"overruns {task.overrun}"] if task.overrun != "queue" else []
    return f"{of.computer_name}.{of.name}", task.component or "load", _released(task), ", ".join(how)


def _message(of: PlacedMessage) -> tuple[str, ...]:
    message, network = of.message, of.network
    keys = ("identifier", "slot") if network.kind != "ethernet" else ("priority",)
    how = [f"{network.kind}, {network.bit_rate:g} bit/s", f"{message.bytes} bytes"]
    how += [f"{key} {getattr(message, key)}" for key in keys if getattr(message, key) is not None]
    how += [f"corrupted {100.0 * network.error:g} %"] if network.error else []
    released = _released(message) if message.period or message.arrivals else "when written"
    return f"{of.network_name}.{of.name}", message.connection or "load", released, ", ".join(how)


def _released(of: Task | Message) -> str:
    if of.arrivals is not None:
        return f"{of.arrivals.poisson:g} a second at random"
    if isinstance(of, Task) and of.on is not None:
        return f"on {of.on}"
    parts = [f"every {time_text(of.period or 0.0)}"]
    parts += [f"from {time_text(of.offset)}"] if of.offset else []
    parts += [f"jitter {describe_varying(of.jitter)}"] if of.jitter else []
    return ", ".join(parts)


def describe_sampling(sampling: Sampling) -> str:
    """When a digital task runs."""
    parts = [f"every {time_text(sampling.period)}"]
    parts += [f"from {time_text(sampling.offset)}"] if sampling.offset else []
    parts += [f"jitter {_largest(sampling.jitter, sampling.jitter_distribution)}"] if sampling.jitter else []
    parts += [f"clock {sampling.clock_ratio:g} times true time"] if sampling.clock_ratio != 1.0 else []
    parts += ["by its own clock"] if sampling.clock == "fmu" else []
    parts += [f"clock {sampling.fmu_clock}"] if sampling.fmu_clock is not None else []
    return ", ".join(parts)


def describe_signals(x: Connection) -> str:
    """The variables that it carries, vectors as a whole; with the names at the receiver where they differ."""
    names, others = (list(map(variable_of, ends)) for ends in (x.start, x.end))
    carried = _shortened(names)
    return carried if names == others else f"{carried} -> {_shortened(others)}"


def describe_faults(x: Connection) -> str:
    """The faults of a connection; empty if its messages arrive unchanged, at once."""
    parts = [f"delay {describe_varying(x.delay)}"] if x.delay else []
    parts += [f"delay jitter {_largest(x.delay_jitter, x.jitter_distribution)}"] if x.delay_jitter else []
    if isinstance(x.loss, Distribution):
        parts.append(f"loss {describe_varying(x.loss, '{:g}'.format)}")
    elif x.loss:
        bursts = f" in bursts of {x.burst_length:g}" if x.burst_length is not None else ""
        parts.append(f"loss {100.0 * x.loss:g} %{bursts}")
    parts += ["hold first"] if x.hold == "first" else []
    for kind in ("noise", "quantisation"):
        given = {name: value for name, value in getattr(x, kind).items() if value}
        same = len(set(given.values())) == 1 and len(given) == len(x.start)
        named = [f"{next(iter(given.values())):g}"] if same else [f"{name} {value:g}" for name, value in given.items()]
        parts += [f"{kind} {', '.join(named)}"] if given else []
    parts += [f"times {x.scale:g}"] if x.scale != 1.0 else []
    parts += [f"plus {x.offset:g}"] if x.offset else []
    parts += ["jacobi"] if x.order == "jacobi" else []
    return ", ".join(parts)


def describe_source(source: Source) -> str:
    """The kind of a source, with its main parameter."""
    if source.constant is not None:
        return f"constant {source.constant:g}"
    if source.noise is not None:
        return f"white noise of intensity {source.noise:g}, held {time_text(source.period or 0.0)}"
    if source.file is not None:
        return f"{'way-points of' if source.is_motion else 'file'} {source.file.name}"
    return source.signal or f"trajectory of {source.trajectory}"


def describe_varying(of: Varying, formatted: Callable[[float], str] | None = None) -> str:
    """A number, or its distribution; default of `formatted`: as times."""
    formatted = formatted or time_text
    if not isinstance(of, Distribution):
        return formatted(of)
    if of.uniform is not None:
        return f"{formatted(of.uniform[0])} to {formatted(of.uniform[1])} uniform"
    if of.normal is not None and of.range is not None:
        mean, deviation = map(formatted, of.normal)
        return f"{mean} ± {deviation} normal, cut to {formatted(of.range[0])} to {formatted(of.range[1])}"
    if of.file is not None:
        return f"{of.column} of {of.file.name}, {of.order}"
    values = [formatted(value) for value in of.values or ()]
    if of.probabilities is not None:
        values = [f"{value} ({share:g})" for value, share in zip(values, of.probabilities, strict=True)]
    return f"one of {listed(values, MAX_NAMES_IN_CELL)}"


def _largest(jitter: Varying, spread: str) -> str:
    return describe_varying(jitter) if isinstance(jitter, Distribution) else f"{time_text(jitter)} {spread}"


def _fmu(component: Component) -> str:
    fmu, partition, instance = Path(component.fmu).name, component.partition, component.instance
    return fmu + (f", partition {partition}" if partition else "") + (f" of {instance}" if instance else "")


def _parameters(component: Component) -> str:
    return ", ".join(f"{name} = {value}" for name, value in component.parameters.items())


def _shortened(names: Sequence[str]) -> str:
    """Scalars of a vector under its name, as `position.{x,y,z}`; at most `MAX_NAMES_IN_CELL` names."""
    groups: dict[str, list[str]] = {}
    for name in names:
        stem, dot, last = name.rpartition(".")
        groups.setdefault(stem if dot else name, []).append(f"{dot}{last}" if dot else "")
    named = [
        f"{stem}{parts[0]}" if len(parts) == 1 else f"{stem}.{{{','.join(part[1:] for part in parts)}}}"
        for stem, parts in groups.items()
    ]
    return listed(named, MAX_NAMES_IN_CELL)
