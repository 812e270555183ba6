"""The declarations of a description: variables, and the entries of its model structure."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

NUMBERS = ("Real", "Integer", "Enumeration")
Start = float | int | bool | str | bytes


@dataclass(frozen=True, kw_only=True, slots=True)
class Variable:
    """A variable with its defaults filled in, numbers still as they are written; or an element of an array."""

    place: int
    """in the list, from 1"""
    handle: int
    """by which the model structure refers to it: its place in FMI 2.0, its value reference in FMI 3.0"""
    name: str
    further_names: tuple[str, ...] = ()
    """of aliases in FMI 3.0, which are no separate variables"""
    reference: int
    type: str
    kind: str
    """Real, Integer …: the corresponding type of FMI 2.0"""
    causality: str
    variability: str
    initial: str | None
    starts: tuple[str, ...]
    """None, or one, or one for each element of an array"""
    unit: str | None
    minimum: str | None
    maximum: str | None
    nominal: str | None
    items: tuple[int, ...]
    """values of an Enumeration"""
    derivative_of: int | None
    """handle of the state whose derivative it is"""
    others: Mapping[str, tuple[int, ...]]
    """further variables that it refers to by handles: its clocks, its previous value, its dimensions"""
    shape: tuple[int, ...] | None = None
    """of an array, by start values; None for a scalar, and for an element"""
    whole: str
    """name of the array that it is an element of; its own name if it is none"""
    element: int = 0
    """index in the array"""

    @property
    def start(self) -> str | None:
        """The start as it is written; None if there is none."""
        return " ".join(self.starts) if self.starts else None

    @property
    def start_value(self) -> Start:
        """The start in its type; zero, false or an empty text if there is none."""
        text = self.starts[0] if self.starts else ""
        if self.kind == "Real":
            return float(np.float32(text or 0.0)) if self.type == "Float32" else float(text or 0.0)
        if self.kind == "Boolean":
            return text in ("true", "1")
        if self.kind == "Binary":
            return bytes.fromhex(text)
        return text if self.kind == "String" else int(text or 0)

    @property
    def keeps_start(self) -> bool:
        """Whether it has its start value after initialisation unless set: the model cannot change it."""
        is_external = self.causality in ("input", "parameter", "structuralParameter") or self.variability == "constant"
        return is_external and bool(self.starts)

    @property
    def is_clocked(self) -> bool:
        """Whether it is a clock, or has a value only at ticks of one."""
        return self.kind == "Clock" or bool(self.others.get("clocks"))

    @property
    def elements(self) -> "tuple[Variable, ...]":
        """Itself, or the elements of an array in row-major order; each has one start at most."""
        if self.shape is None:
            return (self if len(self.starts) < 2 else replace(self, starts=self.starts[:1]),)
        indices = itertools.product(*(range(1, n + 1) for n in self.shape))
        starts = self.starts * (math.prod(self.shape) if len(self.starts) == 1 else 1)
        return tuple(
            replace(
                self,
                name=f"{self.name}[{','.join(map(str, index))}]",
                starts=starts[element : element + 1],
                shape=None,
                element=element,
            )
            for element, index in enumerate(indices)
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Unknown:
    """An entry of the model structure."""

    handle: int
    dependencies: tuple[int, ...] | None
    """handles; None: it may depend on everything"""
