"""What is kept of the paper's flight is what is run again; conclusions are computed rightly."""

import re
from collections.abc import Iterable

import pandas as pd

import quadcosim
from docs.comparisons import read_data
from docs.make_findings import ends, fates
from docs.theory import ATTITUDE, PAPER, scaled
from orchestration.quadrotor.scenarios.scenario import Scenario
from tests.extent import in_test_all
from tests.places import ROOT


def outcomes(base: Scenario, periods: Iterable[float], kappas: Iterable[float] | float = 0.0) -> list[str]:
    values = {"timing.period": [*periods], "controller.coupling": kappas if isinstance(kappas, float) else [*kappas]}
    found = quadcosim.fly(base, values, outputs=["good", "diverged"])
    return ["settled" if good else "diverged" if lost else "bounded" for good, lost in zip(*found.values())]


@in_test_all
def test_limits_that_are_kept_settle_and_what_lies_a_little_above_does_not() -> None:
    limits = {one["coupling"]: one for one in read_data("limits")["limits"] if one["settles"] is not None}
    assert len(limits) == 5
    ends = {kappa: one["settles"] for kappa, one in limits.items()}
    assert outcomes(PAPER, ends.values(), ends) == ["settled"] * 5
    assert outcomes(PAPER, [period + 0.00025 for period in ends.values()], ends) == ["diverged"] * 5


def test_with_other_gains_flights_settle_up_to_what_the_page_says() -> None:
    page = (ROOT / "docs" / "findings" / "clock.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| κ = 0 \| (.*ms) \|$", page, re.M)
    ends = row.split(" | ")
    for factor, i in ((0.5, 1), (1.0, 3), (2.0, 5)):
        end = float(ends[i].removesuffix(" ms")) * 1e-3
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


def test_an_island_is_kept_beside_the_first_end_of_each_fate() -> None:
    assert ends(ISLANDS, "k", "period") == [
        {"k": 1.0, "survive": 0.03, "survive_again": [0.05], "settle": 0.01, "settle_again": [0.05]}
    ]


def test_what_a_longer_horizon_adds_is_counted() -> None:
    assert fates(ISLANDS) == {
        "flights": 6, "survive": 4, "settle": 2, "diverged_by": {"20": 1, "30": 1, "40": 2, "60": 2},
        "inside_from": {"20": 1, "30": 2, "40": 2, "60": 3},
    }  # fmt: skip
