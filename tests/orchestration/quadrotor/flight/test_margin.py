"""Bounds of delays that vary, against loops of which they are known, and against sequences of delays."""

import json
import math
from typing import Any

import numpy as np
import pytest

from orchestration.command.cli import main
from orchestration.theory.stability import delay_bounds
from orchestration.theory.stability.delay_bounds import SampledLoop, breaking_jitter, certain_jitter
from tests.orchestration.experiments.studies.common import one_line

DOUBLE: dict[str, Any] = {
    "A": np.array([[0.0, 1.0], [0.0, 0.0]]), "B": np.array([[0.0], [1.0]]), "F": np.array([[-1.0, -1.0]]),
}  # fmt: skip
"""A double integrator under u = -x - v"""


def integrator(gain: float, delay: float = 0.0) -> SampledLoop:
    return SampledLoop(A=np.zeros((1, 1)), B=np.ones((1, 1)), F=np.array([[-gain]]), period=1.0, delay=delay)


@pytest.mark.parametrize(("gain", "periods"), [(0.5, 17.0 / 12.0), (1.2, 1.0 / 9.0), (0.1, 9.0 + 9.25 / 19.0)])
def test_certain_jitter_of_an_integrator_is_that_of_the_formula_by_hand(gain: float, periods: float) -> None:
    """|G| |e^jω - 1| = k |e^jω - 1| / |e^jω - 1 + k| is largest at π: Ñ = (2 - k)/(2 k), whatever the aliases."""
    assert certain_jitter(integrator(gain)) == pytest.approx(periods, rel=2e-6)


def test_the_aliases_that_are_left_out_are_summed() -> None:
    omega = np.array([1e-3, 1.0, math.pi])
    expected = 0.5 / np.abs(np.exp(1j * omega) - 0.5)  # Σ 1/(ω + 2πk)² = 1/|e^jω - 1|²
    assert delay_bounds._gains(integrator(0.5), omega) == pytest.approx(expected, rel=2e-6)


def test_breaking_jitter_of_delays_that_are_all_late_is_the_constant_limit() -> None:
    """At a period of 0.05 s it is 0.68614 s, of which every command has 0.6 s here."""
    found = breaking_jitter(SampledLoop(**DOUBLE, period=0.05, delay=0.6), 0.2)
    assert found is not None
    assert (found[0] + 0.6, found[1]) == (pytest.approx(0.68614, abs=2e-5), (1.0,))


def test_no_sequence_breaks_a_jitter_that_is_certain_and_one_breaks_more() -> None:
    random = np.random.default_rng(4)
    A, B, F = [[0.0, 1.0], [-2.2, -0.065]], [[0.0], [1.0]], [[-0.502, -0.21]]
    hardly_damped = SampledLoop(A=np.array(A), B=np.array(B), F=np.array(F), period=1.0)  # 1.2e-4 per period
    double = SampledLoop(**DOUBLE, period=1.0)
    for loop in (integrator(0.5), integrator(1.2), integrator(0.3, 0.7), double, hardly_damped):
        certain, broken = certain_jitter(loop), breaking_jitter(loop, 5.0)
        assert broken is not None
        assert 0.0 < certain < broken[0]
        assert delay_bounds._radius(loop, [1.001 * broken[0] * share for share in broken[1]]) > 1.0
        for _ in range(8):
            late = certain * random.integers(0, 2, 6)
            assert delay_bounds._radius(loop, list(late)) < 1.0


def test_commands_do_not_overtake_each_other() -> None:
    """A late command holds up the one after it: late by 1.5, 0 periods is late by 1.5, 0.5."""
    loop = integrator(0.3)
    assert delay_bounds._radius(loop, (1.5, 0.0)) == pytest.approx(delay_bounds._radius(loop, (1.5, 0.5)), rel=1e-12)
    assert delay_bounds._radius(loop, (1.5, 0.0)) != pytest.approx(delay_bounds._radius(loop, (1.5, 0.6)), rel=1e-3)


def test_a_loop_that_is_unstable_without_jitter_stands_none() -> None:
    assert certain_jitter(integrator(2.5)) == 0.0


def test_sequences_are_tried_once_each() -> None:
    assert [len(p) for p in delay_bounds.patterns(4)] == [1, 2, 3, 3, 4, 4, 4]


def margin(capsys: pytest.CaptureFixture[str], *flags: str) -> dict[str, float]:
    with pytest.raises(SystemExit) as ended:
        main(["margin", "--native", "--plant-interval", "0.005", *flags, "--json"])
    assert not ended.value.code
    found: dict[str, float] = json.loads(capsys.readouterr().out)
    return found


def test_margin_of_the_paper_brackets_what_jitter_its_hover_stands(capsys: pytest.CaptureFixture[str]) -> None:
    found = margin(capsys, "--period", "0.04")
    assert found["certain_jitter"] == pytest.approx(0.00935, abs=1e-5)
    assert found["breaking_jitter"] == pytest.approx(0.02823, abs=1e-5)
    assert found["delay_limit"] == pytest.approx(0.02958, abs=1e-5)


def test_margin_of_what_has_none_is_refused_in_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["margin", "--hold", "first"])
    assert ended.value.code == 2
    assert "margin: expected hold zero" in one_line(capsys.readouterr().err)
