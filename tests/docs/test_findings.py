"""What the pages on the paper's flight say is what is run again; their conclusions are computed rightly."""

import re
from collections.abc import Iterable

import pandas as pd

import quadcosim
from docs.finding_texts import fates, up_to
from docs.theory import ATTITUDE, PAPER, scaled
from orchestration.quadrotor.scenarios.scenario import Scenario
from tests.places import ROOT

PAGES = "\n".join(page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs" / "findings").glob("*.md")))
DECIMAL = re.compile(r"-?\d+\.?\d*")


def outcomes(base: Scenario, periods: Iterable[float], kappas: Iterable[float] | float = 0.0) -> list[str]:
    values = {"timing.period": [*periods], "controller.coupling": kappas if isinstance(kappas, float) else [*kappas]}
    found = quadcosim.fly(base, values, outputs=["good", "diverged"])
    return ["settled" if good else "diverged" if lost else "bounded" for good, lost in zip(*found.values())]


def rows(section: str) -> dict[str, list[str]]:
    """The first table of a section: cells of each row by its first one."""
    text = PAGES[PAGES.index(f"\n## {section}") :]
    (table, *_) = re.findall(r"(?:^\|.*\|\n)+", text, re.M)
    return {first: rest for first, *rest in (line.strip("| ").split(" | ") for line in table.splitlines()[2:])}


def test_limits_of_the_page_settle_and_what_lies_a_little_above_does_not() -> None:
    limits = {
        float(kappa.split()[0]): cells for kappa, cells in rows("What is local").items() if "none" not in cells[1]
    }
    assert len(limits) == 5
    ends = {kappa: float(DECIMAL.findall(cells[1])[0]) * 1e-3 for kappa, cells in limits.items()}
    assert outcomes(PAPER, ends.values(), ends) == ["settled"] * 5
    above = [cells[2].split()[0].replace("diverges", "diverged") for cells in limits.values()]
    assert outcomes(PAPER, [period + 0.00025 for period in ends.values()], ends) == above


def test_with_the_gains_of_the_page_flights_settle_up_to_what_it_says() -> None:
    ends = rows("Gains and period")["κ = 0"]
    for factor, i in ((0.5, 2), (1.0, 4), (2.0, 6)):
        end = float(DECIMAL.findall(ends[i])[0]) * 1e-3
        found = outcomes(scaled(ATTITUDE, factor, PAPER), (end, end + 0.02))
        assert [outcome == "settled" for outcome in found] == [True, False], factor


def table_of(*flights: tuple[float, str, float | None, float | None]) -> pd.DataFrame:
    """Periods, outcomes, settling times and times of divergence."""
    table = pd.DataFrame([*flights], columns=["period", "outcome", "settling_time", "divergence_time"])
    return table.assign(k=1.0)


ISLANDS = table_of(
    (0.01, "settled", 5.0, None), (0.02, "bounded", None, None), (0.03, "bounded", 45.0, None),
    (0.04, "diverged", None, 3.0), (0.05, "settled", 25.0, None), (0.06, "diverged", None, 35.0),
)  # fmt: skip


def test_an_island_is_told_beside_the_first_end_of_each_fate() -> None:
    (line,) = up_to(ISLANDS, "k", "period")
    assert line == "k 1: survive up to 0.03, again at 0.05; settle up to 0.01, again at 0.05"


def test_what_a_longer_horizon_adds_is_told() -> None:
    assert (
        fates(ISLANDS)
        == "6 flights, 4 survive (diverged by 20/30/40/60 s: 1/1/2/2), 2 settle (inside from then on: 1/2/2/3)"
    )
