"""Scalars that laws and motions are evaluated in besides floats."""

import mpmath

from fmu_kit.scalar import ScalarOps

PRECISE = ScalarOps(
    sqrt=mpmath.sqrt,
    tanh=mpmath.tanh,
    sin=mpmath.sin,
    cos=mpmath.cos,
    atan2=mpmath.atan2,
    sign=mpmath.sign,
    maximum=max,
    where=lambda condition, a, b: a if condition else b,
    all=bool,
)
"""Of as many digits as mpmath is told."""
