"""Requests to run: a system, or what translates into one and has its own terms for it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from orchestration.foundation.basics.bisection import Range
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import described_as
from orchestration.systems.system.component import Values
from orchestration.systems.system.model import System
from orchestration.systems.system.starts import InitialConditions, Starts
from orchestration.systems.system.vehicle import Vehicle

Self = TypeVar("Self", bound="ControlLoop")
Twin = TypeVar("Twin", bound="Request")


@described_as("a System or a Scenario")
@runtime_checkable
class Request(Protocol):
    """A system to run, or what translates into one."""

    kind: ClassVar[str]
    """The key of the figures and criteria of its runs: `run` of any system."""
    title: ClassVar[str | None]
    """The name of an SSP of it; None: that of its file."""
    description: ClassVar[str]
    """The description in an SSP."""

    @property
    def seed(self) -> int:
        """The seed of all random numbers of a run."""

    def as_system(self) -> System:
        """The system that it translates into; raises `UsageError` in terms of the system."""

    def in_own_terms(self, text: str) -> str:
        """`text` with the paths of its system replaced by its own terms."""

    def paths_of(self, target: str) -> tuple[str, ...]:
        """The paths in its system of one of its targets; raises `UsageError` for an unknown one."""

    def range_of(self, quantity: str) -> Range | None:
        """The search range of a named quantity; None for an unknown name."""

    def with_twins(self: Twin, twin: Callable[[str], str]) -> Twin:
        """The same request with each FMU replaced by its `twin`."""

    def near_continuous(self, period: float) -> "Request | None":
        """The same request sampled every `period` [s] without faults or noise; None where that is undefined."""

    def mismatches(self, parameters: Mapping[str, float]) -> tuple[str, ...]:
        """Warnings about components that do not fit each other, from all numeric parameters, by COMPONENT.NAME."""

    def headline(self) -> str:
        """The title of a figure; empty without one."""

    def to_toml(self) -> str:
        """The text of the file that loads as this request."""


@contextmanager
def errors_in_own_terms(request: Request) -> Iterator[None]:
    """Translate errors about the system of a request into the terms of the request."""
    try:
        yield
    except UsageError as error:
        text = request.in_own_terms(str(error))
        if text == str(error):
            raise
        raise type(error)(text) from error


def system_of(request: Request) -> System:
    """The system of a request; raises `UsageError` in terms of the request."""
    with errors_in_own_terms(request):
        return request.as_system()


@described_as("a Scenario")
@runtime_checkable
class ControlLoop(Request, Protocol):
    """A request with a plant and a controller, on which controllers can be compared and tuned."""

    @property
    def vehicle(self) -> Vehicle | None:
        """Its plant, where that is given as a whole."""

    def with_values(self: Self, values: Mapping[str, Any]) -> Self:
        """The same request with new values, by target; raises `UsageError` for an unknown target."""

    def without_vehicle(self: Self) -> Self:
        """The same request without its vehicle, which is then given elsewhere."""

    def vehicle_of(self, name_or_path: str | None, folder: Path, *, plant: Values, controller: Values) -> Vehicle:
        """A vehicle by name, or by a path that starts at `folder`, with these parameters on top; None: only those."""

    def initial_conditions(self, starts: Starts) -> Sequence[InitialConditions]:
        """The initial conditions about the start of its reference, in the order of their indices."""
