"""Global sensitivity of a metric to the sampled axes of a study, with SALib."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fmu_kit.new_files import new_file
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats

SensitivityMethod = Literal["morris", "saltelli"]
METHODS: tuple[SensitivityMethod, ...] = ("morris", "saltelli")
LEVELS = 4
"""Levels of the Morris design"""
RESAMPLING_SEED = 1
"""Seed of the confidence intervals; SALib treats 0 as no seed"""


@dataclass(frozen=True, kw_only=True)
class Index:
    """The sensitivity of a metric to one axis, with its 95 % confidence."""

    axis: str
    kind: str
    """Morris: mu_star, sigma; Sobol: first, total"""
    value: float
    confidence: float


def runs_a_sample(method: str, dimension: int) -> int:
    """The number of runs per sample of `dimension` axes: one except for the sensitivity designs."""
    return {"morris": dimension + 1, "saltelli": dimension + 2}.get(method, 1)


def shares(method: SensitivityMethod, dimension: int, samples: int, seed: int) -> Floats:
    """The design in the unit cube: Morris trajectories, n (d + 1) rows, or Saltelli's, n (d + 2) rows."""
    problem = _problem([f"axis {i}" for i in range(dimension)])
    if method == "morris":
        from SALib.sample.morris import sample as morris

        return np.asarray(morris(problem, samples, num_levels=LEVELS, seed=seed))
    if samples & (samples - 1):
        raise UsageError(f"design.samples = {samples}: expected a power of two for Sobol indices")
    from SALib.sample.sobol import sample as saltelli

    return np.asarray(saltelli(problem, samples, calc_second_order=False, seed=seed))


def analyse(method: SensitivityMethod, axes: list[str], design: Floats, values: Floats, metric: str) -> list[Index]:
    """The indices of a metric, whose `values` (n,) belong to the rows of `design` (n, d).

    Raises `UsageError` if a value is missing, of a failed run or a metric that some runs do not have.
    """
    missing = int(np.count_nonzero(~np.isfinite(values)))
    if missing:
        raise UsageError(
            f"{metric}: {missing} of {len(values)} runs have no value, expected one for each; "
            "a run that diverged has none but its outcome"
        )
    problem = _problem(axes)
    if method == "morris":
        from SALib.analyze.morris import analyze as morris

        result = morris(problem, design, values, num_levels=LEVELS, seed=RESAMPLING_SEED)
        sigma = [Index(axis=a, kind="sigma", value=float(v), confidence=0.0) for a, v in zip(axes, result["sigma"])]
        return [*_indices(axes, "mu_star", result["mu_star"], result["mu_star_conf"]), *sigma]
    from SALib.analyze.sobol import analyze as sobol

    result = sobol(problem, values, calc_second_order=False, seed=RESAMPLING_SEED)
    return [
        *_indices(axes, "first", result["S1"], result["S1_conf"]),
        *_indices(axes, "total", result["ST"], result["ST_conf"]),
    ]


def write(indices: list[Index], path: Path) -> Path:
    """Write the indices as CSV."""
    import pandas as pd

    with new_file(path) as new:
        pd.DataFrame([asdict(index) for index in indices]).to_csv(new, index=False)
    return path


def _indices(axes: list[str], kind: str, values: Any, confidence: Any) -> list[Index]:
    return [
        Index(axis=axis, kind=kind, value=float(value), confidence=float(width))
        for axis, value, width in zip(axes, values, confidence, strict=True)
    ]


def _problem(axes: list[str]) -> dict[str, Any]:
    return {"num_vars": len(axes), "names": axes, "bounds": [[0.0, 1.0]] * len(axes)}
