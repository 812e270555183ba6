"""What a system is: frozen values, checked for what they mean by themselves; no FMU is opened here."""

import functools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, ClassVar

from orchestration.basics.errors import UsageError
from orchestration.basics.records import Scalar, record
from orchestration.expressions.syntax import is_number, parse
from orchestration.signals import WINDS
from orchestration.system.choices import Align, Clock, Hold, Interpolation, Order, Spread
from orchestration.system.computers import Computer, Network
from orchestration.system.distribution import (
    Varying,
    highest,
    is_random,
    reads_file,
    require_losses,
    require_spread,
    require_varying,
    spreads,
)
from orchestration.system.placement import (
    expect_placement,
    placed_messages,
    placed_tasks,
    with_tasks,
)
from orchestration.system.requirements import (
    is_finite,
    require,
    require_not_negative,
    require_own_clock,
    require_positive,
)
from orchestration.system.times import is_at_least
from orchestration.system.written import tables_of

Parameter = Scalar


@record()
class Sampling:
    """When a digital task runs; times in seconds of the true clock, but for `period` and `offset` (its own)."""

    period: float
    """The period T of the task [s], in its own time: instant k is offset + kT."""
    offset: float = 0.0
    """The time of the first instant [s], in its own time."""
    jitter: Varying = 0.0
    """The largest lateness J of an instant [s], drawn for each, or how the lateness itself is distributed; it is less
    than the period."""
    jitter_distribution: Spread = "uniform"
    """How a lateness of which the largest is given is drawn over [0, J]; normal is centred at J/2 with standard
    deviation J/6, cut to the range."""
    clock_ratio: float = 1.0
    """The seconds r that the component believes pass per true second."""
    clock: Clock = "master"
    """Who decides when it samples: the master, or the FMU by its parameters sample_period and sample_offset."""

    def __post_init__(self) -> None:
        require_positive(self, "period", "clock_ratio")
        require_not_negative(self, "offset")
        require_varying(self, "jitter")
        require_spread(self.jitter_distribution, self.jitter)
        require(is_at_least(self.period, self.clock_ratio), "period", self.period, "at least a nanosecond")
        if not reads_file(self.jitter):
            self.expect_jitter_within_period()
        if self.clock == "fmu":
            require_own_clock(self)

    @property
    def is_random(self) -> bool:
        """Whether seeds make a difference to its instants."""
        return spreads(self.jitter)

    def expect_jitter_within_period(self) -> None:
        """Raise `UsageError` for a lateness of a period or more; of a trace that is known when it is read."""
        longest, most = self.period / self.clock_ratio, highest(self.jitter)
        require(most < longest, "jitter", most, f"less than the period of {longest:g} s")


@record()
class TaskSampling(Sampling):
    """What is known beforehand of the instants of a task: its period, or that of what releases it, about.

    A system makes it of what it says of the task; when the task runs is found by the scheduler.
    """

    task: str
    """The path of the task."""


@record()
class SamplingOnArrival(Sampling):
    """When a digital task runs that is released by messages: whenever one arrives."""

    on: str
    """The connection whose arriving messages it runs on, in place of a period."""
    period: float = 0.0
    """About; a system knows it."""

    def __post_init__(self) -> None:
        require_positive(self, "clock_ratio")
        for key in ("offset", "jitter"):
            require(getattr(self, key) == 0.0, key, getattr(self, key), "0 beside on: messages say when it runs")
        require(self.clock == "master", "clock", self.clock, "master beside on: messages say when it runs")


def is_foreseen(sampling: Sampling) -> bool:
    """Whether the scheduler finds its instants."""
    return isinstance(sampling, (TaskSampling, SamplingOnArrival))


@record()
class Component:
    """An FMU, its parameters, and how it is stepped: at sampling instants if it has `sampling`, else continuously."""

    fmu: str
    """The name of one of this project's FMUs, or the path of an .fmu file; in a file, relative to its folder."""
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    """The parameters to set, by their names in the FMU and in the units that it declares."""
    step: float | None = None
    """The distance of the communication points [s] of a component in continuous time; a component has either this or
    `sampling`."""
    sampling: Sampling | None = None
    """When a digital task runs; a component has either this or `step`, and none of them if it is the task of a
    computer."""
    tolerance: float | None = None
    """The relative tolerance of the FMU's own solver; without it, that of the experiment that the FMU declares,
    if any."""
    align: Align = "exact"
    """What becomes of an instant between two points of a component that takes its own fixed step only: an error
    (exact), or it moves to the next point (next)."""
    record: tuple[str, ...] | None = None
    """The variables to record beside what is exchanged; without it, all outputs and local Reals."""

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            require_positive(self, "tolerance")
        if self.step is not None:
            require_positive(self, "step")
            require(is_at_least(self.step, 1.0), "step", self.step, "at least a nanosecond")
        if self.sampling is not None:
            require(self.step is None, "step", self.step, "none beside sampling, whose period it follows")


