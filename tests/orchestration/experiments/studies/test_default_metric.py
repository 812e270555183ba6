"""The objective that is drawn by default."""

import numpy as np
import pytest

from orchestration.experiments.studies.default_metric import default_metric

VALUES = {
    "alike": np.array([1.0, 1.0, np.nan]),
    "hardly": np.array([1.0, 1.0006, np.nan]),
    "varied": np.array([1.0, 1.1, np.nan]),
    "more": np.array([1.0, 9.0, 3.0]),
    "unknown": np.array([np.nan, np.nan, np.nan]),
}


@pytest.mark.parametrize(
    ("objectives", "preferred", "expected"),
    [
        (("unknown", "alike", "hardly", "varied", "more"), "alike", "varied"),
        (("alike", "hardly"), "hardly", "hardly"),
        (("alike", "hardly"), None, "alike"),
        ((), None, "horizon"),
    ],
)
def test_the_first_objective_that_varies_else_the_one_of_the_criterion(
    objectives: tuple[str, ...], preferred: str | None, expected: str
) -> None:
    assert default_metric(objectives, VALUES.__getitem__, preferred) == expected
