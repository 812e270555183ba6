"""The functions of scalars that the equations need beyond arithmetic, for any kind of scalar.

Laws and dynamics are written once, with `+ - * / **` and the functions of a `ScalarOps`. An FMU passes `FLOAT` (the
standard library); a batch of points passes numpy's functions, a derivation those of a computer algebra system. This
module imports neither.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

Scalar = Any  # a float, a numpy array of one value a point, or a symbol


@dataclass(frozen=True, kw_only=True, slots=True)
class ScalarOps:
    """Elementary functions of one kind of scalar; all act elementwise and preserve shape."""

    sqrt: Callable[[Scalar], Scalar]
    tanh: Callable[[Scalar], Scalar]
    sin: Callable[[Scalar], Scalar]
    cos: Callable[[Scalar], Scalar]
    atan2: Callable[[Scalar, Scalar], Scalar]
    sign: Callable[[Scalar], Scalar]
    maximum: Callable[[Scalar, Scalar], Scalar]
    where: Callable[[Any, Scalar, Scalar], Scalar]
    all: Callable[[Any], Any]
    """Whether a condition holds, as one truth value; for a batch, at every point."""
    resolution: float = 2.0**-53
    """The rounding error of a number about 1."""


FLOAT = ScalarOps(
    sqrt=math.sqrt,
    tanh=math.tanh,
    sin=math.sin,
    cos=math.cos,
    atan2=math.atan2,
    sign=lambda x: math.copysign(1.0, x) if x else 0.0,
    maximum=max,
    where=lambda condition, a, b: a if condition else b,
    all=bool,
)
"""Functions of Python floats, from the standard library."""


_State = TypeVar("_State")


def repeat(count: int, body: Callable[[int, _State], _State], state: _State) -> _State:
    """`state = body(i, state)` for i = 0 … count - 1: a loop that remains a loop in C, where `count` may be computed.

    `body` must get the state only as its argument, and return one of the same structure.
    """
    for i in range(count):
        state = body(i, state)
    return state
