"""Quantities of a flight that figures and studies share with the objectives of the system file."""

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np

from orchestration.quadrotor.wiring import POSITION, POSITION_REFERENCE
from orchestration.simulator import Floats

SETTLED = 0.05
"""[m] of position error in the last third of a flight, below which it counts as settled; as in system.toml"""

Outcome = Literal["settled", "bounded", "diverged"]
"""What became of a flight by its horizon: settled is what counts as flying"""
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)


def desired(signals: Mapping[str, Floats]) -> Floats:
    """P_d [m], inertial, shape (n, 3)."""
    return np.column_stack([signals[name] for name in POSITION_REFERENCE])


def position_error(signals: Mapping[str, Floats]) -> Floats:
    """‖P - P_d‖ [m], shape (n,)."""
    actual = np.column_stack([signals[f"plant.{name}"] for name in POSITION])
    error: Floats = np.linalg.norm(actual - desired(signals), axis=1)
    return error
