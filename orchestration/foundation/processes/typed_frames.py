"""Typed frames: what a process that runs foreign code may send is data, of types that are known beforehand.

Plain data, arrays of numbers, and objects of the classes in `PASSABLE`, in MessagePack. Nothing in a frame is
executed: a dataclass is made of its fields, which must fit its annotations, an exception of its text and its plain
attributes.
"""

import contextlib
import dataclasses
import functools
import math
import types
import typing
from collections.abc import Callable, Collection, Mapping, Sequence, Set
from fractions import Fraction
from pathlib import Path
from typing import Any

import msgpack
import numpy as np

from orchestration.foundation.processes.passable import PASSABLE, full_name

MOST_ITEMS = 2**20
"""Items of one list or table"""
DEEPEST = 32
"""Objects within each other"""
_MOST_DIMENSIONS = 8
_NUMBERS = "biufc"
"""Kinds of the dtypes of arrays"""
_TUPLE, _INTEGER, _ARRAY, _RECORD, _ERROR, _PATH, _SET, _FRACTION, _COMPLEX, _FLOAT = range(10)
"""Codes of what MessagePack does not have"""
_Plain = str | bool | int | float | None


class FrameError(Exception):
    """Bytes are no frame, or their content is not what is expected."""


def pack(content: object) -> bytes:
    """`content` in bytes; raises `TypeError` for what is no data."""
    try:
        data: bytes = msgpack.packb(
            content, default=_extended, strict_types=True, unicode_errors="surrogatepass", buf_size=4096
        )
    except (OverflowError, ValueError, RecursionError) as error:
        raise TypeError(str(error)) from None
    return data


def unpack(data: bytes | memoryview, depth: int = 0) -> Any:
    """The content of bytes that are not trusted; raises `FrameError`."""
    if depth > DEEPEST:
        raise FrameError("it is nested too deeply")
    try:
        return msgpack.unpackb(
            data, strict_map_key=False, max_array_len=MOST_ITEMS, max_map_len=MOST_ITEMS,
            unicode_errors="surrogatepass", ext_hook=lambda code, of: _READERS[code](of, depth + 1),
        )  # fmt: skip
    except FrameError:
        raise
    except Exception as error:  # MessagePack's, and those of the constructors
        raise FrameError(str(error)) from error


def expect(content: Any, kind: Any) -> Any:
    """`content`, if it fits an annotation; raises `FrameError`."""
    if not _fits(content, kind):
        raise FrameError(f"expected {kind}")
    return content


def call(handlers: object, message: Any, names: Collection[str]) -> str:
    """Call the method of `handlers` that a message names, one of `names`, with its arguments, which must fit.

    Returns the name; raises `FrameError`.
    """
    name, *arguments = expect(message, tuple[Any, ...]) or (None,)
    if not isinstance(name, str) or name not in names:
        raise FrameError("expected one of the messages that there are")
    method = getattr(handlers, name)
    kinds = _argument_kinds(method.__func__)
    if len(arguments) != len(kinds) or not all(map(_fits, arguments, kinds)):
        raise FrameError(f"{name}: expected its arguments")
    method(*arguments)
    return name


def result_kind(function: Callable[..., Any]) -> Any:
    """What a function returns, by its annotation."""
    return _hints(function).get("return", Any)


# -- to bytes ------------------------------------------------------------------------------------------------------


def _extended(value: Any) -> Any:
    """What MessagePack has no type for, as it is packed."""
    if isinstance(value, tuple):
        return _ext(_TUPLE, list(value))
    if isinstance(value, np.ndarray | np.generic):
        return _packed_array(value)
    if full_name(type(value)) in PASSABLE and dataclasses.is_dataclass(value):
        fields = [getattr(value, field.name) for field in dataclasses.fields(value)]
        return _ext(_RECORD, [full_name(type(value)), fields])
    if isinstance(value, float) and full_name(type(value)) in PASSABLE:
        return _ext(_FLOAT, [full_name(type(value)), float(value)])
    if isinstance(value, BaseException):
        return _packed_error(value)
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, int):
        return _ext(_INTEGER, str(value))
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Path):
        return _ext(_PATH, str(value))
    if isinstance(value, Set):
        return _ext(_SET, sorted(value))
    if isinstance(value, Fraction):
        return _ext(_FRACTION, [value.numerator, value.denominator])
    if isinstance(value, complex):
        return _ext(_COMPLEX, [value.real, value.imag])
    raise TypeError(f"{type(value).__name__} is no data that a process may send")


def _ext(code: int, content: object) -> msgpack.ExtType:
    return msgpack.ExtType(code, pack(content))


def _packed_array(value: Any) -> msgpack.ExtType:
    if value.dtype.kind not in _NUMBERS:
        raise TypeError(f"an array of {value.dtype} is no data that a process may send")
    shape = None if isinstance(value, np.generic) else list(value.shape)
    return _ext(_ARRAY, [value.dtype.str, shape, value.tobytes()])


def _packed_error(error: BaseException) -> msgpack.ExtType:
    """The error; one of a class that is not in the table as a `RuntimeError` with its name and text."""
    names = [full_name(cls) for cls in type(error).__mro__ if full_name(cls) in PASSABLE]
    text = str(error.args[0]) if names and error.args else f"{type(error).__name__}: {error}"
    plain = {name: value for name, value in vars(error).items() if isinstance(value, _Plain)}
    return _ext(_ERROR, [names, text, plain if names else {}])


# -- from bytes ----------------------------------------------------------------------------------------------------


