"""Timings of real flight stacks by name, for a controller that runs at a single rate.

A unified law needs the full state and outputs torques, so it runs at the fastest rate at which the stack
runs a controller with the full state estimate; `loops_hz` has the rates of the stack's own cascade.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from orchestration.foundation.basics.errors import UsageError, expected_name


@dataclass(frozen=True, kw_only=True)
class Preset:
    """A stack: the rates of its cascade [Hz], and the timing keys [s] of a single-rate controller on it."""

    loops_hz: Mapping[str, float]
    timing: Mapping[str, float]


PRESETS = {
    # Rates: 1 kHz rate loop in step with the gyro, attitude once every 4 ms (PX4-Autopilot pull request 10761,
    # "MC: towards 1kHz rate controller loop"), position at 50 Hz (PX4 guide, "Controller Diagrams").
    # Latency from sensor to output: 224 µs on average, 201 µs to 566 µs on a Pixracer (PX4-Autopilot pull
    # request 9388, "improve end to end control latency measurement"). Filters are not in it: a 60 Hz low-pass
    # adds about 3.8 ms (PX4-user_guide pull request 1181).
    "px4": Preset(
        loops_hz={"rate": 1000.0, "attitude": 250.0, "position": 50.0},
        timing={"period": 0.004, "delay": 0.000201, "delay_jitter": 0.000365},
    ),
    # Rates: crazyflie-firmware, src/modules/interface/stabilizer_types.h: RATE_MAIN_LOOP 1000 Hz, ATTITUDE_RATE
    # 500 Hz, POSITION_RATE 100 Hz; its single-rate controllers (controller_mellinger.c) run at ATTITUDE_RATE.
    # Latency: sensors are read and motors set within one tick of the 1 kHz loop (stabilizer.c); one tick is
    # the bound taken here.
    "crazyflie": Preset(
        loops_hz={"tick": 1000.0, "attitude": 500.0, "position": 100.0},
        timing={"period": 0.002, "delay": 0.001},
    ),
    # Rate: PID loop at 4 kHz with DShot300 (Betaflight documentation, "Configuration Tab"); it has no position
    # loop. Latency: the command of one loop goes out with the next, 250 µs later, in a frame of 16 bits at
    # 300 kbit/s, 53 µs.
    "betaflight": Preset(
        loops_hz={"rate": 4000.0},
        timing={"period": 0.00025, "delay": 0.000303},
    ),
}


def preset_timing(name: str) -> dict[str, Any]:
    """The timing keys of a preset; raises `UsageError` that lists the presets for an unknown name."""
    if name not in PRESETS:
        raise UsageError(f"preset {name}: {expected_name(name, list(PRESETS))}")
    return dict(PRESETS[name].timing)
