"""Constructors that are as strict as files: what a file refuses for its names and types, a dataclass refuses too."""

import contextlib
import dataclasses
import functools
import os
import reprlib
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence, Set
from pathlib import Path
from typing import Any, TypeVar

from orchestration.basics.errors import UsageError, no_such_key, shown

Class = TypeVar("Class", bound=type)
Check = Callable[[str, Any], Any]
"""Of a value at a place: what the field keeps of it; raises `UsageError`"""

SCALAR = float | bool | str
"""What a parameter of an FMU can be"""


def strict(place: str = "") -> Callable[[Class], Class]:
    """A dataclass whose constructor raises `UsageError`, in one line, for names and types that a file would not have.

    Fields that are missing, that there are not, or of another type are named after their `place`. A list is taken for
    a tuple, text for a path and a path for text, and a number of NumPy's for one of Python's. Its `repr` says what is
    not as by default.
    """

    def decorated(cls: Class) -> Class:
        plain = vars(cls)["__init__"]
        fields = dataclasses.fields(cls)
        names = [field.name for field in fields]
        needed = [field.name for field in fields if _is_needed(field)]

        @functools.wraps(plain)
        def checked(self: Any, *unnamed: Any, **given: Any) -> None:
            if unnamed:
                raise _unlike(cls.__name__, unnamed[0], f"values by name, as in {names[0]}=…")
            for name in given:
                if name not in names:
                    raise UsageError(no_such_key(place, name, names))
            for name in needed:
                if name not in given:
                    raise UsageError(f"{place}{name}: expected a value")
            checks = _checks(cls)
            try:
                kept = {name: checks[name](place + name, value) for name, value in given.items()}
            except UsageError:
                with contextlib.suppress(TypeError, AttributeError):
                    plain(self, **given)  # which may say better what it expects: a probability, not just a number
                raise
            plain(self, **kept)

        cls.__init__ = checked  # type: ignore[misc]
        if cls.__dataclass_params__.repr:  # type: ignore[attr-defined]
            cls.__repr__ = _short  # type: ignore[assignment]
        return cls

    return decorated


def called(words: str) -> Callable[[Class], Class]:
    """What an error says is expected where a value of a class, mostly a protocol, is not given."""

    def decorated(cls: Class) -> Class:
        _WORDS[cls] = words
        return cls

    return decorated


def _short(self: Any) -> str:
    """The class with the fields that differ from their defaults, long ones cut."""
    given = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
    defaults = {field.name: _default(field) for field in dataclasses.fields(self)}
    said = [f"{name}={_SHORTENED.repr(value)}" for name, value in given.items() if value != defaults[name]]
    return f"{type(self).__name__}({', '.join(said)})"


_SHORTENED = reprlib.Repr()
_SHORTENED.maxtuple, _SHORTENED.maxdict, _SHORTENED.maxstring, _SHORTENED.maxother = 6, 6, 80, 400


def _default(field: dataclasses.Field[Any]) -> Any:
    return field.default_factory() if field.default_factory is not dataclasses.MISSING else field.default


def _is_needed(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


@functools.cache
def _checks(cls: type) -> dict[str, Check]:
    """Of each field of a dataclass, made when the first of its values is."""
    hints = typing.get_type_hints(cls)
    return {field.name: _check_of(hints[field.name]) for field in dataclasses.fields(cls)}


def _check_of(hint: Any) -> Check:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in (SCALAR, SCALAR | int):
        return _kind((bool, int, float, str), "a number, true, false or a text")
    if origin in (typing.Union, types.UnionType):
        return _either(arguments)
    if origin is tuple:
        return _many(arguments)
    if isinstance(origin, type) and issubclass(origin, Mapping) and arguments[0] is str:
        return _table(_check_of(arguments[1]), _plain(arguments[1]))
    if hint is float:
        return _kind((int, float), "a valid number")
    if hint is Path:
        return _path
    if isinstance(hint, type) and hint is not Any:
        return _kind((hint,), _WORDS.get(hint, f"a value made by {hint.__name__}(…)"))
    return lambda place, value: value  # one of some words: that is checked with what the field means


_WORDS: dict[type, str] = {int: "a valid integer", str: "a valid string", bool: "a valid boolean"}


def _kind(kinds: tuple[type, ...], expected: str) -> Check:
    """A value of one of these types; true and false are no numbers."""

    def check(place: str, value: Any) -> Any:
        if type(value) in kinds:
            if type(value) is int and not -(2**63) <= value < 2**63:
                raise UsageError(f"{place}: expected a whole number of at most 64 bits")
            return value
        if getattr(value, "shape", None) == () and hasattr(value, "item"):
            return check(place, value.item())
        if isinstance(value, kinds) and not isinstance(value, bool):
            return value
        if str in kinds and isinstance(value, os.PathLike):
            return os.fspath(value)
        raise _unlike(place, value, expected)

    return check


def _either(hints: Sequence[Any]) -> Check:
    """What the first check that passes keeps; if none does, what the first has to say."""
    may_be_none = types.NoneType in hints
    first, *others = [_check_of(each) for each in hints if each is not types.NoneType]

    def check(place: str, value: Any) -> Any:
        if value is None and may_be_none:
            return None
        for each in others:
            with contextlib.suppress(UsageError):
                return each(place, value)
        return first(place, value)

    return check


def _many(arguments: tuple[Any, ...]) -> Check:
    """A tuple of values of one kind; of a stated number of them, if it is stated."""
    each, plain = _check_of(arguments[0]), _plain(arguments[0])
    count = None if arguments[-1] is ... else len(arguments)

    def check(place: str, value: Any) -> Any:
        if not isinstance(value, Collection) or isinstance(value, (str, bytes, Mapping, Set)):
            raise _unlike(place, value, "a valid array")
        if count is not None and len(value) != count:
            raise _unlike(place, value, f"{count} values")
        if type(value) is tuple and _are(value, plain):
            return value
        return tuple([_part(each, place, i, one) for i, one in enumerate(value)])

    return check


def _table(each: Check, plain: Set[type]) -> Check:
    def check(place: str, value: Any) -> Any:
        if not isinstance(value, Mapping):
            raise _unlike(place, value, "an object")
        if _are(value, {str}) and _are(value.values(), plain):
            return dict(value)
        for name in value:
            if not isinstance(name, str):
                raise _unlike(place, name, "names that are text")
        return {name: _part(each, place, name, one) for name, one in value.items()}

    return check


def _plain(hint: Any) -> Set[type]:
    """The types whose values need no second look: where there are thousands, there are studies of as many runs."""
    found = {hint, *typing.get_args(hint)}
    return {each for each in found if isinstance(each, type) and each is not int}


def _are(values: Iterable[Any], kinds: Set[type]) -> bool:
    return set(map(type, values)) <= kinds


def _part(check: Check, place: str, name: str | int, value: Any) -> Any:
    """Its place is made up only where it is to be told: there are many parts, and few are wrong."""
    try:
        return check("", value)
    except UsageError:
        return check(f"{place}.{name}", value)


def _path(place: str, value: Any) -> Path:
    if not isinstance(value, (str, os.PathLike)):
        raise _unlike(place, value, "a path")
    return Path(value)


def _unlike(place: str, value: Any, expected: str) -> UsageError:
    return UsageError(f"{place} = {shown(value if isinstance(value, float) else repr(value))}: expected {expected}")
