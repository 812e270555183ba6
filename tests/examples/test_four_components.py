"""Four components at three rates: the run is that of a loop written here, from the page on timing alone."""

import math

import numpy as np

from orchestration.simulation.runs.simulation import run
from tests.examples.common import example

QUIET = {
    "stop_time": 25.0,
    "connections.wheel.noise.speed": 0.0,
    "connections.wheel.quantisation.speed": 0.0,
    "connections.demand.delay_jitter": 0.0,
    "connections.demand.loss": 0.0,
}
STEP = 0.005
"""[s]; all that happens lies on this grid"""


def slope(t: float) -> float:
    return -1500.0 * min(max((t - 20.0) / 2.0, 0.0), 1.0)


def expected_speeds(ticks: int) -> list[float]:
    """Speeds every 5 ms: sensor every 2 ticks, engine every 4 from tick 1, controller every 20, both wires 4 late."""
    speed, filtered, integral, demand, force, road = 20.0, 20.0, 800.0, 800.0, 800.0, slope(0.0)
    sent_filtered: dict[int, float] = {}
    sent_demand: dict[int, float] = {}
    speeds = [speed]
    arrived_filtered, arrived_demand = filtered, demand
    for k in range(ticks):
        arrived_filtered = sent_filtered.get(k - 4, arrived_filtered)
        arrived_demand = sent_demand.get(k - 4, arrived_demand)
        if k % 2 == 0:
            filtered += -math.expm1(-0.01 / 0.05) * (speed - filtered)
            sent_filtered[k] = filtered
        if k % 20 == 0:
            error = 25.0 - arrived_filtered
            wanted = 1200.0 * error + integral
            demand = min(max(wanted, 0.0), 4000.0)
            integral += 300.0 * 0.1 * error if demand == wanted else 0.0
            sent_demand[k] = demand
        if k % 4 == 1:
            force += min(max(arrived_demand - force, -100.0), 100.0)
        if k % 2 == 0 or k % 4 == 1:  # the car halts, and hears of the road
            road = slope(k * STEP)
        final = (force + road) / 40.0
        speed -= (final - speed) * math.expm1(-STEP * 40.0 / 1200.0)
        speeds.append(speed)
    return speeds


def test_the_run_is_that_of_another_loop() -> None:
    signals = run(example("four_components", QUIET)).signals
    ticks = np.round(np.asarray(signals["time"]) / STEP).astype(int)
    expected = np.array(expected_speeds(int(ticks[-1])))[ticks]
    assert np.abs(np.asarray(signals["car.speed"]) - expected).max() < 1e-9
    assert len(set(np.diff(ticks))) > 1, "expected rows of several rates"
