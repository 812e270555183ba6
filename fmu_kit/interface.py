"""The variables of a slave as attributes of its class: what is declared there, its methods read and set.

    class Feedback(Slave):
        x = Input("measured state", "1")
        u = Output("command", "1/s")
        gain = Parameter("of the feedback", "1/s", 1.0)

        def step(self, t, h):
            self.u = -self.gain * self.x

The type of the start value is the type of the attribute: a float, a `Vec3` (an FMI variable for each of .x, .y, .z), a
`Quaternion` (.x, .y, .z, .w), an `Inertia` (.xx, .yy, .zz, .xy, .xz, .yz), a `NamedTuple` of floats (one for each of
its fields), a bool, a member of an `IntEnum`, which is read as its number, or an int if `unit` is None. Beside an
Enumeration NAME, which such a member makes, there is an Integer NAME_index with the numbers of its items, for tools
that set no Enumeration. Units are in SI, as in `fmu_kit.units`. What several slaves have in common is declared in a
class that they inherit.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple, TypeVar

from fmu_kit.algebra import Inertia, Quaternion, Vec3, is_positive_definite
from fmu_kit.errors import require
from fmu_kit.units import base_unit_exponents
from fmu_kit.variables import INDEX, Causality, Variability, Variable

_Get = Callable[[Any], Any]
_Put = Callable[[Any, Any], None]
"""How an attribute of a slave is read, and set."""


@dataclass(frozen=True, kw_only=True)
class _Kind:
    """What an attribute can hold, and how it is read from the place of its first variable on."""

    type: type
    get: Callable[[int], _Get]
    is_real: bool = True
    axes: tuple[str, ...] = ()
    expected: str = "a number"


def _vec3(x: int) -> Callable[[Any], Vec3]:
    y, z = x + 1, x + 2

    def get(slave: Any) -> Vec3:
        reals = slave._reals
        return Vec3(reals[x], reals[y], reals[z])

    return get


def _quaternion(x: int) -> Callable[[Any], Quaternion]:
    y, z, w = x + 1, x + 2, x + 3

    def get(slave: Any) -> Quaternion:
        reals = slave._reals
        return Quaternion(Vec3(reals[x], reals[y], reals[z]), reals[w])

    return get


def _inertia(place: int) -> Callable[[Any], Inertia]:
    def get(slave: Any) -> Inertia:
        """The matrix of six entries; raises `FmuError` unless it is positive definite."""
        entries = dict(zip(_INERTIA_AXES, slave._reals[place : place + 6]))
        name = slave.variables[place].name.removesuffix(_INERTIA_AXES[0]) + f"{{{','.join(_INERTIA_AXES)}}}"
        listed = ", ".join(f"{axis} {value:g}" for axis, value in entries.items())
        require(is_positive_definite(**entries), name, listed, "a positive definite matrix")
        return Inertia(**entries)

    return get


_QUATERNION_AXES = ("x", "y", "z", "w")
_INERTIA_AXES = ("xx", "yy", "zz", "xy", "xz", "yz")
_KINDS = (  # a bool is an int too, and an item of an IntEnum
    _Kind(type=bool, get=lambda i: lambda slave: bool(slave._others[i]), is_real=False),
    _Kind(type=int, get=lambda i: lambda slave: int(slave._others[i]), is_real=False),
    _Kind(type=float, get=lambda i: lambda slave: slave._reals[i]),
    _Kind(type=Vec3, get=_vec3, axes=("x", "y", "z"), expected="a Vec3"),
    _Kind(type=Quaternion, get=_quaternion, axes=_QUATERNION_AXES, expected="a Quaternion"),
    _Kind(type=Inertia, get=_inertia, axes=_INERTIA_AXES, expected="an Inertia"),
)


def _kind_of(start: Any) -> _Kind:
    """What holds a start; raises `TypeError` for one that no variable can have."""
    for kind in _KINDS:
        if isinstance(start, kind.type):
            return kind
    if isinstance(start, tuple) and hasattr(start, "_fields"):
        return _named(type(start), start._fields)
    expected = "a number, a truth value, a member of an IntEnum, a Vec3, a Quaternion, an Inertia or a NamedTuple"
    raise TypeError(f"start = {start!r}: expected {expected}")


def _named(record: type[Any], fields: tuple[str, ...]) -> _Kind:
    def at(place: int) -> _Get:
        end = place + len(fields)
        return lambda slave: record(*slave._reals[place:end])

    return _Kind(type=record, get=at, axes=fields, expected=f"a {record.__name__}")


_NO_NUMBER = (Vec3, Quaternion, Inertia, str, tuple, list, dict, type(None))


class Declared(property):
    """A variable that is declared as an attribute; each causality is a class of its own, below.

    What it reads and sets depends on where its class has it: each class of slaves has its own, made by `at`.
    """

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
        nominal: float | None = None,
        quantity: str | None = None,
        terminal: str | None = None,
        frame: Callable[[Any, Any], Any] | None = None,
    ) -> None:
        """`name`: where that of the FMI variable is not the attribute's; what is between that and `frame`: `Variable`.

        `frame`: the function of `fmu_kit.frames` by which it is told in other axes, of a slave that is `Framed`.

        Raises `ValueError` for a unit that is none, `TypeError` for a start that no variable can have.
        """
        super().__init__()
        self.description = description
        self.start: Any = float(start) if type(start) is int and unit else start
        self._kind = _kind_of(self.start)
        self.unit = unit if self._kind.is_real else None
        if self.unit is not None:
            base_unit_exponents(self.unit)
        self.name, self._variability = name or "", variability or self.usually
        bounds = {"minimum": minimum, "maximum": maximum, "above": above}
        self._said: dict[str, Any] = {
            **bounds,
            "nominal": nominal,
            "named_quantity": quantity,
            "terminal": terminal,
        }
        self._frame = frame

    def __set_name__(self, owner: type, attribute: str) -> None:
        self.attribute, self.name = attribute, self.name or attribute

    @property
    def first(self) -> str:
        """The name of the first of its FMI variables."""
        return ".".join((self.name, *self._kind.axes[:1]))

    def at(self, place: int) -> "Declared":
        """The same, read and set in slaves that have its first variable at a place."""
        placed = type(self).__new__(type(self))
        vars(placed).update(vars(self))
        get, put = self._turning(self._kind.get(place), self._put_at(place))

        def give(slave: Any, value: Any) -> None:
            if not slave.is_fresh:
                what = "an input" if self.causality == "input" else "a parameter"
                raise AttributeError(f"self.{self.attribute} cannot be set: it is {what}, which is given to the FMU")
            put(slave, value)

        property.__init__(placed, get, put if self.own else give)
        return placed

    def _turning(self, get: _Get, put: _Put) -> tuple[_Get, _Put]:
        """The same for a slave that may be told in other axes than those of its attributes."""
        turn = self._frame
        if turn is None:
            return get, put

        def get_turned(slave: Any) -> Any:
            value, turned = get(slave), slave.is_turned
            return value if turned is False else turn(turned, value)

        def put_turned(slave: Any, value: Any) -> None:
            turned = slave.is_turned
            put(slave, value if turned is False else turn(turned, value))

        return get_turned, put_turned

    def _put_at(self, place: int) -> _Put:
        kind, end = self._kind, place + len(self._kind.axes)

        def put_vec3(slave: Any, value: Any) -> None:
            if not isinstance(value, Vec3):
                self._refuse(value)
            slave._reals[place:end] = (value.x, value.y, value.z)  # the most frequent of all: not by its iterator

        def put_parts(slave: Any, value: Any) -> None:
            if not isinstance(value, kind.type):
                self._refuse(value)
            slave._reals[place:end] = value

        def put_real(slave: Any, value: Any) -> None:
            if type(value) is not float and isinstance(value, _NO_NUMBER):
                self._refuse(value)
            slave._reals[place] = value

        def put_other(slave: Any, value: Any) -> None:
            if isinstance(value, _NO_NUMBER):
                self._refuse(value)
            slave._others[place] = value

        if kind.type is Vec3:
            return put_vec3
        return put_parts if kind.axes else put_real if kind.is_real else put_other

    def index(self) -> list[Variable]:
        """Of an Enumeration, the Integer by which tools may set it too; nothing for other types."""
        return [
            Variable(
                name=f"{each.name}{INDEX}",
                description=f"{each.name} by its number, for tools that set no Enumeration; 0: as {each.name} says",
                causality=each.causality,
                variability=each.variability,
                start=0,
                minimum=0,
                maximum=len(each.items),
            )
            for each in self.variables()
            if each.items
        ]

    def _refuse(self, value: Any) -> None:
        raise TypeError(f"self.{self.attribute} = {value}: expected {self._kind.expected}")

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
            **self._said,
        )
        if not axes:
            return [variable]
        return [replace(variable, name=f"{name}.{axis}", start=value) for axis, value in zip(axes, self.start)]


class Input(Declared):
    """What is connected to the FMU; `start` holds until something is."""

    causality, usually, own = "input", "continuous", False


class Parameter(Declared):
    """What is set before a run and, unless its variability is fixed, between steps."""

    causality, own = "parameter", False
    usually: ClassVar[Variability] = "tunable"


class FixedParameter(Parameter):
    """What is set before a run, and holds for all of it."""

    usually = "fixed"


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
    """Their FMI variables: as declared, then the starts of states; Reals first, among them locals last.

    After all of them come the Integers beside Enumerations.
    """
    listed = list(declared)
    found = [variable for each in listed for variable in each.variables()]
    found += [variable for each in listed if isinstance(each, State) for variable in each.initial()]
    found = sorted(found, key=lambda each: 2 if each.type != "Real" else each.causality == "local")
    return (*found, *(index for each in listed for index in each.index()))


def initial_values(declared: Iterable[Declared]) -> dict[str, str]:
    """The variables of states, and the parameters from which they start."""
    states = [each for each in declared if isinstance(each, State)]
    return {v.name: start.name for each in states for v, start in zip(each.variables(), each.initial())}


_Record = TypeVar("_Record")


def gathered(slave: Any, record: Callable[..., _Record], prefix: str = "") -> _Record:
    """A dataclass of the attributes of a slave that are called as its fields are, with a prefix."""
    return record(**{each.name: getattr(slave, prefix + each.name) for each in fields(record)})  # type: ignore[arg-type]


def show(slave: Any, values: NamedTuple) -> None:
    """Set the outputs and locals that are called as fields of a named tuple to what these hold."""
    for name in filter(slave._own.__contains__, values._fields):
        setattr(slave, name, getattr(values, name))
