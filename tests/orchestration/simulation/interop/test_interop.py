"""What `quadcosim interop` finds of each tool: the facts that the documentation states."""

import math
from dataclasses import dataclass
from typing import Any

import pytest

from orchestration.simulation.interop import compare
from orchestration.simulation.interop.catalogue import TOOLS, chosen
from orchestration.simulation.interop.compare import TOLERANCE, Agreement, agreements, agrees
from quadcosim import QuadcosimError, Scenario, UsageError
from tests.extent import sample
from tests.native import NATIVE
from tests.orchestration.experiments.studies.common import one_line
from tests.orchestration.simulation.interop.common import LOOP, components_of, farthest
from tests.places import ROOT


@dataclass(frozen=True, kw_only=True)
class Fact:
    """What is stated of a tool."""

    order: str = "jacobi"
    controller: str = "exchanged"
    plant: str = "exchanged"
    """what the first step finds at the inputs"""
    missing: int = 0
    """steps that it ends short of the stop time"""
    drifts: bool = False
    """whether it adds up its time"""


FACTS = {
    "libcosim": Fact(),
    "libcosim, SSP": Fact(),
    "ecos": Fact(missing=1, drifts=True),
    "ecos, SSP": Fact(missing=1, drifts=True),
    "fmpy, SSP": Fact(controller="zeros", plant="zeros", drifts=True),
    "fmucontainer": Fact(plant="start values"),
    "fmucontainer -sequential": Fact(order="gauss-seidel"),
    "cofmupy": Fact(controller="zeros", plant="zeros", drifts=True),
    # The controller's answer to zeros is hover, which is what the plant starts with.
    "cofmupy gauss_seidel": Fact(order="gauss-seidel", controller="zeros", plant="start values", drifts=True),
    "fmpy, plant alone": Fact(order="alone"),
    "fmpy, controller alone": Fact(order="alone"),
}


STEPS = [pytest.param((0.01, 18.0), id="10 ms"), pytest.param((0.001, 5.0), id="1 ms")]


@pytest.fixture(scope="session", params=sample(STEPS, 1))
def compared(request: pytest.FixtureRequest) -> tuple[Scenario, dict[str, Agreement]]:
    """The beginning of the paper's flight at two communication steps, and how each tool agrees.

    Just as long that the rounding of added-up steps falls as it does over the page's 30 s. By native FMUs; those with
    Python inside fly in each tool where the SSP is tested.
    """
    step, stop = request.param
    scenario = NATIVE.with_changes(timing={"plant_interval": step}, stop_time=stop)
    shares: list[float] = []
    tools = chosen(None, LOOP.ports)
    found = agreements(scenario, tools, progress=shares.append)
    assert shares == [(i + 1) / (2 * len(tools)) for i in range(2 * len(tools))]  # each flies twice
    return scenario, {agreement.tool.name: agreement for agreement in found}


Compared = tuple[Scenario, dict[str, Agreement]]


@pytest.fixture(params=FACTS)
def one(request: pytest.FixtureRequest, compared: Compared) -> tuple[Scenario, Agreement, Fact]:
    """Each tool of the table."""
    if request.param not in compared[1]:
        pytest.skip(f"{request.param} needs an environment of its own: make interop makes it")
    return compared[0], compared[1][request.param], FACTS[request.param]


One = tuple[Scenario, Agreement, Fact]


def test_the_table_has_every_tool_in_order(compared: Compared) -> None:
    assert list(TOOLS) == list(FACTS)
    assert list(compared[1]) == [tool.name for tool in chosen(None, LOOP.ports)]


