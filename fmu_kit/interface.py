"""The variables of a slave as attributes of its class: what is declared there, its methods read and set.

    class Feedback(Slave):
        x = Input("measured state", "1")
        u = Output("command", "1/s")
        gain = Parameter("of the feedback", "1/s", 1.0)

        def step(self, t, h):
            self.u = -self.gain * self.x

The type of the start value is the type of the attribute: a float, a `Vec3` (an FMI variable for each of .x, .y, .z), a
`Quaternion` (.x, .y, .z, .w), a bool, a member of an `IntEnum`, or an int if `unit` is None. Units are in SI, as in
`fmu_kit.units`.
"""

import enum
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.units import base_unit_exponents
from fmu_kit.values import Values
from fmu_kit.variables import QUATERNION_AXES, Causality, Variability, Variable, vector


@dataclass(frozen=True, kw_only=True)
class _Kind:
    """What an attribute can hold, and the methods of a slave that know it."""

    type: type
    get: Callable[[Any, str], Any]
    put: Callable[[Any, str, Any], None]
    has_unit: bool = False
    axes: tuple[str, ...] = ()
    expected: str = "a number"


_KINDS = (  # a bool is an int too, and an item of an IntEnum
    _Kind(type=bool, get=Values.boolean, put=Values.put_boolean),
    _Kind(type=enum.IntEnum, get=Values.enumeration, put=Values.put_count),
    _Kind(type=int, get=Values.count, put=Values.put_count),
    _Kind(type=float, get=Values.real, put=Values.put, has_unit=True),
    _Kind(type=Vec3, get=Values.vec3, put=Values.put_vec3, has_unit=True, axes=("x", "y", "z"), expected="a Vec3"),
    _Kind(
        type=Quaternion, get=Values.quaternion, put=Values.put_quaternion, has_unit=True, axes=QUATERNION_AXES,
        expected="a Quaternion",
    ),
)  # fmt: skip
_NO_NUMBER = (Vec3, Quaternion, str, tuple, list, dict, type(None))


class Declared:
    """A variable that is declared as an attribute; each causality is a class of its own, below."""

    causality: ClassVar[Causality]
    usually: ClassVar[Variability]
    """The variability, unless another is said."""
    own: ClassVar[bool] = True
    """Whether the slave sets it, and not whoever steps it."""

    def __init__(
        self,
        description: str = "",
        unit: str | None = "1",
        start: Any = 0.0,
        *,
        name: str | None = None,
        variability: Variability | None = None,
        minimum: float | None = None,
        maximum: float | None = None,
        above: float | None = None,
    ) -> None:
        """`name`: where that of the FMI variable is not the attribute's; bounds are of parameters, as in `Variable`.

        Raises `ValueError` for a unit that is none, `TypeError` for a start that no variable can have.
        """
        if not isinstance(start, float | int | Vec3 | Quaternion):
            raise TypeError(
                f"start = {start!r}: expected a number, a truth value, a member of an IntEnum, a Vec3 or a Quaternion"
            )
        self.description = description
        self.start: Any = float(start) if type(start) is int and unit else start
        self._kind = next(kind for kind in _KINDS if isinstance(self.start, kind.type))
        self.unit = unit if self._kind.has_unit else None
        if self.unit is not None:
            base_unit_exponents(self.unit)
        self.name, self._variability = name or "", variability or self.usually
        self._bounds = {"minimum": minimum, "maximum": maximum, "above": above}

    def __set_name__(self, owner: type, attribute: str) -> None:
        self.attribute, self.name = attribute, self.name or attribute

    def __get__(self, slave: Any, owner: type) -> Any:
        return self if slave is None else self._kind.get(slave, self.name)

    def __set__(self, slave: Any, value: Any) -> None:
        if not (self.own or slave.is_fresh):
            what = "an input" if self.causality == "input" else "a parameter"
            raise AttributeError(f"self.{self.attribute} cannot be set: it is {what}, which is given to the FMU")
        fits = isinstance(value, self._kind.type) if self._kind.axes else not isinstance(value, _NO_NUMBER)
        if not fits:
            raise TypeError(f"self.{self.attribute} = {value}: expected {self._kind.expected}")
        self._kind.put(slave, self.name, value)

    def variables(self) -> list[Variable]:
        """The FMI variables that it stands for."""
        return self._as(self.name, self.description, self.causality, self._variability)

    def _as(self, name: str, description: str, causality: Causality, variability: Variability) -> list[Variable]:
        axes = self._kind.axes
        variable = Variable(
            name=name,
            description=description,
            causality=causality,
            variability=variability,
            unit=self.unit,
            start=0.0 if axes else self.start,
            **self._bounds,
        )
        return vector(variable, axes, self.start) if axes else [variable]


class Input(Declared):
    """What is connected to the FMU; `start` holds until something is."""

    causality, usually, own = "input", "continuous", False


class Parameter(Declared):
    """What is set before a run and, unless its variability is fixed, between steps."""

    causality, usually, own = "parameter", "tunable", False


class Output(Declared):
    """What the FMU gives, held from one step to the next; `start` holds until it is set."""

    causality, usually = "output", "discrete"


class Local(Declared):
    """What the slave remembers from one step to the next, and shows; else as an output."""

    causality, usually = "local", "discrete"


class State(Declared):
    """An output, a Real, that evolves from `start`, which is a parameter of the FMU: `initial.NAME`."""

    causality, usually = "output", "continuous"

    def initial(self) -> list[Variable]:
        """The parameters from which it starts."""
        return self._as(f"initial.{self.name}", f"{self.name}(0)", "parameter", "fixed")


def declared_in(slave: type) -> list[Declared]:
    """What a class and those that it is made of declare, in order; what is declared again counts where it was first."""
    found: dict[str, Declared] = {}
    for cls in reversed(slave.__mro__):
        found |= {name: value for name, value in vars(cls).items() if isinstance(value, Declared)}
    return list(found.values())


def variables_of(declared: Iterable[Declared]) -> tuple[Variable, ...]:
    """Their FMI variables: as declared, then the starts of states; Reals before all others, as a slave has them."""
    listed = list(declared)
    found = [variable for each in listed for variable in each.variables()]
    found += [variable for each in listed if isinstance(each, State) for variable in each.initial()]
    return tuple(sorted(found, key=lambda variable: variable.type != "Real"))


def initial_values(declared: Iterable[Declared]) -> dict[str, str]:
    """The variables of states, and the parameters from which they start."""
    states = [each for each in declared if isinstance(each, State)]
    return {v.name: start.name for each in states for v, start in zip(each.variables(), each.initial())}
