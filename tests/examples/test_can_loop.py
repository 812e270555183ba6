"""A servo over a CAN bus: when what arrives, and how much of the bus others may use."""

import pytest

from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.file import load_system
from orchestration.systems.system.paths import changed
from tests.places import EXAMPLES

SYSTEM = load_system(EXAMPLES / "three_servos" / "can.toml")
OTHERS = "networks.bus.messages.others.period"
FULL = 0.27 / 0.91 * 1e-3
"""[s] from one frame of the others to the next, where the bus is full"""


def test_on_an_idle_bus_a_command_comes_two_frames_and_a_job_after_its_angle() -> None:
    alone = changed(SYSTEM, {OTHERS: 10.0, "networks.bus.messages.others.offset": 9.0, "stop_time": 0.1})
    arrived = {name: [e.time for e in run(alone).events if (e.kind, e.what) == ("arrived", name)]
               for name in ("angle", "command")}  # fmt: skip
    assert arrived["angle"] == [k * 6_000_000 + 270_000 for k in range(17)]
    assert arrived["command"] == [k * 6_000_000 + 1_040_000 for k in range(17)]


@pytest.mark.parametrize(("share", "good"), [(0.99, True), (1.01, False)])
def test_the_loop_is_lost_where_the_bus_is_full(share: float, good: bool) -> None:
    assert run(changed(SYSTEM, {OTHERS: FULL / share, "stop_time": 4.0})).metrics["good"] == good
