"""The law as a task beside others: what its page and the finding say of it."""

import csv
import re

import pytest

import quadcosim
from benchmarks.execution import LAWS
from docs import processor
from quadcosim import System
from tests.native import NATIVE
from tests.orchestration.components.fmi.small import needs_compiler
from tests.places import EXAMPLES

FOLDER = EXAMPLES / "autopilot"
PAGE = (FOLDER / "README.md").read_text("utf-8")
FINDING = (processor.ROOT / "docs" / "findings" / "cascade.md").read_text("utf-8")

pytestmark = needs_compiler


@pytest.fixture(scope="module")
def system() -> System:
    return quadcosim.load_system(FOLDER / "flight.toml")


def stalled(system: System, seconds: float) -> System:
    return quadcosim.changed(system, {processor.STALLED: seconds})


def test_the_law_as_a_task_beside_others_flies_as_if_at_once(system: System) -> None:
    here = quadcosim.run(system, engine="compiled").metrics
    alone = NATIVE.with_changes(
        stop_time=20.0, timing={"plant_interval": 0.005}, parameters={"plant.max_internal_step": 0.005}
    )
    there = quadcosim.run(alone).metrics
    told = re.search(r"`position_rmse` ([\d.]+) m, `ultimate_bound` ([\d.]+) mm", PAGE)
    assert told is not None
    for metrics in (here, there):
        assert f"{metrics['position_rmse']:.3f}" == told[1]
        assert f"{1e3 * metrics['ultimate_bound']:.1f}" == told[2]


def test_the_card_may_hold_the_processor_as_long_as_the_page_says(system: System) -> None:
    assert quadcosim.run(stalled(system, 0.15), engine="compiled").metrics["good"]
    assert not quadcosim.run(stalled(system, 0.17), engine="compiled").metrics["good"]


def test_the_share_of_the_processor_is_that_of_the_page() -> None:
    for line in processor.share_table(processor.equal_share()):
        assert line in FINDING


@pytest.mark.parametrize("law", processor.LAWS)
def test_each_law_stands_the_stall_of_the_page_and_not_a_millisecond_more(law: str) -> None:
    told = re.search(rf"\| {re.escape(law)} \| (\d+) ms \|", FINDING)
    assert told is not None
    for more, good in ((0.0, True), (1.0, False)):
        file = processor.without_chance(*processor.LAWS[law])
        file["computers"]["autopilot"]["tasks"]["storage"]["execution"] = (float(told[1]) + more) / 1e3
        assert quadcosim.run(file, engine="compiled").metrics["good"] == good


@pytest.mark.parametrize(("processor", "clock"), [("m7", 216e6), ("m4f", 168e6)])
def test_traces_are_whole_instructions_of_every_law_at_a_cycle_each(processor: str, clock: float) -> None:
    with (FOLDER / "execution" / f"{processor}.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 1000
    assert [*rows[0]] == [*LAWS]
    for row in rows:
        for seconds in map(float, row.values()):
            assert abs(seconds * clock - round(seconds * clock)) < 0.2
