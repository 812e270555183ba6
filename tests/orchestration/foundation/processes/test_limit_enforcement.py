"""Which time counts against a limit that a process starts with, and against a later allowance."""

import subprocess
import threading
from types import SimpleNamespace
from typing import cast

import pytest

from orchestration.foundation.processes.family import Family, Member
from orchestration.foundation.processes.limit_enforcement import Watch
from orchestration.foundation.processes.resource_limits import UNLIMITED, Limits
from tests.patience import PATIENCE

CHECKS = 4


class Busy:
    """A family whose threads use an hour of processor time between two checks."""

    def __init__(self) -> None:
        self.checks = 0
        self.seen, self.killed = threading.Event(), threading.Event()

    def members(self) -> dict[int, Member]:
        self.checks += 1
        if self.checks > CHECKS:
            self.seen.set()
        return {1: Member(limited=False, processor=3600.0 * self.checks, waits={}, memory=0)}

    def kill(self, first: object) -> None:
        self.killed.set()


@pytest.fixture
def busy(monkeypatch: pytest.MonkeyPatch) -> Busy:
    monkeypatch.setattr("os.cpu_count", lambda: 1_000_000)
    return Busy()


def watch(busy: Busy, limits: Limits) -> Watch:
    process = cast("subprocess.Popen[bytes]", SimpleNamespace(poll=lambda: None, send_signal=lambda number: None))
    return Watch(process, cast(Family, busy), limits, None)


def test_a_limit_is_of_elapsed_time_however_many_threads_compute(busy: Busy) -> None:
    one = watch(busy, Limits(time=600.0))
    assert busy.seen.wait(PATIENCE)
    one.close()
    assert one.reached is None


def test_a_later_allowance_is_of_processor_time_of_all_threads(busy: Busy) -> None:
    one = watch(busy, UNLIMITED)
    one.allow(600.0)
    assert busy.killed.wait(PATIENCE)
    one.close()
    assert one.reached == "it takes more than the time limit of 600 s"
