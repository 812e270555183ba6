"""Other systems than the quadrotor in other people's masters: the examples, without what only this one can say."""

import json
from pathlib import Path
from typing import Any

import pytest

from orchestration.simulation.interop.catalogue import TOOLS, chosen
from orchestration.simulation.interop.compare import TOLERANCE, agreements
from orchestration.simulation.interop.tool_runs import ToolRuns
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from quadcosim import QuadcosimError, UsageError
from tests.commands import Main
from tests.examples.common import example
from tests.extent import sample
from tests.orchestration.experiments.studies.common import one_line
from tests.places import EXAMPLES

CARRIED: dict[str, dict[str, Any]] = {
    "double_integrator": {},
    "water_tank": {"connections.valve.delay": 0.0, "components.tank.step": 0.1},
    "dc_servo": {
        "components.servo.step": 0.006,
        "connections.command.delay": 0.0,
        "connections.command.delay_jitter": 0.0,
        "connections.command.loss": 0.0,
    },
    "minimum_variance": {
        "components.plant.step": 1.0,
        "sources.noise.noise": None,
        "sources.noise.period": None,
        "sources.noise.constant": 0.3,
    },
    "four_components": {
        "components.car.step": 0.01,
        "components.controller.sampling.period": 0.01,
        "components.engine.sampling.period": 0.01,
        "components.engine.sampling.offset": 0.0,
        "connections.wheel.noise": 0.0,
        "connections.wheel.quantisation": 0.0,
        "connections.speed.delay": 0.0,
        "connections.demand.delay": 0.0,
        "connections.demand.delay_jitter": 0.0,
        "connections.demand.loss": 0.0,
        "sources.slope.file": None,
        "sources.slope.constant": -100.0,
    },
}
"""By example, what takes away all that other masters cannot say: one step for all, nothing late, lost or noisy."""
ALL = "four_components"
"""Flown by every tool; of the others one of each order says what they add, their types and steps."""
COMMANDED = "double_integrator"
"""Flown by the command."""
ORDERS = {
    "libcosim": "jacobi",
    "libcosim, SSP": "jacobi",
    "ecos": "jacobi",
    "fmucontainer": "jacobi",
    "fmucontainer -sequential": "gauss-seidel",
}


STEPS = 40


def carried(name: str) -> System:
    system = changed(example(name), CARRIED[name])
    (step,) = {component.step for component in system.components.values() if component.step is not None}
    return changed(system, {"stop_time": STEPS * step})


@pytest.mark.parametrize("name", sample([name for name in CARRIED if name != COMMANDED], 1))
def test_an_example_equals_other_masters_in_the_order_that_each_has(name: str) -> None:
    system = carried(name)
    announced: list[str] = []
    orders = ORDERS if name == ALL else {tool: ORDERS[tool] for tool in ("libcosim", "fmucontainer -sequential")}
    found = agreements(system, chosen(list(orders), system.components), announce=announced.append)
    expected = {tool: order for tool, order in orders.items() if TOOLS[tool].converts or name != "water_tank"}
    assert {agreement.tool.name: agreement.trace.order for agreement in found} == expected
    assert any(line.startswith("left out libcosim") for line in announced) == (name == "water_tank")
    for agreement in found:
        assert max(agreement.same_first_inputs.values()) <= TOLERANCE, agreement.tool.name
        if agreement.tool.name.startswith("libcosim"):  # which exchanges what this master does from the start
            assert max(agreement.as_it_comes.values()) <= TOLERANCE


def test_the_rows_that_are_compared_are_those_of_a_run_of_the_system_in_that_order(tmp_path: Path) -> None:
    system = carried("double_integrator")
    runs = ToolRuns(system, tmp_path, None)
    for order in ("jacobi", "gauss-seidel"):
        orders = {f"connections.{x.name}.order": order for x in system.connections}
        signals = run(changed(system, orders)).signals
        compared = runs.rows_of_master(order, {})
        for i, name in enumerate(runs.loop.signals, start=1):
            assert compared[:, i].tobytes() == signals[name].tobytes()
    assert (runs.rows_of_master("jacobi", {}) != runs.rows_of_master("gauss-seidel", {})).any()


def test_no_tool_is_started_once_the_runs_have_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As by a thread that was still making its copies then."""
    runs = ToolRuns(carried("double_integrator"), tmp_path, None)
    with runs:
        pass
    monkeypatch.setattr(
        "orchestration.simulation.interop.tool_runs.Child", lambda *_, **__: pytest.fail("a process is started")
    )
    with pytest.raises(QuadcosimError, match=r"^the runs have ended$"):
        runs.run(TOOLS["fmpy, SSP"])


def test_the_command_takes_any_system_and_leaves_out_tools_for_components_that_it_has_not(
    main: Main, tmp_path: Path
) -> None:
    path = EXAMPLES / COMMANDED / "system.toml"
    tools = ("--tool", "libcosim", "--tool", "fmucontainer -sequential")
    done = main("interop", path, "--stop-time", "2", *tools, "--json", "--out", tmp_path)
    rows = json.loads(done.stdout)["tools"]
    assert [row["order"] for row in rows] == ["jacobi", "gauss-seidel"]
    for row in rows:
        assert row["agrees"]
        assert set(row["as_it_comes"]) == {"plant.x", "plant.v", "controller.u"}
        assert max(row["same_first_inputs"].values()) <= TOLERANCE
    assert max(rows[0]["as_it_comes"].values()) <= TOLERANCE
    assert (tmp_path / "interop.png").is_file()
    servo = carried("dc_servo").components
    assert not any(tool.alone == "plant" for tool in chosen(None, servo))
    assert any(tool.alone == "controller" for tool in chosen(None, servo))
    with pytest.raises(UsageError, match="tool fmpy, plant alone: expected a system with a component plant"):
        chosen(["fmpy, plant alone"], servo)


UPHILL = {key: value for key, value in CARRIED["four_components"].items() if not key.startswith("sources")}
SAMPLING = "components.controller.sampling"


@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        ("water_tank", {}, "connections.valve.delay = 0.25: an SSP cannot express that; expected 0.0"),
        (
            "water_tank",
            CARRIED["water_tank"],
            "tool = libcosim: connects a Real to a Real only, not controller.valve (Boolean to Real)",
        ),
        ("double_integrator", {f"{SAMPLING}.period": 0.1}, f"{SAMPLING}.period = 0.1: an SSP has one step for all"),
        ("double_integrator", {f"{SAMPLING}.jitter": 0.01}, f"{SAMPLING}.jitter = 0.01: an SSP cannot express that"),
        ("double_integrator", {"stop_time": 0.33}, "stop_time = 0.33: expected a multiple of the common step of 0.05"),
        ("double_integrator", {"connections.command.scale": 2.0}, "connections.command: has scale or offset"),
        ("four_components", UPHILL, "sources.slope.file: an SSP cannot feed one; expected a constant"),
    ],
)
def test_what_other_masters_cannot_express_is_refused_in_one_line(
    name: str, changes: dict[str, Any], expected: str
) -> None:
    with pytest.raises(UsageError) as refused:
        agreements(changed(example(name), changes), [TOOLS["libcosim"]])
    assert one_line(refused.value).startswith(expected)
