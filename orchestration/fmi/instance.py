"""What a run needs of an instance of an FMU, wherever it lives and whatever version of FMI it is of."""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol, TypeVar

from fmpy.model_description import ModelDescription

from orchestration.basics.simulator import Simulator
from orchestration.fmi.model import Kind, Model, Variable
from orchestration.fmi.values import Value

T = TypeVar("T", bound="Instance")


class Instance(Simulator, Protocol):
    """A simulator that has parameters, can be reset and is closed at the end."""

    path: Path
    name: str
    model: Model
    warnings: list[str]
    """what the FMU has warned of since it was instantiated or reset, and parameters that it has not kept"""
    failed: bool
    """Whether a call has failed: the instance is then never called again."""
    stopped: bool
    """Whether it has ended a run or discarded a step: it is then for no other run, whatever a reset would do."""

    def set(self, name: str, value: Value) -> None:
        """Set one variable before initialisation; raises `UsageError` for a value it cannot take."""

    def set_tolerance(self, tolerance: float) -> None:
        """Give its solver a relative tolerance, before initialisation, instead of that of its declared experiment."""

    def get(self, name: str) -> Value:
        """The value of one variable: a Boolean as one, a String as a text, any other as a float."""

    def reset(self) -> None:
        """Back to the state after instantiation, all parameters at their defaults, as far as the FMU does it."""

    def close(self) -> None:
        """Free the instance and what was made for it."""

    @property
    def description(self) -> ModelDescription:
        """What it says of itself, as fmpy reads it."""
        return self.model.description

    @property
    def variables(self) -> Mapping[str, Variable]:
        """What it has, by name."""
        return self.model.variables

    def variable(self, name: str) -> Variable:
        """One of them; raises `UsageError` naming those that are near."""
        return self.model.variable(name, f"{self.name}.{name}")

    def names(self, *causalities: str, kind: Kind = "Real") -> tuple[str, ...]:
        """Those of a type and of one of the causalities, in the order of the description."""
        return self.model.names(*causalities, kinds=(kind,))

    def __enter__(self: T) -> T:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


class Loader(Protocol):
    """Gives an instance of an FMU for one run."""

    def __call__(self, path: Path, instance_name: str) -> AbstractContextManager[Instance]:
        """An instance as it is after instantiation, all parameters at their defaults."""
