"""What `make test` leaves out: combinations of parameters, and of each parameter no value."""

import itertools
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from tests import extent

PHASES, MAKINGS = ("new", "stepping", "ended", "failed"), ("python", "native")
ROWS = ((1, "one"), (1, "uno"), (2, "two"))


class Case:
    """A case of a test, as pytest collects it."""

    def __init__(self, test: str, table: str, **values: Any) -> None:
        self.parent, self.originalname, self.name = "file", test, str(values)
        self.marks, self.callspec = [SimpleNamespace(args=(table,))], SimpleNamespace(params=values)

    def iter_markers(self, name: str) -> Sequence[SimpleNamespace]:
        return self.marks


def chosen(items: list[Any]) -> list[tuple[Any, ...]]:
    kept: Sequence[Any] = extent.each_choice(items)
    return [tuple(item.callspec.params.values()) for item in kept]


def test_each_value_is_there_and_comes_by_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = [*itertools.product(MAKINGS, PHASES)]
    items = [Case("test_flies", "phase", making=making, phase=phase) for making, phase in pairs]
    monkeypatch.setattr(extent, "WHOLE", False)
    assert chosen(items) == [("python", "new"), ("python", "ended"), ("native", "stepping"), ("native", "failed")]
    monkeypatch.setattr(extent, "WHOLE", True)
    assert chosen(items) == pairs


def test_all_rows_of_a_table_are_there_and_each_test_is_looked_at_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extent, "WHOLE", False)
    table = [Case("test_reads", "n, word", n=n, word=word) for n, word in ROWS]
    other = [Case("test_writes", "phase", phase=phase) for phase in PHASES]
    assert chosen([*table, *other]) == [*ROWS, *((phase,) for phase in PHASES)]
