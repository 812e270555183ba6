"""Proved basins of loops whose command is limited, against runs of the same loop."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.certificates import basin as module
from orchestration.theory.certificates.basin import Basin, basin, largest_basin
from orchestration.theory.certificates.check_file import check_certificate
from orchestration.theory.certificates.family import Letter
from orchestration.theory.certificates.verify_certificate import NotProven
from tests.examples.common import native_example as example
from tests.orchestration.theory.certificates.loops import late_command


def double_integrator(period: float) -> Basin:
    """Under u = -x - v, cut to ±1."""
    A, B, F = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[-1.0, -1.0]])
    late = late_command(A, B, F, period, 0.0)
    product = tuple(replace(factor, times=factor.times and factor.times[:1]) for factor in late.letters[0].product)
    return largest_basin(replace(late, letters=(Letter(name="punctual", product=product),)), 1.0)


def after(period: float, starts: Floats, steps: int) -> Floats:
    """Where the double integrator is then, shape (2, starts)."""
    x, v = starts
    for _ in range(steps):
        u = np.clip(-x - v, -1.0, 1.0)
        x, v = x + period * v + 0.5 * period**2 * u, v + period * u
    return np.array([x, v])


@pytest.mark.parametrize("period", [0.5, 1.0, 1.5])
def test_every_start_in_the_set_comes_to_rest_and_never_leaves_it(period: float) -> None:
    found = double_integrator(period)
    angles = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    edge = np.linalg.solve(np.linalg.cholesky(found.P).T, np.array([np.cos(angles), np.sin(angles)]))
    assert (np.abs(-edge[0] - edge[1]) > 1.2).any()  # the command is cut in it
    later = after(period, edge, 1)
    assert (np.einsum("ik,ij,jk->k", later, found.P, later) < 1.0).all()
    assert np.abs(after(period, edge, 400)).max() < 1e-3


def test_near_the_largest_period_it_is_not_much_smaller_than_what_flights_find() -> None:
    """At 1.5 s, along the position: from 1 m on there are runs that come back for ever."""
    found = double_integrator(1.5)
    assert np.abs(after(1.5, np.array([[1.02], [0.0]]), 1000)).max() > 0.1
    assert 0.8 < found.reach[0] < 1.02


def test_the_system_has_the_basin_of_its_matrices() -> None:
    slow = changed(example("double_integrator"), {"components.controller.sampling.period": 1.0})
    assert basin(slow, "command", 1.0).reach == pytest.approx(double_integrator(1.0).reach, rel=1e-4)
    assert basin(slow, "command", 2.0).reach == pytest.approx(2.0 * double_integrator(1.0).reach, rel=1e-4)


def test_more_than_the_set_is_not_proved(tmp_path: Path) -> None:
    found = double_integrator(1.0)
    file = tmp_path / "basin.json"
    file.write_text(found.certificate, encoding="utf-8")
    assert check_certificate(file).states == 2
    with pytest.raises(NotProven, match="may exceed the limit"):
        module._expect_within(np.linalg.cholesky(found.P).T / 1.01, found.H, 1.0)


@pytest.mark.parametrize(
    ("changes", "connection", "expected"),
    [
        ({"components.controller.sampling.period": 2.1}, "command", "no basin was found"),
        ({}, "measurement", "expected the connection from the only sampled component"),
    ],
)
def test_other_loops_are_refused(changes: dict[str, float], connection: str, expected: str) -> None:
    system: System = changed(example("double_integrator"), changes)
    with pytest.raises(UsageError, match=expected):
        basin(system, connection, 1.0)
