"""A connection of a system: the signals that travel together from one component to another, and their faults."""

from collections.abc import Mapping
from dataclasses import field, replace

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import record
from orchestration.systems.system.choices import Hold, Order, Spread
from orchestration.systems.system.distribution import (
    Varying,
    is_random,
    require_losses,
    require_spread,
    require_varying,
    spreads,
)
from orchestration.systems.system.requirements import is_finite, require


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