def _array(data: bytes, depth: int) -> Any:
    dtype, shape, content = unpack(data, depth)
    expect(shape, list[int] | None)
    kind = np.dtype(expect(dtype, str))
    if kind.kind not in _NUMBERS or kind.names is not None or kind.subdtype is not None:
        raise FrameError("expected an array of numbers")
    if shape is not None and (len(shape) > _MOST_DIMENSIONS or min(shape, default=0) < 0):
        raise FrameError("expected the shape of an array")
    if math.prod(shape or ()) * kind.itemsize != len(content):
        raise FrameError("expected as many bytes as the array has")
    values = np.frombuffer(bytearray(content), dtype=kind)
    return values[0] if shape is None else values.reshape(shape)


def _record(data: bytes, depth: int) -> Any:
    name, values = unpack(data, depth)
    cls: Any = PASSABLE.get(expect(name, str))
    if not hasattr(cls, "__dataclass_fields__"):
        raise FrameError("expected a record that there is")
    fields: Any = dataclasses.fields(cls)
    made, hints = object.__new__(cls), _hints(cls)
    for field, value in zip(fields, values, strict=True):
        object.__setattr__(made, field.name, expect(value, hints.get(field.name, Any)))
    return made


def _float(data: bytes, depth: int) -> float:
    name, value = unpack(data, depth)
    cls: Any = PASSABLE.get(expect(name, str), object)
    if not issubclass(cls, float):
        raise FrameError("expected a class of floats that there is")
    made: float = cls(expect(value, float))
    return made


def _error(data: bytes, depth: int) -> BaseException:
    names, text, attributes = unpack(data, depth)
    expect(attributes, dict[str, _Plain])
    known = next((PASSABLE[name] for name in expect(names, list[str]) if name in PASSABLE), RuntimeError)
    if not issubclass(known, BaseException):
        raise FrameError("expected an error")
    made: BaseException = known.__new__(known)
    made.args = (expect(text, str),)
    vars(made).update(attributes)
    return made


_READERS: Mapping[int, Callable[[bytes, int], Any]] = {
    _TUPLE: lambda data, depth: tuple(expect(unpack(data, depth), list[Any])),
    _INTEGER: lambda data, depth: int(expect(unpack(data, depth), str)),
    _ARRAY: _array,
    _RECORD: _record,
    _ERROR: _error,
    _PATH: lambda data, depth: Path(expect(unpack(data, depth), str)),
    _SET: lambda data, depth: frozenset(expect(unpack(data, depth), list[Any])),
    _FRACTION: lambda data, depth: Fraction(*expect(unpack(data, depth), list[int])),
    _COMPLEX: lambda data, depth: complex(*expect(unpack(data, depth), list[float])),
    _FLOAT: _float,
}
_SCALARS: Mapping[Any, Any] = {
    float: (int, float, np.integer, np.floating), int: (int, np.integer), bool: (bool, np.bool_),
}  # fmt: skip
"""Types of the values of an annotation: NumPy's are not always those of Python"""


# -- whether it fits -----------------------------------------------------------------------------------------------


@functools.cache
def _hints(annotated: Any) -> Mapping[str, Any]:
    """Annotations of a class or function; none where they name what is imported for type checkers only."""
    with contextlib.suppress(NameError):
        return typing.get_type_hints(annotated)
    return {}


@functools.cache
def _argument_kinds(method: Any) -> tuple[Any, ...]:
    hints = _hints(method)
    count = method.__code__.co_argcount
    return tuple(hints.get(name, Any) for name in method.__code__.co_varnames[1:count])


def _fits(value: Any, kind: Any) -> bool:
    """Whether a value fits an annotation, as far as this is one of data; others fit everything."""
    if kind is Any or kind is object or type(value) is kind:
        return True
    if kind is None:
        return value is None
    if kind in _SCALARS:
        return isinstance(value, _SCALARS[kind])
    if typing.is_typeddict(kind):
        hints = _hints(kind)
        return isinstance(value, dict) and all(_fits(item, hints.get(name, Any)) for name, item in value.items())
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is None:
        return not isinstance(kind, type) or getattr(kind, "_is_protocol", False) or isinstance(value, kind)
    if origin in (typing.Union, types.UnionType):
        return any(_fits(value, one) for one in arguments)
    if origin is typing.Annotated:
        return _fits(value, arguments[0])
    if origin is typing.Literal:
        return isinstance(value, _Plain) and value in arguments
    if not isinstance(origin, type) or getattr(origin, "_is_protocol", False):
        return True
    if not isinstance(value, origin) or isinstance(value, str):
        return False
    return _items_fit(value, origin, arguments)


@functools.cache
def _plain_types(kind: Any) -> Set[type]:
    """Types of plain data of which each value fits an annotation."""
    alternatives = typing.get_args(kind) if typing.get_origin(kind) in (typing.Union, types.UnionType) else (kind,)
    found = {one for one in (str, bool, int, float) if one in alternatives}
    return found | ({type(None)} if {None, type(None)} & {*alternatives} else set())


def _items_fit(value: Any, origin: type, arguments: tuple[Any, ...]) -> bool:
    if issubclass(origin, tuple) and arguments[-1:] != (Ellipsis,):
        return len(value) == len(arguments) and all(map(_fits, value, arguments))
    if issubclass(origin, Mapping):
        return all(_fits(name, arguments[0]) and _fits(item, arguments[1]) for name, item in value.items())
    if issubclass(origin, Sequence | Set):
        kind = arguments[0]
        return kind is Any or {*map(type, value)} <= _plain_types(kind) or all(_fits(item, kind) for item in value)
    return True  # an array, whose numbers are of any type
