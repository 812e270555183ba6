"""The ensembles of the findings are what the page says, cells of its tables too; conclusions are computed rightly."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import quadcosim
from docs import experiments
from docs.make_findings import flying_up_to, with_python_inside
from fmu_kit.trajectory import Trajectory
from orchestration.engines.batch.batches import Batches
from orchestration.quadrotor.scenario import Scenario
from orchestration.results.objectives import Metrics
from orchestration.runs.in_lanes import located
from orchestration.runs.simulation import run
from orchestration.workers.batching import Agreement

PAGES = "\n".join(
    page.read_text(encoding="utf-8") for page in sorted((Path(__file__).parents[2] / "docs" / "findings").glob("*.md"))
)
DECIMAL = re.compile(r"-?\d+\.?\d*")


def metrics_of(scenarios: list[Scenario]) -> list[Metrics]:
    """Of flights in lanes, those alone that lanes leave."""
    systems = [located(scenario.as_system()) for scenario in scenarios]
    found = zip(systems, Batches().run(systems))
    return [run(system).metrics if flown is None else flown.metrics for system, flown in found]


def flown(scenarios: list[Scenario]) -> list[str]:
    return [str(metrics["outcome"]) for metrics in metrics_of(scenarios)]


def rows(section: str) -> dict[str, list[str]]:
    """The first table of a section: cells of each row by its first one."""
    text = PAGES[PAGES.index(f"\n## {section}") :]
    (table, *_) = re.findall(r"(?:^\|.*\|\n)+", text, re.M)
    return {first: rest for first, *rest in (line.strip("| ").split(" | ") for line in table.splitlines()[2:])}


def test_flights_in_lanes_are_those_of_the_fmus_with_python_inside() -> None:
    chosen = [scenario.with_changes(stop_time=1.0) for scenario in experiments.some_flights(3)]
    lanes = metrics_of(chosen)
    alone = [quadcosim.run(with_python_inside(scenario)).metrics for scenario in chosen]
    found = Agreement.of((i, *pair) for i, pair in enumerate(zip(lanes, alone, strict=True)))
    assert found.runs == 3
    assert found.difference < 1e-9, str(found)


def test_limits_of_the_page_fly_and_what_lies_a_little_above_does_not() -> None:
    limits = {
        float(kappa.split()[0]): cells for kappa, cells in rows("What is local").items() if "none" not in cells[1]
    }
    assert len(limits) == 5
    ends = {kappa: float(DECIMAL.findall(cells[1])[0]) * 1e-3 for kappa, cells in limits.items()}
    assert flown([experiments.flight(kappa=k, period=T) for k, T in ends.items()]) == ["settled"] * 5
    above = [cells[2].split()[0].replace("diverges", "diverged") for cells in limits.values()]
    assert flown([experiments.flight(kappa=k, period=T + 0.00025) for k, T in ends.items()]) == above


def test_medians_of_the_page_are_those_of_its_starts() -> None:
    """Of one cell in twenty: the middle of thirty first ends."""
    (cell,) = (cells[0] for size, cells in rows("Other initial conditions").items() if size == "2 m")
    median = float(DECIMAL.findall(cell)[0]) * 1e-3
    near = [T for T in experiments.PERIODS if abs(T - median) <= 0.0026]
    flights = [experiments.flight(period=T, start=start) for start in experiments.random_starts()[1] for T in near]
    flew = np.reshape([outcome == "settled" for outcome in flown(flights)], (-1, len(near)))
    assert flew[:, near.index(pytest.approx(median))].mean() >= 0.5 > flew[:, -1].mean()


def test_the_gains_of_the_page_fly_up_to_what_it_says() -> None:
    table = rows("Gains and period")
    cells = [(factor, end) for factor, end in zip((0.5, 1.0, 2.0), (table["κ = 0"][i] for i in (2, 4, 6)), strict=True)]
    ends = [(factor, float(DECIMAL.findall(end)[0]) * 1e-3) for factor, end in cells]
    flights = [experiments.flight(kappa=0.0, gain_factor=f, period=T) for f, end in ends for T in (end, end + 0.02)]
    assert [outcome == "settled" for outcome in flown(flights)] == [True, False] * 3


def test_starts_lie_around_the_path_and_a_flight_is_from_the_one_that_it_names() -> None:
    starts, reference = experiments.random_starts(), np.array([*Trajectory().position(0.0)])
    sizes = np.linalg.norm(starts - reference, axis=-1)
    assert sizes == pytest.approx(np.array(experiments.SIZES)[:, None] * np.ones(experiments.DIRECTIONS))
    assert np.prod(experiments.STARTS) == 28_200
    size, direction, period = 2, 17, 40
    one = experiments.flight_from(starts, 3, size, direction, period)
    assert one.timing.period == experiments.PERIODS[period]
    assert one.controller.parameters["coupling"] == 0.0
    assert one.plant.parameters["actuator_time_constant"] == 0.01
    assert [one.plant.parameters[f"initial.position.{a}"] for a in "xyz"] == starts[size, direction].tolist()


def test_the_first_end_is_before_the_first_period_that_does_not_fly() -> None:
    flew = np.ones((3, len(experiments.PERIODS)), bool)
    flew[0, 4] = flew[0, 7] = flew[1, 0] = False
    last = experiments.PERIODS[-1]
    assert experiments.first_ends(flew).tolist() == [experiments.PERIODS[3], 0.0, last]


def test_what_diverged_comes_last_in_rank_and_shares_it() -> None:
    assert experiments.ranks(np.array([0.3, np.nan, 0.1, np.nan])) == pytest.approx([1 / 3, 2.5 / 3, 0.0, 2.5 / 3])


def test_an_island_is_told_beside_the_first_end() -> None:
    outcomes = ["settled", "bounded", "settled", "diverged"]
    good = [float(outcome == "settled") for outcome in outcomes]
    table = pd.DataFrame({"k": 1.0, "period": [0.01, 0.02, 0.03, 0.04], "outcome": outcomes, "good": good})
    (line,) = flying_up_to(table, "k", "period")
    assert line == "k 1: flies up to period 0.01; again at [0.03], bounded at [0.02]"
