"""Bounds of whole numbers: in C, unlike in Python, they have a limited size."""

from __future__ import annotations

from collections.abc import Callable

Span = tuple[int, int]
"""The smallest and the largest whole number that a value may have"""

BITS = 127
"""The bits of a whole number within an expression, without its sign."""


def size(span: Span) -> int:
    """The largest magnitude in a span."""
    return max(-span[0], span[1])


def span_of(op: str, *of: Span) -> Span:
    """The span of the result of an operation on whole numbers, from the spans of its operands."""
    return _SPANS[op](*of)


def _negative(a: Span) -> Span:
    return -a[1], -a[0]


def _product(a: Span, b: Span) -> Span:
    corners = [x * y for x in a for y in b]
    return min(corners), max(corners)


def _quotient(a: Span, b: Span) -> Span:
    if b[0] > 0:
        corners = [x // y for x in a for y in b]
        return min(corners), max(corners)
    return -size(a), size(a)


def _remainder(a: Span, b: Span) -> Span:
    """The span of a remainder, which has the sign of the divisor."""
    return min(b[0] + 1, 0), max(b[1] - 1, 0)


def _common_bits(a: Span, b: Span) -> Span:
    positive = [span[1] for span in (a, b) if span[0] >= 0]
    return (0, min(positive)) if positive else _of_bits(a, b)


def _of_bits(a: Span, b: Span) -> Span:
    most = 1 << max(size(a), size(b)).bit_length()
    return (0 if min(a[0], b[0]) >= 0 else -most), most - 1


_SPANS: dict[str, Callable[..., Span]] = {
    "add": lambda a, b: (a[0] + b[0], a[1] + b[1]),
    "sub": lambda a, b: (a[0] - b[1], a[1] - b[0]),
    "mul": _product,
    "neg": _negative,
    "abs": lambda a: (0, size(a)),
    "floordiv": _quotient,
    "mod": _remainder,
    "bit_and": _common_bits,
    "bit_or": _of_bits,
    "bit_xor": _of_bits,
}
