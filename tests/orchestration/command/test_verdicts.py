"""The sentences that commands begin with: their units, and what they say of an answer that is less than it seems."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from orchestration.experiments.limits.evaluation import Evaluation
from orchestration.experiments.limits.limit_result import Limit
from orchestration.foundation.basics import terminal
from orchestration.foundation.basics.unit_algebra import quantity
from quadcosim import Expected, Linearised

GOOD = Evaluation(value=0.035250000000000004, outcome="settled", divergence_time=None, flew=1, runs=1, share=None)
BAD = replace(GOOD, value=0.0355, outcome="diverged", divergence_time=3.0, flew=0)
LIMIT = Limit(
    of="period", unit="s", local_limit=None, local_limit_outside=None, large_signal_limit=GOOD.value,
    refuted_limit=None, horizon=30.0, tolerance=0.0005, scan=0.005, confidence=None, seeds=1, flies_above=(),
    continuous=None, tried=(GOOD, BAD), notes=(),
)  # fmt: skip
RESOLUTION = "(scan 5 ms, tolerance 0.5 ms)"


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (0.035250000000000004, "s", "35.25 ms"),
        (0.99999, "s", "1 s"),
        (0.0, "m", "0 m"),
        (-0.0012, "m", "-1.2 mm"),
        (1e-12, "s", "0.001 ns"),
        (1234.56, "N.m", "1235 N.m"),
        (0.25, "1", "0.25"),
        (0.25, None, "0.25"),
    ],
)
def test_a_number_has_few_digits_and_a_prefix_where_its_unit_takes_one(
    value: float, unit: str | None, expected: str
) -> None:
    assert quantity(value, unit) == expected


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, f"period good up to 35.25 ms; diverges at 35.5 ms {RESOLUTION}"),
        (
            {"flies_above": (0.04,)},
            f"period good up to 35.25 ms; diverges at 35.5 ms; good again at 40 ms {RESOLUTION}",
        ),
        (
            {"tried": (GOOD, replace(BAD, outcome="bounded", unmet="ultimate_bound = 0.06 m, expected < 0.05 m"))},
            "period good up to 35.25 ms; not at 35.5 ms: bounded, ultimate_bound = 0.06 m, expected < 0.05 m "
            f"{RESOLUTION}",
        ),
        (
            {"large_signal_limit": None, "tried": (GOOD,)},
            f"period good throughout the scan, up to 35.25 ms {RESOLUTION}",
        ),
        (
            {"large_signal_limit": None, "tried": (GOOD,), "missed_deadlines_from": 0.02, "missed_by": ("cpu.load",)},
            "period good throughout the scan, up to 35.25 ms; deadlines of cpu.load are missed already at 20 ms "
            f"{RESOLUTION}",
        ),
        (
            {"large_signal_limit": None, "tried": (replace(BAD, value=0.001),)},
            f"period not good even at 1 ms, where the scan begins: diverged {RESOLUTION}",
        ),
        (
            {"scan": 1.585, "tolerance": 0.01, "geometric": True},
            "period good up to 35.25 ms; diverges at 35.5 ms (scan by a factor of 1.6, tolerance 1 %)",
        ),
        ({"seeds": 29}, f"period good up to 35.25 ms, all of 29 seeds; diverges at 35.5 ms {RESOLUTION}"),
    ],
)
def test_a_limit_states_the_last_good_value_the_first_bad_one_and_its_resolution(
    changes: dict[str, Any], expected: str
) -> None:
    assert replace(LIMIT, **changes).verdict == expected


def test_a_radius_that_rounding_may_put_on_either_side_of_one_decides_nothing() -> None:
    half, common = SimpleNamespace(A=[0.0], dt=0.01), {"in_double": (), "clock": "sampled every 10 ms"}

    def sentence(radius: float) -> str:
        loop = SimpleNamespace(name="law", component=half, rest=half, radius=radius, **common)
        return str(cast("Any", Linearised.verdict).fget(loop))

    assert sentence(0.9) == (
        "stable: spectral radius 0.9, sampled every 10 ms: law with 1 state, the rest with 1 state, those that inputs "
        "reach and outputs show"
    )
    assert sentence(1.1).startswith("unstable: spectral radius 1.1")
    assert sentence(1.0 - 1e-9).startswith("not decidably stable: ")


def test_means_that_are_infinite_are_the_answer() -> None:
    found = SimpleNamespace(objectives={"J": None}, mean_square_radius=1.2, period=0.1, horizon=None)
    assert cast("Any", Expected.verdict).fget(found) == "no mean of squares is finite: mean-square radius 1.2 in 100 ms"


def test_progress_in_passing_is_the_text_of_a_bar_and_never_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    printed, beside = list[str](), list[str]()
    monkeypatch.setattr(terminal, "inform", printed.append)
    terminal.inform_in_passing("period 0.01 s: settled")
    monkeypatch.setattr(terminal, "_BARS", [beside.append])
    terminal.inform_in_passing("period 0.02 s: settled")
    assert (printed, beside) == ([], ["period 0.02 s: settled"])
