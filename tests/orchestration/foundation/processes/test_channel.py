"""Errors are made picklable for messages between processes."""

import copyreg
import threading

import pytest

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.processes.channel import picklable


class _NeedsTwoError(Exception):
    """An error that can be pickled but not unpickled."""

    def __init__(self, what: str, where: str) -> None:
        super().__init__(f"{what} in {where}")


def test_an_error_that_cannot_be_pickled_is_replaced_by_its_name_and_text(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(copyreg.dispatch_table, _NeedsTwoError, raising=False)  # by dask, once it is loaded
    known = SimulatorError("plant: refused", details="where")
    assert picklable(known) is known
    assert str(picklable(OSError(threading.Lock()))).startswith("OSError: <unlocked _thread.lock")
    assert repr(picklable(_NeedsTwoError("a leak", "the tank"))) == "RuntimeError('_NeedsTwoError: a leak in the tank')"
