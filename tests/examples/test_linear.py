"""LQR, LQI and PID: gains and margins as they are designed, and flights that are the same however they are made."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.documents import read_toml
from orchestration.quadrotor.flight.hover import at_hover
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.systems.system.component import Parameter
from orchestration.theory.stability.period_map import growth_of_loop
from quadcosim import Scenario, Timing
from tests.extent import in_test_all
from tests.native import native
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.theory.stability.test_linearise import closed
from tests.places import EXAMPLES

pytestmark = needs_compiler
FOLDER = EXAMPLES / "linear"
LAWS = ("lqr", "lqi", "pid")


def gains_of(law: str) -> dict[str, list[float]]:
    """Those of its file, as the law names them."""
    found: dict[str, Any] = read_toml(FOLDER / f"{law}.toml", "gains")["controller"]
    return {name: [each[axis] for axis in "xyz"] for name, each in found.items()}


@pytest.fixture(scope="module")
def design() -> Any:
    pytest.importorskip("control")
    from examples.linear import design

    return design


def test_the_gains_are_those_of_the_design(design: Any) -> None:
    plant = design.loop_of().rest
    for law in LAWS:
        found = getattr(design, law)(plant)
        for name, expected in gains_of(law).items():
            assert found[name] == pytest.approx(expected, rel=1e-3, abs=1e-9), (law, name)


def test_the_law_with_these_gains_is_the_feedback_of_least_squares(design: Any) -> None:
    """Its derivatives, as its FMU has them, are the matrix that the Riccati equation gave."""
    import control

    loop = design.loop_of(gains_of("lqr"))
    feedback, _, _ = control.dlqr(loop.rest.A, loop.rest.B, *design._weights(loop.rest))
    assert pytest.approx(-feedback, rel=1e-4, abs=1e-4) == loop.component.D @ loop.rest.C


def test_by_as_much_as_its_phase_margin_lets_it_a_command_may_be_late(design: Any) -> None:
    """A delay of margin / crossover is the local limit, but for a hold that is moved by part of a sample."""
    margin, crossover = design.margins(design.loop_of(gains_of("lqi")), "torque.y")
    late = np.radians(margin) / crossover
    for factor, is_stable in ((0.98, True), (1.02, False)):
        loop = design.loop_of(gains_of("lqi"), delay=factor * late)
        assert bool(np.abs(np.linalg.eigvals(closed(loop))).max() < 1.0) is is_stable


@pytest.mark.parametrize("period", [0.05, 0.01, 0.002])
def test_what_is_slowest_decays_alike_however_fast_it_is_sampled(period: float) -> None:
    """Nearly: the states of the plant move by next to nothing within a short period, and are found all the same."""
    gains: dict[str, Parameter] = {
        f"{name}.{axis}": value for name, each in gains_of("lqr").items() for axis, value in zip("xyz", each)
    }
    scenario = native(
        controller=FmuChoice(fmu=str(FOLDER / "native" / "LinearFeedback.fmu"), parameters=gains),
        timing=Timing(period=period, plant_interval=min(period, 0.01)),
    )
    instances = Instances()
    try:
        assert growth_of_loop(at_hover(scenario), instances) == pytest.approx(-1.728, abs=5e-3)
    finally:
        instances.close()


COMPARISON = Path(__file__).with_name("test_linear.toml").read_text(encoding="utf-8")


@in_test_all
def test_an_lqi_against_the_law_of_the_paper_has_the_same_shares_through_compare_as_through_run(tmp_path: Path) -> None:
    path = tmp_path / "lqi.toml"
    path.write_text(COMPARISON.format(folder=FOLDER))
    comparison = quadcosim.load_comparison(path)
    cells = quadcosim.compare(comparison, out=tmp_path, figures=False, progress=None, announce=None).outcome.cells
    plant, law = "native/QuadrotorPlant", str(FOLDER / "native" / "LinearFeedback.fmu")
    laws = {
        "unified": Scenario().with_fmus(plant=plant, controller="native/UnifiedController"),
        "LQI": quadcosim.load_scenario(FOLDER / "lqi.toml").with_fmus(plant=plant, controller=law),
    }
    assert [cell.controller for cell in cells] == [*laws]
    for cell in cells:
        asked = laws[cell.controller].with_changes(
            stop_time=6.0, timing={"period": 0.05, "plant_interval": 0.005}, plant={"max_internal_step": 0.005}
        )
        flights = [
            asked.with_values(start.values).with_changes(seed=i)
            for i, start in enumerate(comparison.initial_conditions)
        ]
        results = [result.metrics for result in quadcosim.run(flights)]
        survive = [each["outcome"] != "diverged" for each in results]
        settle = [each["outcome"] == "settled" for each in results]
        assert 0 < sum(settle) < len(flights)
        assert (cell.survives.count, cell.settles.count) == (sum(survive), sum(settle))