def test_the_page_has_the_table_that_was_found(compared: Compared) -> None:
    _, found = compared
    page = (ROOT / "docs" / "interop.md").read_text(encoding="utf-8")
    block = page.partition("<!-- masters -->")[2].partition("<!-- end -->")[0]
    columns = slice(1, 4)  # tool, order, first inputs: neither roundings, steps nor the length of the flight move them

    def rows(text: str) -> list[list[str]]:
        lines = [line.split("|") for line in text.strip().splitlines()]
        return [[cell.strip() for cell in line[columns]] for line in (lines[0], *lines[2:])]

    there = rows(block)
    assert [row[0] for row in there[1:]] == list(TOOLS)
    assert [row for row in there if row[0] in {"tool", *found}] == rows(compare.text(list(found.values())))


def test_the_order_of_each_tool_is_as_stated(one: One) -> None:
    _, agreement, fact = one
    assert agreement.trace.order == fact.order


def test_the_inputs_of_the_first_step_are_as_stated(one: One) -> None:
    _, agreement, fact = one
    stated = {"controller": fact.controller, "plant": fact.plant}
    assert agreement.trace.first_exchange == {name: stated[name] for name in components_of(agreement.tool)}


def test_the_steps_and_the_end_of_each_tool_are_as_stated(one: One) -> None:
    scenario, agreement, fact = one
    step = scenario.timing.plant_interval
    assert agreement.trace.steps == round(scenario.stop_time / step) - fact.missing
    assert agreement.trace.end == pytest.approx(scenario.stop_time - fact.missing * step, abs=1e-10)


def test_who_adds_up_its_time_drifts_and_nobody_else(one: One) -> None:
    scenario, agreement, fact = one
    rounding = math.ulp(scenario.stop_time)
    assert (agreement.trace.drift > 10.0 * rounding) == fact.drifts
    assert agreement.trace.drift < 1e-10
    if agreement.tool.packages == ("libcosimpy",):
        assert agreement.trace.drift == 0.0, "it counts nanoseconds"


def test_with_the_same_start_every_tool_flies_what_this_project_s_master_flies(one: One) -> None:
    _, agreement, _ = one
    assert farthest(agreement, agreement.same_first_inputs) <= TOLERANCE
    assert agrees(agreement)


def test_as_it_comes_a_tool_is_as_near_if_it_exchanges_the_initial_outputs_and_far_if_not(one: One) -> None:
    _, agreement, fact = one
    difference = farthest(agreement, agreement.as_it_comes)
    if (fact.controller, fact.plant) == ("exchanged", "exchanged"):
        assert difference <= TOLERANCE
    else:
        assert difference > 0.1


def test_the_versions_of_what_flew_are_told(one: One) -> None:
    _, agreement, _ = one
    assert agreement.versions.keys() == set(agreement.tool.packages)
    assert all(version[0].isdigit() for version in agreement.versions.values())


# -- what is not compared ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"timing": {"period": 0.015}}, "timing.period = 0.015: expected a multiple of the common step of 0.01 s"),
        ({"timing": {"offset": 0.005}}, "timing.offset = 0.005: expected a multiple of the common step of 0.01 s"),
        ({"stop_time": 0.995}, "stop_time = 0.995: expected a multiple of the common step of 0.01 s"),
        (
            {"timing": {"plant_interval": 1e-3 / 3.0}},
            f"timing.plant_interval = {1e-3 / 3.0}: expected a whole number of nanoseconds",
        ),
        ({"timing": {"jitter": 0.001}}, "timing.jitter = 0.001: an SSP cannot express that; expected"),
    ],
)
def test_times_that_other_masters_do_not_step_on_are_refused(
    changes: dict[str, Any], expected: str, short: Scenario
) -> None:
    with pytest.raises(UsageError) as refused:
        agreements(short.with_changes(**changes), chosen(["libcosim"], LOOP.ports))
    assert one_line(refused.value).startswith(expected)


def test_a_flight_that_diverges_is_not_compared(short: Scenario) -> None:
    away = short.with_changes(parameters={"plant.initial.position.x": 200.0})
    with pytest.raises(QuadcosimError) as refused:
        agreements(away, chosen(["libcosim"], LOOP.ports))
    assert "norm(plant.position - reference.position) = 200" in one_line(refused.value)
    assert str(refused.value).endswith("nothing to compare")
