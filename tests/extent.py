"""How much is tried: of what is long, `make test` has a sample, the same each time, and `make test-all` the whole."""

import os
from collections.abc import Sequence
from typing import TypeVar

import pytest

WHOLE = "TEST_ALL" in os.environ
"""Whether this is `make test-all`"""

in_test_all = pytest.mark.skipif(not WHOLE, reason="in make test-all")
"""Of a test that has a shorter one beside it, which fails for the same faults but for rare ones"""

T = TypeVar("T")


def sample(cases: Sequence[T], size: int) -> Sequence[T]:
    """So many of the cases in `make test`, evenly spaced, the first among them."""
    return cases if WHOLE or len(cases) <= size else [cases[len(cases) * k // size] for k in range(size)]


def tries(whole: int, *, sampled: int) -> int:
    """How many random cases are tried."""
    return whole if WHOLE else sampled
