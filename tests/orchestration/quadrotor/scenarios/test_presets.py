"""Presets are timings like any other."""

import pytest

import quadcosim
from orchestration.quadrotor.scenarios.timing import PRESETS, preset_timing
from quadcosim import Scenario, Timing, UsageError


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_runs_without_divergence(name: str) -> None:
    result = quadcosim.run(Scenario(stop_time=0.1, timing=Timing(**preset_timing(name))))
    assert result.metrics["diverged"] is False


@pytest.mark.parametrize("name", PRESETS)
def test_a_single_rate_controller_runs_at_the_rate_of_one_of_the_loops(name: str) -> None:
    preset = PRESETS[name]
    assert 1.0 / preset.timing["period"] in [pytest.approx(rate) for rate in preset.loops_hz.values()]


def test_an_unknown_preset_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UsageError, match="expected one of px4, crazyflie, betaflight"):
        preset_timing("ardupilot")
