"""Transfers of values between an array and an FMU: the calls that they consist of, and the conversion of values."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.components.fmi.instance import number_of
from orchestration.components.fmi.read_description import Model, Variable
from orchestration.foundation.basics.errors import A_FLOAT, SimulatorError
from orchestration.foundation.basics.simulator import Floats

Numbers = npt.NDArray[Any]


@dataclass(frozen=True, kw_only=True)
class TransferPart:
    """Variables that one call transfers: all scalars of a type, or one array."""

    type: str
    references: tuple[int, ...]
    buffer: Numbers
    """the values that are transferred, in the order of the references"""
    array_places: npt.NDArray[np.int64]
    """indices of these variables in the array of the transfer"""
    places: npt.NDArray[np.int64]
    """indices of the same variables in the buffer"""


@dataclass(frozen=True, kw_only=True)
class TransferCall:
    """One call of a transfer, for a loop that makes it without Python."""

    function: str
    part: TransferPart
    in_place: bool
    """whether the buffer is the array of the transfer"""


class TransferLayout:
    """How transfers of the variables of one instance are divided into calls."""

    def __init__(self, name: str, model: Model, stored: Mapping[str, type[np.generic]]) -> None:
        """`stored` has the type of the values in memory, by the type of the variable."""
        self._name, self._model, self._stored = name, model, stored

    def parts(
        self, names: Sequence[str], array: Floats, shared: dict[int, Numbers] | None = None
    ) -> list[TransferPart]:
        """The calls that transfer `names`; without a buffer where the array itself has the right layout.

        FMI arrays are kept in `shared`, initially with their start values, because a call sets all elements.
        """
        if array.shape != (len(names),):
            raise ValueError(f"expected an array of {len(names)} values, got shape {array.shape}")
        groups: dict[tuple[str, int | None], list[tuple[int, Variable]]] = {}
        for i, name in enumerate(names):
            variable = self._variable(name)
            group = variable.reference if variable.length else None
            groups.setdefault((variable.type, group), []).append((i, variable))
        return [self._part(array, group, reference, shared) for (_, reference), group in groups.items()]

    def converter(self, names: Sequence[str], dtype: np.dtype[Any]) -> Callable[[Floats], Numbers]:
        """The conversion of values of variables of one type to their type in memory."""
        if dtype == np.float64:
            return lambda values: values
        if dtype.kind == "b" or self._variable(names[0]).kind == "Boolean":
            return lambda values: values != 0.0
        low, high = range_of(dtype)

        def held(values: Floats) -> Numbers:
            rounded = np.rint(values) if dtype.kind in "iu" else values
            outside = ~((rounded >= low) & (rounded <= high))
            if outside.any():
                at = int(np.argmax(outside))
                raise SimulatorError(f"{self._name}.{names[at]} = {values[at]:g}: expected a number that {dtype} holds")
            return rounded

        return held

    def expect_floats(self, names: Sequence[str], values: Numbers) -> None:
        """Raise `SimulatorError` for a whole number that no float is."""
        if values.dtype in (np.int64, np.uint64):
            for name, number in zip(names, values.tolist()):
                if float(number) != number:
                    without = "it runs where this is neither recorded nor connected"
                    raise SimulatorError(f"{self._name}.{name} = {number}: expected {A_FLOAT}; {without}")

    def _part(
        self, array: Floats, group: list[tuple[int, Variable]], reference: int | None, shared: dict[int, Numbers] | None
    ) -> TransferPart:
        first = group[0][1]
        array_places = np.array([i for i, _ in group])
        if reference is None:
            references, places = tuple(v.reference for _, v in group), np.arange(len(group))
        else:
            references, places = (reference,), np.array([v.element for _, v in group])
        length = first.length or len(group)
        if (
            self._stored[first.type] is np.float64
            and np.array_equal(places, np.arange(len(array)))
            and length == len(array)
        ):
            buffer: Numbers = array
        elif reference is None or shared is None:
            buffer = np.zeros(length, dtype=self._stored[first.type])
        else:
            buffer = shared.setdefault(reference, self.start_values(first.whole))
        return TransferPart(
            type=first.type, references=references, buffer=buffer, array_places=array_places, places=places
        )

    def start_values(self, whole: str) -> Numbers:
        """Those of a variable, of an array all, with all digits; zero where none is declared."""
        elements = [variable for variable in self._model.variables.values() if variable.whole == whole]
        values = np.zeros(len(elements), dtype=self._stored[elements[0].type])
        for v in elements:
            text = v.start or "0"
            digits = v.kind == "Integer" and text.lstrip("-").isdigit()
            values[v.element] = int(text) if digits else number_of(v, text)
        return values

    def _variable(self, name: str) -> Variable:
        return self._model.variable(name, f"{self._name}.{name}")


def range_of(dtype: np.dtype[Any]) -> tuple[float, float]:
    """The smallest and the largest float that a type of numbers holds: the largest integer of 64 bits is no float."""
    if dtype.kind == "f":
        return float(np.finfo(dtype).min), float(np.finfo(dtype).max)
    of = np.iinfo(dtype)
    high = float(of.max)
    return float(of.min), high if int(high) <= of.max else math.nextafter(high, 0.0)
