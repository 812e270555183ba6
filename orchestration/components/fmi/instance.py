"""The interface of an instance of an FMU, in whichever process and of whichever version of FMI, and its values."""

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from fmpy.model_description import ModelDescription

from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.read_description import Kind, Model, Variable
from orchestration.foundation.basics.errors import A_FLOAT, QuadcosimError, UsageError, expected_name, shown
from orchestration.foundation.basics.simulator import Floats, Simulator

Value: TypeAlias = float | bool | str

_ROUNDING = {"Float32": 1e-6}
"""Relative differences that count as none, by type; 1e-12 for others: an FMU may store a value in other units"""

INTEGERS: Mapping[str, type[np.signedinteger[Any] | np.unsignedinteger[Any]]] = {
    "Integer": np.int32, "Enumeration": np.int32, "Int8": np.int8, "UInt8": np.uint8, "Int16": np.int16,
    "UInt16": np.uint16, "Int32": np.int32, "UInt32": np.uint32, "Int64": np.int64, "UInt64": np.uint64,
}  # fmt: skip
"""The numpy type of each integer type"""


NO_STATE = (
    "cannot save its state; expected canGetAndSetFMUstate and canSerializeFMUstate in its description, an option of "
    "many tools that export FMUs"
)
"""The words about an FMU whose state is to be saved, but cannot be"""


def convert_value(variable: Variable, value: object, place: str) -> Value:
    """Convert `value` to the type of the variable, an item of an enumeration to its number.

    Raises `UsageError` that names the place for an invalid value; a constant accepts its own value only.
    """
    converted = _of_its_type(variable, value, place)
    if variable.is_constant and number_of(variable, converted) != number_of(variable, variable.start):
        fixed = f"{variable.start}, which is fixed in this FMU: it is {variable.role}"
        raise UsageError(f"{place} = {shown(value)}: expected {fixed}")
    return converted


def _of_its_type(variable: Variable, value: object, place: str) -> Value:
    if variable.kind == "Boolean":
        return _of_kind(value, bool, place, "true or false")
    if variable.kind == "String":
        return _of_kind(value, str, place, "a text")
    if variable.kind in ("Integer", "Enumeration") and isinstance(value, float) and value.is_integer():
        value = int(value)  # as in ranges and on the command line
    if variable.choices:
        return _chosen(variable.choices, value, place)
    if variable.kind in ("Integer", "Enumeration"):
        bounds = np.iinfo(INTEGERS[variable.type])
        fits = isinstance(value, int) and not isinstance(value, bool) and bounds.min <= value <= bounds.max
        whole = _if(fits, value, place, f"a whole number of {bounds.bits} bits")
        return _if(float(whole) == whole, whole, place, A_FLOAT)
    if variable.kind != "Real":
        raise UsageError(f"{place}: is a {variable.kind}, which cannot be set")
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and _is_float(value)
    return float(_if(is_number, value, place, "a number"))


def number_of(variable: Variable, value: object) -> float:
    """A value of the variable, or its start value as the description has it, as the number that is recorded.

    Raises `UsageError` for a start value that is none.
    """
    if isinstance(value, str):
        value = {"true": 1, "false": 0, **variable.choices}.get(value, value)
    try:
        return float(value)  # type: ignore[arg-type]
    except ValueError:
        raise UsageError(
            f"{variable.name} = {shown(value)}: expected a start value that is a {variable.type}"
        ) from None


def start_value(variable: Variable) -> Value | bytes:
    """The start value of a variable in its type; zero, false or an empty text if it has none.

    Raises `UsageError` for a start value that is none of its type.
    """
    if variable.kind == "String":
        return variable.start or ""
    if variable.kind == "Binary":
        return bytes.fromhex(variable.start or "")
    number = start_number(variable)
    return number if variable.kind == "Real" else bool(number) if variable.kind == "Boolean" else int(number)


def start_number(variable: Variable) -> float:
    """As `start_value`, of a number or a Boolean, as the number that is recorded."""
    number = number_of(variable, variable.start) if variable.start else 0.0
    return float(np.float32(number)) if variable.type == "Float32" else number


def within(variable: Variable, value: float) -> float:
    """The value that the variable may take, by its bounds and its type, nearest to `value`."""
    low = -math.inf if variable.minimum is None else variable.minimum
    high = math.inf if variable.maximum is None else variable.maximum
    if variable.type in INTEGERS:
        of = np.iinfo(INTEGERS[variable.type])
        low, high = max(low, of.min), min(high, of.max)
    return min(max(value, low), high)


def same(variable: Variable, value: Value, read: Value) -> bool:
    """Whether the value that is read is the one that was set, up to the precision of the type."""
    if isinstance(value, str) or isinstance(read, str):
        return value == read
    return math.isclose(value, read, rel_tol=_ROUNDING.get(variable.type, 1e-12))


def _chosen(choices: Mapping[str, int], value: object, place: str) -> int:
    if isinstance(value, int) and not isinstance(value, bool) and value in choices.values():
        return value
    if not isinstance(value, str) or value not in choices:
        raise UsageError(f"{place} = {shown(value)}: {expected_name(str(value), list(choices))}")
    return choices[value]


def _is_float(value: float) -> bool:
    return isinstance(value, float) or abs(value) < 2**64


def _of_kind(value: object, kind: type, place: str, expected: str) -> Value:
    return _if(isinstance(value, kind), value, place, expected)


def _if(condition: bool, value: object, place: str, expected: str) -> Value:
    if not condition:
        raise UsageError(f"{place} = {shown(value)}: expected {expected}")
    return value  # type: ignore[return-value]


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

    def set_clock(self, period: float, offset: float, *, late: bool) -> None:
        """Have its clocks tick at its samples, before initialisation: the first every `period` from `offset` on [s].

        `late`: its first step leads to its first sample. Raises `UsageError` if other clocks do not fit.
        """
        raise UsageError(f"{self.name}: has no clock")

    def follow(self, inputs: Sequence[str], times: Floats, values: Floats) -> None:
        """Have inputs follow lines within its steps, before initialisation, by model exchange.

        The lines lead through the rows of `values` (n, m), a column for each input, at `times` (n,) of the run [s].
        """
        raise UsageError(f"{self.name}: holds its inputs in a step")

    def beside(self, instance_name: str, access: Access) -> "Instance":
        """Another partition of the same instance of an FMU; raises `QuadcosimError` where there can be none."""
        raise QuadcosimError(
            f"{self.path}: expected to be in the process of the run, where the partitions of {instance_name} share an "
            "instance"
        )

    @property
    def has_events(self) -> bool:
        """Whether events within its FMU are noted."""
        return self.model.interface in ("event-mode", "model-exchange")

    def take_events(self) -> Floats:
        """The number of events within the FMU that were taken before, and the times of those since [s]."""
        return np.zeros(1)

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

    def __call__(self, path: Path, instance_name: str, access: Access = USUAL, /) -> AbstractContextManager[Instance]:
        """An instance in the state after instantiation, with all parameters at their defaults."""
