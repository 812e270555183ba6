"""Values that fit the annotations of records and tables as they are, or by the conversions of files.

All that fits here is accepted by Pydantic, with the same result; what does not fit is left to it, with the words of the
error. Loading it takes longer than a short run.
"""

import functools
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

_LARGEST = 2**53
"""Whole numbers up to this are exact as real numbers"""
_SCALARS = (bool, int, float, str)


class MisfitError(Exception):
    """A value is not known to fit."""


class MarkedFloat(float):
    """A number of which its class says more."""


@dataclass(frozen=True)
class Before:
    """In an annotation: a function that is applied to a value before it is checked."""

    function: Callable[[Any], Any]
    keeps_marks: bool = False
    """Whether a `MarkedFloat` fits as it is"""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic_core import core_schema

        return core_schema.no_info_before_validator_function(self.function, handler(source))


@functools.cache
def hints_of(cls: type) -> Mapping[str, Any]:
    """The annotations of a class, with their metadata."""
    return typing.get_type_hints(cls, include_extras=True)


def fitted(value: Any, hint: Any, *, from_file: bool) -> Any:
    """The value that a field with an annotation gets; raises `MisfitError`.

    `from_file`: of a TOML document, where texts stand for paths, and arrays for tuples; tables always are records.
    """
    kind = type(value)
    if kind is hint and kind in _SCALARS and (kind is not int or abs(value) <= _LARGEST):
        return value
    if hint is float and kind is int and abs(value) <= _LARGEST:
        return float(value)
    if hint is None or hint is types.NoneType:
        return _if(value is None, value)
    if hint is Any:
        return _plain(value) if from_file else value
    origin = typing.get_origin(hint)
    if origin is None:
        return _instance(value, hint, from_file)
    of_origin = _FORMS.get(origin)
    if of_origin is None:
        raise MisfitError
    return of_origin(value, typing.get_args(hint), from_file)


def _if(fits: bool, value: Any) -> Any:
    if not fits:
        raise MisfitError
    return value


def _plain(value: Any) -> Any:
    """A copy of plain data of a document."""
    kind = type(value)
    if kind is dict:
        return {_if(type(key) is str, key): _plain(one) for key, one in value.items()}
    if kind is list:
        return [_plain(one) for one in value]
    return _if(kind in _SCALARS, value)


def _instance(value: Any, hint: Any, from_file: bool) -> Any:
    if not isinstance(hint, type):
        raise MisfitError
    if type(value) is dict and hasattr(hint, "of_table"):
        return hint.of_table(value)
    if from_file and hint is Path:
        return Path(_if(type(value) is str, value))
    try:
        return _if(hint not in _SCALARS and not from_file and isinstance(value, hint), value)
    except TypeError:  # a protocol that is not checked at run time
        raise MisfitError from None


def _of_union(value: Any, kinds: tuple[Any, ...], from_file: bool) -> Any:
    """The value as the only kind that it fits; its own type, if it is among them and no text that may be a path."""
    if type(value) in kinds and not (from_file and Path in kinds):
        kinds = (type(value),)
    results = []
    for kind in kinds:
        try:
            results.append(fitted(value, kind, from_file=from_file))
        except MisfitError:
            continue
    return _if(len(results) == 1, results and results[0])


def _of_literal(value: Any, words: tuple[Any, ...], _from_file: bool) -> Any:
    return _if(type(value) is str and value in words, value)


def _of_annotated(value: Any, parts: tuple[Any, ...], from_file: bool) -> Any:
    kind, *metadata = parts
    for one in metadata:
        value = _if(isinstance(one, Before), one).function(value)
        if one.keeps_marks and isinstance(value, MarkedFloat):
            return value
    return fitted(value, kind, from_file=from_file)


def _of_tuple(value: Any, kinds: tuple[Any, ...], from_file: bool) -> Any:
    _if(type(value) is (list if from_file else tuple), value)
    if kinds[-1:] == (Ellipsis,):
        return tuple([fitted(one, kinds[0], from_file=from_file) for one in value])
    _if(len(value) == len(kinds), value)
    return tuple([fitted(one, kind, from_file=from_file) for one, kind in zip(value, kinds)])


def _of_list(value: Any, kinds: tuple[Any, ...], from_file: bool) -> Any:
    return [fitted(one, kinds[0], from_file=from_file) for one in _if(type(value) is list, value)]


def _of_mapping(value: Any, kinds: tuple[Any, ...], from_file: bool) -> Any:
    of_key, of_value = kinds
    return {
        fitted(key, of_key, from_file=from_file): fitted(one, of_value, from_file=from_file)
        for key, one in _if(type(value) is dict, value).items()
    }


_FORMS = {
    Annotated: _of_annotated, Mapping: _of_mapping, dict: _of_mapping, list: _of_list, tuple: _of_tuple,
    typing.Literal: _of_literal, typing.Union: _of_union, types.UnionType: _of_union,
}  # fmt: skip