@record()
class Connection:
    """One message from a component to another: its signals travel together; times in seconds."""

    name: str
    """The name by which paths and events call it; in a file without one, its index."""
    start: tuple[str, ...]
    """The outputs that it carries, as COMPONENT.VARIABLE, of one component (`from` in files)."""
    end: tuple[str, ...]
    """As many inputs of one component, in the same order (`to` in files)."""
    order: Order = "gauss-seidel"
    """Whether a message can be there at the instant at which it was sent (gauss-seidel), or at the next one of its
    sender (jacobi); in a file without it, what `order` at the top says."""
    delay: Varying = 0.0
    """The time d from sending to arrival [s], or how it is distributed; it may exceed a period, and messages never
    overtake each other."""
    delay_jitter: Varying = 0.0
    """The largest random addition J_d to the delay [s], or how the addition itself is distributed."""
    jitter_distribution: Spread = "uniform"
    """How an addition of which the largest is given is drawn over [0, J_d]; normal is centred at J_d/2, cut to the
    range."""
    loss: Varying = 0.0
    """The probability that a message is lost, or values of 0 and 1, as of a trace: 1 for one that is lost."""
    burst_length: float | None = None
    """The mean number of losses in a row (Gilbert-Elliott); without it, losses are independent."""
    hold: Hold = "zero"
    """What the receiver gets between arrivals: the last value (zero), or the line through the last two (first)."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """The standard deviation of normal noise by variable of the sender, in its unit; a vector's name stands for its
    components. In a file, one number is for all of them."""
    quantisation: Mapping[str, float] = field(default_factory=dict)
    """The step to which a value is rounded, in its unit, by variable of the sender, likewise."""
    scale: float = 1.0
    """The factor in scale · value + offset, which is what arrives; without either of them, units must be the same."""
    offset: float = 0.0
    """What is added after the scale, in the unit of the receiver."""
    stated: bool = False
    """Whether scale and offset are meant as they are even if they change nothing: then units may differ. In a file
    they are where one of them is given."""

    @property
    def converts(self) -> bool:
        """Whether scale and offset change a value."""
        return self.scale != 1.0 or self.offset != 0.0

    @property
    def is_random(self) -> bool:
        """Whether seeds make a difference to when its messages arrive, and which."""
        return is_random(self.delay) or spreads(self.delay_jitter) or spreads(self.loss)

    def __post_init__(self) -> None:
        require_varying(self, "delay", "delay_jitter")
        require_spread(self.jitter_distribution, self.delay_jitter)
        require_losses(self, self.burst_length, "loss")
        for what, values in (("noise", self.noise), ("quantisation", self.quantisation)):
            for name, value in values.items():
                require(is_finite(value) and value >= 0.0, f"{what} of {name}", value, "zero or positive")
                if not self.places(name):
                    raise UsageError(f"{what}: {name} is no signal of it; expected one of {', '.join(self._vectors())}")
        for what in ("scale", "offset"):
            value = getattr(self, what)
            require(is_finite(value), what, value, "a finite number")
        require(
            len(self.start) == len(self.end) > 0, "to", len(self.end), f"{len(self.start)} inputs, one for each output"
        )
        for what, ends in (("from", self.start), ("to", self.end)):
            owners = {component_of(end) for end in ends}
            require(len(owners) == 1, what, ", ".join(ends), "variables of one component")

    def places(self, name: str) -> list[int]:
        """Where in a message a variable of the sender is; those of its components for a vector; none if in no place."""
        carried = map(variable_of, self.start)
        return [i for i, variable in enumerate(carried) if name in (variable, variable.rpartition(".")[0])]

    def _vectors(self) -> list[str]:
        """What it carries, vectors by their name."""
        carried = map(variable_of, self.start)
        return list(dict.fromkeys(variable.rpartition(".")[0] or variable for variable in carried))

    @property
    def sender(self) -> str:
        """The component that it comes from."""
        return component_of(self.start[0])

    @property
    def receiver(self) -> str:
        """The component that it goes to."""
        return component_of(self.end[0])


@record()
class Source:
    """What drives inputs from outside: a constant, a file, white noise, a signal by name or the built-in trajectory.

    Exactly one of `constant`, `file`, `noise`, `signal` and `trajectory` is given, but that `trajectory` may stand
    beside a motion or a file. A motion, which is what most signals are and what way-points make, feeds inputs whose
    names end with QUANTITY.AXIS, as reference.position.x: position, velocity, acceleration, jerk and snap along x, y
    and z.
    """

    to: tuple[str, ...] = ()
    """The inputs that it feeds, as COMPONENT.VARIABLE; of a motion it may be empty, for what only objectives need."""
    constant: float | None = None
    """A constant value, in the unit of the inputs."""
    file: Path | None = None
    """The path of a CSV file with `time` [s] and one column for each input, named as the input without its component,
    or with way-points; in a file, relative to its folder."""
    interpolation: Interpolation = "linear"
    """What holds between the rows of a file: the line (linear), the row before (previous), or a smooth curve (spline)
    whose rows are way-points, columns x, y, z [m] and `time` [s], or else `hold` [s] and `speed` [m/s] where they are
    told."""
    columns: tuple[str, ...] | None = None
    """The columns of the file in the order of the inputs, where they are not named as these."""
    noise: float | None = None
    """The intensity [unit² s] of white noise: normal values with variance noise / period, each held over `period`."""
    period: float | None = None
    """How long each value of the noise is held [s]."""
    signal: str | None = None
    """The name of a motion (hover, step, circle, lemniscate, helix, paper), or of gusts of wind (dryden: north, east,
    down)."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the signal; of way-points without times, `speed` [m/s] and `acceleration` [m/s²], which the times
    follow from."""
    scale: float = 1.0
    """The factor by which all values of a file or a signal are multiplied."""
    trajectory: str | None = None
    """The component that follows it, at those of its inputs SOURCE.position.x … SOURCE.snap.z that it has. Without a
    signal or a file it follows what its parameters trajectory.* say, or, where it has none, the paper's trajectory."""

    @property
    def is_built_in(self) -> bool:
        """Whether it is the trajectory that a component has built in."""
        return self.trajectory is not None and self.signal is None and self.file is None

    @property
    def is_motion(self) -> bool:
        """Whether it says where to be and how to move there."""
        return self.interpolation == "spline" or (self.signal is not None and self.signal not in WINDS)

    @property
    def is_random(self) -> bool:
        """Whether it draws random numbers."""
        return self.noise is not None or self.signal in WINDS

    @property
    def is_held(self) -> bool:
        """Whether its values are constant from one instant to the next."""
        return self.constant is not None or self.noise is not None

    def signals(self, name: str) -> tuple[str, ...]:
        """What is recorded of the source of that name: by the names of the inputs, unless it feeds two of one name."""
        if self.trajectory is not None or (self.is_motion and not self.to):
            return tuple(f"{name}.position.{axis}" for axis in "xyz")
        variables = [variable_of(end) for end in self.to]
        fed = [end if variables.count(variable_of(end)) > 1 else variable_of(end) for end in self.to]
        return tuple(each if each.startswith(f"{name}.") else f"{name}.{each}" for each in fed)

    def __post_init__(self) -> None:
        kinds = ("constant", "file", "noise", "signal", "trajectory")
        given = [kind for kind in kinds if getattr(self, kind) is not None]
        if given in (["file", "trajectory"], ["signal", "trajectory"]):
            given.pop()
        require(len(given) == 1, "source", " and ".join(given) or "nothing", f"one of {', '.join(kinds)}")
        if self.noise is not None:
            require_not_negative(self, "noise")
            require(self.period is not None, "period", "none", "how long each value is held, in seconds")
            require_positive(self, "period")
            require(is_at_least(self.period or 0.0, 1.0), "period", self.period, "at least a nanosecond")
        else:
            nobody = self.trajectory is None or not self.to
            require(nobody, "to", ", ".join(self.to), "none: a trajectory is for objectives")
            require(self.constant is None or is_finite(self.constant), "constant", self.constant, "a finite number")
            require(self.period is None, "period", self.period, "none without noise")
        self._expect_file()
        self._expect_signal()

    def _expect_file(self) -> None:
        is_file, is_table = self.file is not None, self.file is not None and self.interpolation != "spline"
        require(is_file or self.interpolation == "linear", "interpolation", self.interpolation, "none without a file")
        if self.columns is not None:
            require(is_table, "columns", ", ".join(self.columns), "none but for a file with a column for each input")
            count = len(self.to)
            require(len(self.columns) == count, "columns", len(self.columns), f"{count} names, one for each input")

    def _expect_signal(self) -> None:
        if self.signal is not None or self.interpolation == "spline":
            from orchestration.signals import library  # not before: the command line answers --help without it

            _ = library.limits(self.parameters) if self.signal is None else library.made(self.signal, self.parameters)
        else:
            given = ", ".join(self.parameters)
            require(not self.parameters, "parameters", given, "none but for a signal by name, or way-points")
        require(is_finite(self.scale), "scale", self.scale, "a finite number")
        with_scale = self.scale == 1.0 or self.file is not None or self.signal is not None
        require(with_scale, "scale", self.scale, "none but for a file or a signal by name")
        if self.signal in WINDS:
            require(len(self.to) == 3, "to", len(self.to), "3 inputs, for the wind along north, east and down")
        if self.is_motion:
            for end in self.to:
                require(".".join(end.split(".")[-2:]) in MOTION, "to", end, "inputs that end in position.x … snap.z")


