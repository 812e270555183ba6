"""What can be asked to run: a system, or what means one and speaks of it in words of its own."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from orchestration.basics.bisection import Range
from orchestration.basics.errors import UsageError
from orchestration.basics.records import described_as
from orchestration.system.component import Parameter
from orchestration.system.model import System

Self = TypeVar("Self", bound="ControlLoop")
Twin = TypeVar("Twin", bound="Request")
Values = Mapping[str, Parameter]
"""By target, as axes of studies name them"""


@described_as("a System or a Scenario")
@runtime_checkable
class Request(Protocol):
    """What can be asked to run."""

    kind: ClassVar[str]
    """By which it is known what is drawn and judged of its runs: `run` of any system."""
    title: ClassVar[str | None]
    """What an SSP of it is called; None: as its file is."""
    description: ClassVar[str]
    """What it is, for an SSP."""

    @property
    def seed(self) -> int:
        """Of all random numbers of a run."""

    def as_system(self) -> System:
        """The system that it means; raises `UsageError` in the words of the system."""

    def in_own_terms(self, text: str) -> str:
        """`text` with the paths of its system as it calls them itself."""

    def paths_of(self, target: str) -> tuple[str, ...]:
        """The paths in its system of a target of its own; raises `UsageError` for what is none."""

    def range_of(self, quantity: str) -> Range | None:
        """Where a quantity that has a name is looked for; None for a name that says nothing here."""

    def with_twins(self: Twin, twin: Callable[[str], str]) -> Twin:
        """The same with other FMUs, each what `twin` makes of it."""

    def near_continuous(self, period: float) -> "Request | None":
        """The same sampled every `period` [s] and nothing late, lost or noisy; None where that cannot be known."""

    def warnings(self, parameters: Mapping[str, float]) -> tuple[str, ...]:
        """What may not be meant, by all numeric parameters that are flown, as COMPONENT.NAME."""

    def headline(self) -> str:
        """What was run, over a figure; empty if it has no words for that."""

    def to_toml(self) -> str:
        """The file that loads as it."""


@contextmanager
def errors_in_own_terms(request: Request) -> Iterator[None]:
    """What is wrong with the system of a request is said of the request, which is what somebody wrote."""
    try:
        yield
    except UsageError as error:
        said = request.in_own_terms(str(error))
        if said == str(error):
            raise
        raise type(error)(said) from error


def system_of(request: Request) -> System:
    """The system that a request means; raises `UsageError` in the request's own words."""
    with errors_in_own_terms(request):
        return request.as_system()


@dataclass(frozen=True, kw_only=True)
class InitialConditions:
    """One initial state of an ensemble."""

    size: float
    """of the initial error, in (0, 1], as a share of the largest of each kind"""
    values: Values


@described_as("an ensemble of starts")
@runtime_checkable
class Ensemble(Protocol):
    """Initial states, of which more leave the first ones as they are."""

    @property
    def count(self) -> int:
        """How many there are."""

    @property
    def first(self) -> int:
        """The index of the first; a start is the same in every ensemble that has its index."""

    def some(self, first: int, count: int) -> "Ensemble":
        """Others of the same kind."""

    def initial_conditions(self, request: Any) -> Sequence[InitialConditions]:
        """In the order of their indices."""


@described_as("a Vehicle")
@runtime_checkable
class Craft(Protocol):
    """What a plant is made of, and what its controllers are told of it."""

    @property
    def name(self) -> str:
        """What it is called."""

    def parameters_for(self, controller: str) -> Mapping[str, Parameter]:
        """The parameters of the plant and of the controller of this name or path, by target."""


@described_as("a Scenario")
@runtime_checkable
class ControlLoop(Request, Protocol):
    """A request that knows its plant from its controller: what controllers can be compared and tuned on."""

    @property
    def vehicle(self) -> Craft | None:
        """What its plant is, where that is said as a whole."""

    def with_values(self: Self, values: Mapping[str, Any]) -> Self:
        """The same with other values, by target; raises `UsageError` for a target that there is not."""

    def without_vehicle(self: Self) -> Self:
        """The same, where what it flies is said elsewhere."""

    def craft(self, given: str | None, folder: Path, *, plant: Values, controller: Values) -> Craft:
        """A vehicle by name, or by a path that starts at `folder`, with these parameters on top; None: those alone."""

    def ensemble(self, table: Mapping[str, Any], beside: Sequence[str] = ()) -> Ensemble:
        """The starts that a table of a file says, which may have keys `beside`; raises `UsageError`."""
