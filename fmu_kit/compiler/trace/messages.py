"""Statements with messages: errors and warnings of a slave."""

from __future__ import annotations

from fmu_kit.compiler.trace.statements import Statement, statement
from fmu_kit.compiler.trace.symbols import Symbol
from fmu_kit.compiler.trace.texts import Piece, pieces
from fmu_kit.errors import DivergenceError, FmuError

_CLASSES: dict[str, type[Exception]] = {
    each.__name__: each for each in (FmuError, DivergenceError, ZeroDivisionError, OverflowError, ValueError)
}


def error_class(name: str) -> type[Exception]:
    """The error class of a name."""
    return _CLASSES[name]


def raise_statement(error: Exception) -> Statement:
    """The statement that raises an error of the FMU."""
    name = next(name for name, each in reversed(_CLASSES.items()) if isinstance(error, each))
    if type(error).__name__ in _CLASSES:
        name = type(error).__name__
    message = pieces(str(error))
    return statement("raise", _values(message), (name, _words(message)))


def warn_statement(key: str, text: str) -> Statement:
    """The statement that logs a warning, the first time only."""
    message = pieces(text)
    return statement("warn", _values(message), (key, _words(message)))


def _values(text: list[Piece]) -> list[Symbol]:
    return [piece[0] for piece in text if not isinstance(piece, str)]


def _words(text: list[Piece]) -> tuple[str | tuple[str], ...]:
    """The text without its values: a format in place of each."""
    return tuple(piece if isinstance(piece, str) else (piece[1],) for piece in text)