MOTION = tuple(f"{each}.{axis}" for each in ("position", "velocity", "acceleration", "jerk", "snap") for axis in "xyz")
"""What a motion says, in its order"""


DIVERGED, TERMINATED = "diverged", "terminated"
"""What a run is called, whatever its criterion is, that left the region that counts, or that an FMU has ended"""


@record()
class Criterion:
    """What a good run is, as expressions."""

    good: str | None = None
    """The condition over objectives, at the end, by which a run is good; without it, that is not asked."""
    diverged: str | None = None
    """The condition over signals that ends a run at the first instant at which it holds; without it, none does."""
    outcomes: tuple[str, str] = ("good", "bad")
    """What a run is called that is good, and one that is not; one that diverged, or was terminated, is called so."""

    def __post_init__(self) -> None:
        given = ", ".join(self.outcomes)
        two = len({*self.outcomes, DIVERGED, TERMINATED, ""}) == 5 and given.isprintable()
        require(two, "outcomes", ascii(given), f"two names, and neither is {DIVERGED} or {TERMINATED}")


@record()
class System:
    """Components and what connects and drives them, what a run comes to and when it is good.

    Raises `UsageError` for what cannot be whatever the FMUs are.
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
    """What drives inputs from outside, by name."""
    computers: Mapping[str, Computer] = field(default_factory=dict)
    """The processors whose tasks components are, by name."""
    networks: Mapping[str, Network] = field(default_factory=dict)
    """The buses and switches over which connections go, by name."""
    objectives: Mapping[str, str] = field(default_factory=dict)
    """What a run comes to: expressions by name."""
    optional: tuple[str, ...] = ()
    """The objectives that are without a value where an FMU has no variable of a name in them."""
    criterion: Criterion = field(default_factory=Criterion)
    """When a run is good, and when it has diverged."""
    streams: Mapping[str, int] = field(default_factory=dict)
    """The random streams that have a number instead of a name, as `connections.NAME.CAUSE` and
    `components.NAME.jitter`."""
    operating_point: Mapping[str, Any] = field(default_factory=dict)
    """What to change, by path, for the system to rest: where the local limit is taken. It is checked when it is
    used."""

    def __repr__(self) -> str:
        named = {
            "components": self.components,
            "connections": [x.name for x in self.connections],
            "sources": self.sources,
            "computers": self.computers,
            "networks": self.networks,
            "objectives": self.objectives,
        }
        listed = [f"{what}: {', '.join(_few([*names]))}" for what, names in named.items() if names]
        return f"<System of {self.stop_time:g} s; {'; '.join(listed)}>"

    @property
    def fmus(self) -> dict[str, str]:
        """The FMU of each component, by its name."""
        return {name: component.fmu for name, component in self.components.items()}

    def to_toml(self) -> str:
        """The system file that loads as this system, wherever it lies."""
        import tomli_w

        return tomli_w.dumps({key: value for key, value in tables_of(self).items() if value not in ({}, [])})

    # What is asked of any request (`request.Request`): a system is what it means, and has no words of its own.

    kind: ClassVar[str] = "run"
    title: ClassVar[str | None] = None
    description: ClassVar[str] = ""

    def as_system(self) -> "System":
        """Itself."""
        return self

    def in_words(self, text: str) -> str:
        """`text` as it is."""
        return text

    def paths_of(self, target: str) -> tuple[str, ...]:
        """`target` is a path."""
        return (target,)

    def range_of(self, quantity: str) -> None:
        """No quantity has a name."""

    def with_twins(self, twin: Callable[[str], str]) -> "System":
        """The same with other FMUs, each what `twin` makes of it."""
        twins = {name: twin(fmu) for name, fmu in self.fmus.items()}
        if twins == self.fmus:
            return self
        components = {name: replace(each, fmu=twins[name]) for name, each in self.components.items()}
        return replace(self, components=components)

    def near_continuous(self, period: float) -> None:
        """What of it is digital, and where, it does not say."""

    def warnings(self, parameters: Mapping[str, float]) -> tuple[str, ...]:
        """None."""
        return ()

    def headline(self) -> str:
        """None."""
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
        components = with_tasks(self.components, self.connections, self.computers, self.networks)
        object.__setattr__(self, "components", components)
        _require_names("connections", (x.name for x in self.connections))
        _require_names("objectives", self.objectives)
        causes = self._causes()
        for place, number in self.streams.items():
            require(place in causes, "streams", place, f"one of {', '.join(causes) or 'none'}")
            require(number >= 0, f"streams.{place}", number, "a number from 0 on")
        for name in self.sources:
            require(name not in self.components, f"sources.{name}", name, "another name than a component's")
        fed: dict[str, str] = {}
        for place, start, end in self._feeds():
            for what, given in (("from", start), ("to", end)):
                if given is not None and component_of(given) not in self.components:
                    known = ", ".join(self.components)
                    raise UsageError(f"{place}.{what}: {given}: no such component; expected one of {known}")
            if end in fed:
                raise UsageError(f"{place}.to: {end} is fed by {fed[end]} already; expected one connection or source")
            fed[end] = place
        names = [x.name for x in self.connections]
        for name in names:
            require(names.count(name) == 1, "connections", name, "a name of its own for each")
        expect_placement(self)
        _require_expressions(tuple(expressions(self)))

    def _causes(self) -> list[str]:
        """What random numbers are drawn for."""
        tasks = [f"components.{name}.jitter" for name, c in self.components.items() if c.sampling is not None]
        sent = [f"connections.{x.name}.{cause}" for x in self.connections for cause in _CAUSES]
        on_computers = [f"{each.place}.{cause}" for each in placed_tasks(self.computers) for cause in TASK_CAUSES]
        over_networks = [f"{each.place}.{cause}" for each in placed_messages(self.networks) for cause in MESSAGE_CAUSES]
        sent += [*on_computers, *over_networks]
        return [*tasks, *sent, *(f"sources.{name}.value" for name, x in self.sources.items() if x.is_random)]

    def _feeds(self) -> list[tuple[str, str | None, str]]:
        feeds: list[tuple[str, str | None, str]] = [
            (f"connections.{x.name}", start, end) for x in self.connections for start, end in zip(x.start, x.end)
        ]
        return feeds + [(f"sources.{name}", None, end) for name, source in self.sources.items() for end in source.to]


_CAUSES = ("delay", "delay_jitter", "loss", "noise")
"""Of a connection"""
TASK_CAUSES, MESSAGE_CAUSES = ("execution", "jitter", "arrivals"), ("jitter", "arrivals", "error")
"""What random numbers are drawn for of a task, and of a message"""


def _few(names: list[str], most: int = 6) -> list[str]:
    return names if len(names) <= most else [*names[: most - 1], f"… {len(names)} in all"]


def _require_names(table: str, names: Iterable[str], without: str = "") -> None:
    """Names are parts of paths and of messages of one line."""
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
def _require_expressions(listed: tuple[tuple[str, str], ...]) -> None:
    """They can be read, and those of the criterion are conditions; runs of a study have them in common."""
    for place, text in listed:
        try:
            node = parse(text)
        except UsageError as error:
            raise UsageError(f"{place}: {error}") from error
        if place.startswith("criterion."):
            meant = parse(dict(listed).get(f"objectives.{text.strip()}", text))
            require(not is_number(meant) and not is_number(node), place, text, "a condition, as in peak < 2.5")


def component_of(variable: str) -> str:
    """The component of COMPONENT.VARIABLE."""
    return variable.partition(".")[0]


def variable_of(variable: str) -> str:
    """The variable of COMPONENT.VARIABLE."""
    return variable.partition(".")[2]
