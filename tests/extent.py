"""How much is tried: of what is long, `make test` has a sample, the same each time, and `make test-all` the whole."""

import os
from collections import Counter, defaultdict
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


def each_choice(items: Sequence[pytest.Item]) -> list[pytest.Item]:
    """Of a test over several parameters each value of each, in `make test`; `make test-all` has all combinations.

    What is in one table is one parameter. Values go by turns: where one parameter is the way to make an FMU, each way
    comes with as many values of the other.
    """
    cases = defaultdict[object, list[pytest.Item]](list)
    for item in items:
        cases[item.parent, getattr(item, "originalname", item.name)].append(item)
    chosen = {item for same in cases.values() for item in (_covering(same) if len(same) > 1 and not WHOLE else same)}
    return [item for item in items if item in chosen]


def _covering(cases: list[pytest.Item]) -> set[pytest.Item]:
    """Cases that have all values together."""
    values = {case: _values(case) for case in cases}
    missing, uses, chosen = set[object]().union(*values.values()), Counter[object](), set[pytest.Item]()
    while missing:
        best = max(cases, key=lambda case: (len(missing & values[case]), -sum(uses[value] for value in values[case])))
        chosen.add(best)
        missing -= values[best]
        uses.update(values[best])
    return chosen


def _values(case: pytest.Item) -> set[object]:
    """What the case has of each parameter."""
    given = case.callspec.params  # type: ignore[attr-defined]
    listed = [mark.args[0] for mark in case.iter_markers("parametrize")]
    tables = [tuple(names.replace(",", " ").split() if isinstance(names, str) else names) for names in listed]
    alone = given.keys() - {name for table in tables for name in table}
    return {(table, *(id(given[name]) for name in table)) for table in [*tables, *((name,) for name in alone)]}
