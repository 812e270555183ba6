"""A program that uses the API, which mypy reads with all else: types are as said, and what is ignored is an error."""

import numpy as np
import numpy.typing as npt
from typing_extensions import assert_type

import quadcosim
from quadcosim import Scenario, Timing


def program() -> None:
    result = quadcosim.run(Scenario(timing=Timing(period=0.02)))
    assert_type(result, quadcosim.Result)
    assert_type(result.metrics["ultimate_bound"], float | int | bool | str | None)
    assert_type(result.signals["time"], npt.NDArray[np.float64])
    assert_type(result.provenance["wall_time"], float)
    assert_type(quadcosim.limit(Scenario(), "period"), quadcosim.Limit)
    assert_type(quadcosim.limit(Scenario(), "period").large_signal_limit, float | None)
    quadcosim.runn()  # type: ignore[attr-defined]
    Timing(period="x")  # type: ignore[arg-type]
