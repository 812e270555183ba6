"""Connections: signals that travel together from one component to another, and their faults; sources of inputs."""

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated, Any

from orchestration.foundation.basics.errors import A_FLOAT, UsageError
from orchestration.foundation.basics.fitting import Before
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.times import is_at_least
from orchestration.systems.signals import WINDS
from orchestration.systems.system.choices import Hold, Interpolation, Order, Outside, Spread
from orchestration.systems.system.distribution import (
    Varying,
    is_random,
    require_losses,
    require_spread,
    require_varying,
    spreads,
)
from orchestration.systems.system.requirements import is_finite, require, require_not_negative, require_positive


@record()
class Connection:
    """A message from one component to another, whose signals travel together; times in seconds."""

    name: str
    """The name by which paths and events call it; default in a file: its index."""
    start: tuple[str, ...]
    """The outputs that it carries, as COMPONENT.VARIABLE, of one component (`from` in files)."""
    end: tuple[str, ...]
    """The inputs of one component, as many and in the same order (`to` in files)."""
    order: Order = "gauss-seidel"
    """Whether a message can arrive at the instant at which it is sent (gauss-seidel), or at the next one of its sender
    (jacobi); default in a file: `order` at the top."""
    delay: Varying = 0.0
    """The time d from sending to arrival [s], or its distribution; it may exceed a period, and messages never overtake
    each other."""
    delay_jitter: Varying = 0.0
    """The largest random addition J_d to the delay [s], or the distribution of the addition itself."""
    jitter_distribution: Spread = "uniform"
    """The distribution over [0, J_d] of an addition whose largest value is given; normal is centred at J_d/2 with
    standard deviation J_d/6, cut to the range."""
    loss: Varying = 0.0
    """The probability that a message is lost, or values of 0 and 1, as of a trace: 1 for a lost one."""
    burst_length: float | None = None
    """The mean number of losses in a row (Gilbert-Elliott); default: losses are independent."""
    hold: Hold = "zero"
    """The value that the receiver gets between arrivals: the last one (zero), or the line through the last two
    (first)."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """The standard deviation of normal noise by variable of the sender, in its unit; a vector's name stands for its
    components. In a file, one number applies to all of them."""
    quantisation: Mapping[str, float] = field(default_factory=dict)
    """The step to which a value is rounded, in its unit, by variable of the sender, likewise."""
    scale: float = 1.0
    """The factor in scale · value + offset, which is what arrives; without either of them, units must be the same."""
    offset: float = 0.0
    """The offset that is added after the scale, in the unit of the receiver."""
    stated: bool = False
    """Whether scale and offset are given, even if they change nothing: then units may differ. In a file, one of them is
    enough."""

    @property
    def converts(self) -> bool:
        """Whether scale and offset change a value."""
        return self.scale != 1.0 or self.offset != 0.0

    @property
    def is_random(self) -> bool:
        """Whether the seed changes which of its messages arrive, and when."""
        return is_random(self.delay) or spreads(self.delay_jitter) or spreads(self.loss)

    def with_delay(self, delay: float) -> "Connection":
        """The connection with one delay [s] for all messages, of which none is lost."""
        return replace(self, delay=delay, delay_jitter=0.0, jitter_distribution="uniform", loss=0.0, burst_length=None)

    def __post_init__(self) -> None:
        require_varying(self, "delay", "delay_jitter")
        require_spread(self.jitter_distribution, self.delay_jitter)
        require_losses(self, self.burst_length, "loss")
        for what, values in (("noise", self.noise), ("quantisation", self.quantisation)):
            for name, value in values.items():
                if isinstance(value, str) and value.startswith("{"):
                    alone = f"connections.{self.name}.{what}.{name}=0.001"
                    raise UsageError(f"{what} = {value}: expected one number for all signals, or for one as {alone}")
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
        """The places in the message of a variable of the sender, or of the components of a vector."""
        carried = map(variable_of, self.start)
        return [i for i, variable in enumerate(carried) if name in (variable, variable.rpartition(".")[0])]

    def _vectors(self) -> list[str]:
        """The variables that it carries, vectors by their name."""
        carried = map(variable_of, self.start)
        return list(dict.fromkeys(variable.rpartition(".")[0] or variable for variable in carried))

    @property
    def sender(self) -> str:
        """The component that sends it."""
        return component_of(self.start[0])

    @property
    def receiver(self) -> str:
        """The component that receives it."""
        return component_of(self.end[0])


def component_of(variable: str) -> str:
    """The component of COMPONENT.VARIABLE."""
    return variable.partition(".")[0]


def variable_of(variable: str) -> str:
    """The variable of COMPONENT.VARIABLE."""
    return variable.partition(".")[2]


MOTION = tuple(f"{each}.{axis}" for each in ("position", "velocity", "acceleration", "jerk", "snap") for axis in "xyz")
"""The values of a motion, in its order"""


def _exact(value: Any) -> Any:
    """The value; raises the `ValueError` that Pydantic has words for where a float would round a whole number."""
    if type(value) is int and abs(value) < 2**64 and float(value) != value:
        from pydantic_core import PydanticCustomError

        raise PydanticCustomError("exact", f"Input should be {A_FLOAT}")
    return value


@record()
class Source:
    """What drives inputs from outside: a constant, a file, white noise, a signal by name or the built-in trajectory.

    Exactly one of `constant`, `file`, `noise`, `signal` and `trajectory` is given, except that `trajectory` may stand
    beside a motion or a file. Motions are way-points and most signals. A motion feeds inputs whose names end with
    QUANTITY.AXIS, as reference.position.x: position, velocity, acceleration, jerk and snap along x, y and z.
    """

    to: tuple[str, ...] = ()
    """The inputs that it feeds, as COMPONENT.VARIABLE; empty for a motion that only objectives use."""
    constant: Annotated[float | None, Before(_exact)] = None
    """A constant value, in the unit of the inputs."""
    file: Path | None = None
    """The path of a CSV file with `time` [s] and one column for each input, named as the input without its component,
    or with way-points; in a file, relative to its folder. Two rows of one time are a jump."""
    interpolation: Interpolation = "linear"
    """The values between the rows of a file: the line (linear), the row before (previous), or a smooth curve (spline)
    through the rows as way-points, with columns x, y, z [m] and either `time` [s] or, optionally, `hold` [s] and
    `speed` [m/s]."""
    start_time: float | None = None
    """The time of a file with a column for each input at which the run begins [s]; default: 0."""
    outside: Outside | None = None
    """The values of such a file before its first and after its last row: these rows' (held); default: it must cover
    the run."""
    within_steps: bool = False
    """Whether FMUs for model exchange follow the lines between such rows also within their steps; default: they hold
    the values that a step begins with."""
    columns: tuple[str, ...] | None = None
    """The columns of the file in the order of the inputs; default: the names of the inputs."""
    noise: float | None = None
    """The intensity [unit² s] of white noise: normal values with variance noise / period, each held over `period`."""
    period: float | None = None
    """The time for which each value of the noise is held [s]."""
    signal: str | None = None
    """The name of a motion (hover, step, circle, lemniscate, helix, paper), or of gusts of wind (dryden: north, east,
    down)."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the signal; for way-points without times, the limits `speed` [m/s] and `acceleration` [m/s²] that
    determine the times."""
    scale: float = 1.0
    """The factor by which all values of a file or a signal are multiplied."""
    trajectory: str | None = None
    """The component that follows it, at those of the inputs SOURCE.position.x … SOURCE.snap.z that it has. Without a
    signal or a file, the component follows its parameters trajectory.* or, if it has none, the paper's trajectory."""

    @property
    def is_built_in(self) -> bool:
        """Whether it is the built-in trajectory of a component."""
        return self.trajectory is not None and self.signal is None and self.file is None

    @property
    def is_motion(self) -> bool:
        """Whether it is a position with its derivatives up to snap."""
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
        """The recorded signals of the source called `name`: its inputs, with components where two have one name."""
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
        require(len(given) > 0, kinds[0], "none", f"it, or one of {', '.join(kinds[1:])}")
        if len(given) > 1:
            first, other = sorted(given, key=lambda kind: kind == "noise")[:2]
            apart = "; noise on top is a source of its own, to an input that the FMU adds" if other == "noise" else ""
            one = f"none beside {first}: a source has one of {', '.join(kinds)}{apart}"
            require(False, other, getattr(self, other), one)
        if self.noise is not None:
            require_not_negative(self, "noise")
            require(self.period is not None, "period", "none", "how long each value is held, in seconds")
            require_positive(self, "period")
            require(is_at_least(self.period or 0.0, 1.0), "period", self.period, "at least a nanosecond")
        else:
            is_alone = self.trajectory is None or not self.to
            require(is_alone, "to", ", ".join(self.to), "none: a trajectory is for objectives")
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
        for key in ("start_time", "outside"):
            given = getattr(self, key)
            require(is_table or given is None, key, given, "none but for a file with a column for each input")
        follows = is_table and self.interpolation == "linear" and self.scale == 1.0
        require(follows or not self.within_steps, "within_steps", "true", "false but for lines of a file as they are")
        require(self.start_time is None or is_finite(self.start_time), "start_time", self.start_time, "a finite number")

    def _expect_signal(self) -> None:
        if self.signal is not None or self.interpolation == "spline":
            from orchestration.systems.signals import library  # not before: the command line answers --help without it

            if self.signal is None:
                library.limits(self.parameters)
            else:
                library.make_signal(self.signal, self.parameters)
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
