"""The interface of an instance of an FMU, in whichever process it is and of whichever version of FMI."""

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol, TypeVar

from fmpy.model_description import ModelDescription

from orchestration.components.fmi.model import Kind, Model, Variable
from orchestration.components.fmi.values import Value
from orchestration.foundation.basics.simulator import Floats, Simulator

T = TypeVar("T", bound="Instance")


class Instance(Simulator, Protocol):
    """A simulator that has parameters, can be reset and is closed at the end."""

    path: Path
    name: str
    model: Model
    warnings: list[str]
    """Warnings of the FMU since it was instantiated or reset, and of parameters that it has not kept"""
    failed: bool
    """Whether a call has failed; the instance is then never called again."""
    stopped: bool
    """Whether it has ended a run or discarded a step; it is then not reused, even if it could be reset."""

    def set(self, name: str, value: Value) -> None:
        """Set one variable before initialisation; raises `UsageError` for an invalid value."""

    def set_tolerance(self, tolerance: float) -> None:
        """Set the relative tolerance of its solver, before initialisation; default: that of its declared experiment."""

    def get(self, name: str) -> Value:
        """The value of one variable: a Boolean as one, a String as a text, any other as a float."""

    def reset(self) -> None:
        """Return to the state after instantiation, with all parameters at their defaults, as far as the FMU does so."""

    def close(self) -> None:
        """Free the instance and its resources."""

    def initialise(self, inputs: Sequence[str], values: Floats, stop: float = math.inf) -> None:
        """Initialise it at time 0 with these values of its inputs."""
        self.enter_initialization(0.0, stop)
        self.writer(inputs, values)()
        self.exit_initialization()

    @property
    def description(self) -> ModelDescription:
        """Its model description, as fmpy reads it."""
        return self.model.description

    @property
    def variables(self) -> Mapping[str, Variable]:
        """Its variables by name."""
        return self.model.variables

    def variable(self, name: str) -> Variable:
        """A variable by name; raises `UsageError` naming similar ones."""
        return self.model.variable(name, f"{self.name}.{name}")

    def names(self, *causalities: str, kind: Kind = "Real") -> tuple[str, ...]:
        """The variables of a type and of one of the causalities, in the order of the description."""
        return self.model.names(*causalities, kinds=(kind,))

    def __enter__(self: T) -> T:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


class Loader(Protocol):
    """Provides an instance of an FMU for one run."""

    def __call__(self, path: Path, instance_name: str) -> AbstractContextManager[Instance]:
        """An instance in the state after instantiation, with all parameters at their defaults."""
