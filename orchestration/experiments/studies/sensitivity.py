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
RESAMPLES = 1000
"""Samples of a confidence interval"""
TWO_SIDED = 1.96
"""Standard deviations in half a 95 % interval"""


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
        if samples < 2:
            raise UsageError(f"design.samples = {samples}: expected at least 2 for morris, whose effects have a spread")
        from SALib.sample.morris import sample as morris

        return np.asarray(morris(problem, samples, num_levels=LEVELS, seed=seed))
    if samples & (samples - 1):
        raise UsageError(f"design.samples = {samples}: expected a power of two for Sobol indices")
    from SALib.sample.sobol import sample as saltelli

    return np.asarray(saltelli(problem, samples, calc_second_order=False, seed=seed))


def analyse(method: SensitivityMethod, axes: list[str], design: Floats, values: Floats, metric: str) -> list[Index]:
    """The indices of a metric, whose `values` (n,) belong to the rows of `design` (n, d).

    Raises `UsageError` if a value is missing, of a failed run or a metric that some runs do not have, or all are equal.
    """
    missing = int(np.count_nonzero(~np.isfinite(values)))
    if missing:
        raise UsageError(
            f"{metric}: {missing} of {len(values)} runs have no value, expected one for each; "
            "a run that diverged has none but its outcome"
        )
    if (values == values[0]).all():
        raise UsageError(f"{metric} does not vary over the {len(values)} runs: it has no index; expected one that does")
    problem = _problem(axes)
    if method == "morris":
        from SALib.analyze.morris import analyze as morris

        result = morris(problem, design, values, num_levels=LEVELS, seed=RESAMPLING_SEED)
        widths = _confidence_of_spread(_effects(design, values))
        return [
            *_indices(axes, "mu_star", result["mu_star"], result["mu_star_conf"]),
            *_indices(axes, "sigma", result["sigma"], widths),
        ]
    from SALib.analyze.sobol import analyze as sobol

    result = sobol(problem, values, calc_second_order=False, seed=RESAMPLING_SEED)
    return [
        *_indices(axes, "first", result["S1"], result["S1_conf"]),
        *_indices(axes, "total", result["ST"], result["ST_conf"]),
    ]


def _effects(design: Floats, values: Floats) -> Floats:
    """The elementary effects of Morris trajectories, shape (n, d): each step of one changes one axis."""
    d = design.shape[1]
    steps, changes = np.diff(design.reshape(-1, d + 1, d), axis=1), np.diff(values.reshape(-1, d + 1), axis=1)
    return np.asarray(((steps != 0.0) * (changes / steps.sum(axis=2))[:, :, None]).sum(axis=1))


def _confidence_of_spread(effects: Floats) -> Floats:
    """Half the width of the 95 % interval of sigma by axis, by bootstrap over the trajectories, as SALib's of mu*."""
    generator, n = np.random.default_rng(RESAMPLING_SEED), len(effects)
    sigmas = [effects[generator.integers(n, size=n)].std(axis=0, ddof=1) for _ in range(RESAMPLES)]
    return np.asarray(TWO_SIDED * np.std(sigmas, axis=0, ddof=1))


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
