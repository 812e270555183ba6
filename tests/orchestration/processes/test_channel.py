"""What processes say to each other can be said."""

import copyreg
import threading

import pytest

from orchestration.basics.errors import SimulatorError
from orchestration.processes.channel import sayable


class _NeedsTwoError(Exception):
    """An error that pickles, but cannot be made again of its arguments."""

    def __init__(self, what: str, where: str) -> None:
        super().__init__(f"{what} in {where}")


def test_an_error_that_no_frame_can_have_is_said_by_its_name_and_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(copyreg.dispatch_table, _NeedsTwoError, raising=False)  # by dask, once it is loaded
    known = SimulatorError("plant: refused", details="where")
    assert sayable(known) is known
    assert str(sayable(OSError(threading.Lock()))).startswith("OSError: <unlocked _thread.lock")
    assert repr(sayable(_NeedsTwoError("a leak", "the tank"))) == "RuntimeError('_NeedsTwoError: a leak in the tank')"
