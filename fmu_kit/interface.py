"""The variables of a slave, declared as attributes of its class, which its methods read and set.

    class Feedback(Slave):
        x = Input("measured state", "1")
        u = Output("command", "1/s")
        gain = Parameter("gain of the feedback", "1/s", 1.0)

        def step(self, t, h):
            self.u = -self.gain * self.x

The type of the start value is the type of the attribute: a float, a `Vec3` (an FMI variable for each of .x, .y, .z), a
`Quaternion` (.x, .y, .z, .w), an `Inertia` (.xx, .yy, .zz, .xy, .xz, .yz), a `NamedTuple` of floats (one for each of
its fields), a bool, a member of an `IntEnum`, which is read as its number, or an int if `unit` is None. A member of an
`IntEnum` makes an Enumeration NAME, and an Integer NAME_index with the numbers of its items, for tools that cannot set
an Enumeration. Units are in SI, as in `fmu_kit.units`. Variables that several slaves share are declared in a common
base class.
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
"""Functions that read and set an attribute of a slave."""


@dataclass(frozen=True, kw_only=True)
class _Kind:
    """A type of attribute; `get` makes its reading function from the index of its first variable."""

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


def _inertia(index: int) -> Callable[[Any], Inertia]:
    def get(slave: Any) -> Inertia:
        """The matrix of six entries; raises `FmuError` unless it is positive definite."""
        entries = dict(zip(_INERTIA_AXES, slave._reals[index : index + 6]))
        name = slave.variables[index].name.removesuffix(_INERTIA_AXES[0]) + f"{{{','.join(_INERTIA_AXES)}}}"
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
    """The kind of a start value; raises `TypeError` for one that no variable can have."""
    for kind in _KINDS:
        if isinstance(start, kind.type):
            return kind
    if isinstance(start, tuple) and hasattr(start, "_fields"):
        return _named(type(start), start._fields)
    expected = "a number, a truth value, a member of an IntEnum, a Vec3, a Quaternion, an Inertia or a NamedTuple"
    if isinstance(start, (list, tuple)):
        expected += f"; in place of a list a class Row(NamedTuple) with {len(start)} fields of type float"
    raise TypeError(f"start = {start!r}: expected {expected}")


def _named(record: type[Any], fields: tuple[str, ...]) -> _Kind:
    def at(index: int) -> _Get:
        end = index + len(fields)
        return lambda slave: record(*slave._reals[index:end])

    return _Kind(type=record, get=at, axes=fields, expected=f"a {record.__name__}")


_NO_NUMBER = (Vec3, Quaternion, Inertia, str, tuple, list, dict, type(None))


class Declaration(property):
    """A variable declared as an attribute; each causality has a subclass, below.

    The value references depend on the class that has it: each class of slaves has its own copy, made by `at`.
    """

    causality: ClassVar[Causality]
    default_variability: ClassVar[Variability]
    """The variability if none is given."""
    set_by_slave: ClassVar[bool] = True
    """Whether the slave sets it, rather than the master."""

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
        """`name`: of the FMI variable, if it is not the attribute's; arguments up to `frame` are those of `Variable`.

        `frame`: the function of `fmu_kit.frames` that converts it to other axes, in a `Framed` slave.

        Raises `ValueError` for an unknown unit, `TypeError` for one that is no text and for a start value that no
        variable can have.
        """
        super().__init__()
        if unit is not None and not isinstance(unit, str):
            raise TypeError(
                f'unit = {unit!r}: expected a text, as in {type(self).__name__}({description!r}, "1", {unit!r})'
            )
        self.description = description
        self.start: Any = float(start) if type(start) is int and unit else start
        self._kind = _kind_of(self.start)
        self.unit = unit if self._kind.is_real else None
        if self.unit is not None:
            base_unit_exponents(self.unit)
        self.name, self._variability = name or "", variability or self.default_variability
        bounds = {"minimum": minimum, "maximum": maximum, "above": above}
        self._details: dict[str, Any] = {
            **bounds,
            "nominal": nominal,
            "named_quantity": quantity,
            "terminal": terminal,
        }
        self.frame = frame

    def __set_name__(self, owner: type, attribute: str) -> None:
        self.attribute, self.name = attribute, self.name or attribute

    @property
    def first(self) -> str:
        """The name of its first FMI variable."""
        return ".".join((self.name, *self._kind.axes[:1]))

    def at(self, index: int) -> "Declaration":
        """A copy for slaves that have its first variable at `index`."""
        placed = type(self).__new__(type(self))
        vars(placed).update(vars(self))
        get, put = self._in_declared_frame(self._kind.get(index), self._put_at(index))

        def put_before_run(slave: Any, value: Any) -> None:
            if not slave.is_fresh:
                what = "an input" if self.causality == "input" else "a parameter"
                raise AttributeError(f"self.{self.attribute} cannot be set: it is {what}, which the master sets")
            put(slave, value)

        property.__init__(placed, get, put if self.set_by_slave else put_before_run)
        return placed

    def _in_declared_frame(self, get: _Get, put: _Put) -> tuple[_Get, _Put]:
        """The two functions, converting between the axes of the FMU and those of the attributes."""
        turn = self.frame
        if turn is None:
            return get, put

        def get_turned(slave: Any) -> Any:
            value, turned = get(slave), slave.is_turned
            return value if turned is False else turn(turned, value)

        def put_turned(slave: Any, value: Any) -> None:
            turned = slave.is_turned
            put(slave, value if turned is False else turn(turned, value))

        return get_turned, put_turned

    def _put_at(self, index: int) -> _Put:
        kind, end = self._kind, index + len(self._kind.axes)

        def put_vec3(slave: Any, value: Any) -> None:
            if not isinstance(value, Vec3):
                self._refuse(value)
            slave._reals[index:end] = (value.x, value.y, value.z)  # the most frequent case: faster than its iterator

        def put_parts(slave: Any, value: Any) -> None:
            if not isinstance(value, kind.type):
                self._refuse(value)
            slave._reals[index:end] = value

        def put_real(slave: Any, value: Any) -> None:
            if type(value) is not float and isinstance(value, _NO_NUMBER):
                self._refuse(value)
            slave._reals[index] = value

        def put_other(slave: Any, value: Any) -> None:
            if isinstance(value, _NO_NUMBER):
                self._refuse(value)
            slave._others[index] = value

        if kind.type is Vec3:
            return put_vec3
        return put_parts if kind.axes else put_real if kind.is_real else put_other

    def index(self) -> list[Variable]:
        """The Integer by which tools may also set an Enumeration; empty for other types."""
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
        """Its FMI variables."""
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
            **self._details,
        )
        if not axes:
            return [variable]
        return [replace(variable, name=f"{name}.{axis}", start=value) for axis, value in zip(axes, self.start)]


class Input(Declaration):
    """An input of the FMU; it has its start value until something is connected."""

    causality, default_variability, set_by_slave = "input", "continuous", False


class Parameter(Declaration):
    """A parameter, set before a run and, unless its variability is fixed, between steps."""

    causality, set_by_slave = "parameter", False
    default_variability: ClassVar[Variability] = "tunable"


class FixedParameter(Parameter):
    """A parameter that is set before a run and constant during it."""

    default_variability = "fixed"


class Output(Declaration):
    """An output, held from one step to the next; it has its start value until it is set."""

    causality, default_variability = "output", "discrete"


class Local(Declaration):
    """An internal value that is kept from one step to the next and can be read from outside."""

    causality, default_variability = "local", "discrete"


class State(Declaration):
    """A Real output that evolves from `start`, which is a parameter of the FMU: `initial.NAME`."""

    causality, default_variability = "output", "continuous"

    def initial(self) -> list[Variable]:
        """The parameters with its initial value."""
        return self._as(f"initial.{self.name}", f"{self.name}(0)", "parameter", "fixed")


def declarations_in(slave: type) -> list[Declaration]:
    """The declarations of a class and its bases, in order; one that is overridden keeps its first position."""
    found: dict[str, Declaration] = {}
    for cls in reversed(slave.__mro__):
        found |= {name: value for name, value in vars(cls).items() if isinstance(value, Declaration)}
    return list(found.values())


def variables_of(declared: Iterable[Declaration]) -> tuple[Variable, ...]:
    """Their FMI variables: as declared, then the initial values of states; Reals first, and among these locals last.

    The Integers of Enumerations come after all others.
    """
    listed = list(declared)
    found = [variable for each in listed for variable in each.variables()]
    found += [variable for each in listed if isinstance(each, State) for variable in each.initial()]
    found = sorted(found, key=lambda each: 2 if each.type != "Real" else each.causality == "local")
    return (*found, *(index for each in listed for index in each.index()))


def initial_values(declared: Iterable[Declaration]) -> dict[str, str]:
    """The variables of states, each with the parameter of its initial value."""
    states = [each for each in declared if isinstance(each, State)]
    return {v.name: start.name for each in states for v, start in zip(each.variables(), each.initial())}


_Record = TypeVar("_Record")


def read_fields(slave: Any, record: Callable[..., _Record], prefix: str = "") -> _Record:
    """A dataclass whose fields are read from the attributes of a slave with the same names, after a prefix."""
    return record(**{each.name: getattr(slave, prefix + each.name) for each in fields(record)})  # type: ignore[arg-type]


def set_fields(slave: Any, values: NamedTuple) -> None:
    """Set the outputs and locals of a slave from the fields of a named tuple that have the same names."""
    for name in filter(slave._own.__contains__, values._fields):
        setattr(slave, name, getattr(values, name))
