"""A component measured through saved states, with stubs whose states are known."""

from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.theory.stability.linearised_component import Rest, Tangent
from quadcosim import UsageError


class Line:
    """A stub of an FMU: its input is its output some samples later, and decays in between."""

    name = "line"

    def __init__(self, samples: int) -> None:
        self.kept: Floats = np.zeros(samples)
        self.u = 0.0

    def writer(self, names: Any, source: Floats) -> Transfer:
        def write() -> None:
            self.u = float(source[0])

        return write

    def reader(self, names: Any, into: Floats) -> Transfer:
        def read() -> None:
            into[0] = self.kept[-1]

        return read

    def step(self, t: float, h: float) -> None:
        self.kept = np.concatenate([[self.u], 0.9 * self.kept[:-1]])

    def save(self) -> bytes:
        return self.kept.tobytes()

    def restore(self, state: bytes) -> None:
        self.kept = np.frombuffer(state).copy()


def tangent(fmu: Any, points: int) -> Tangent:
    return Tangent(Rest(fmu=fmu, inputs=("u",), held=np.zeros(1), outputs=("y",), time=0.0), [1.0] * points)


def responses(simulator: Any, samples: int) -> list[float]:
    """The output after each step of a pulse of 1 over the first."""
    pulse, output, outputs = np.zeros(1), np.zeros(1), []
    write, read = simulator.writer(("u",), pulse), simulator.reader(("y",), output)
    for k in range(samples):
        pulse[0] = k == 0
        write()
        simulator.step(float(k), 1.0)
        read()
        outputs.append(float(output[0]))
    return outputs


@pytest.mark.parametrize("samples", [1, 2, 5, 8, 20])
def test_a_dead_time_within_the_ladder_is_a_state_for_each_sample(samples: int) -> None:
    measured = tangent(Line(samples), 32)
    assert len(measured.state) == samples - 1
    assert responses(measured, samples + 3) == pytest.approx(responses(Line(samples), samples + 3), abs=1e-8)


def test_more_states_than_the_ladder_shows_are_refused_by_name() -> None:
    with pytest.raises(UsageError, match="line: has more states than"):
        tangent(Line(6), 5)


class Bent(Line):
    """One that adds the cube of its input."""

    def step(self, t: float, h: float) -> None:
        self.kept = np.concatenate([[self.u + self.u**3], 0.9 * self.kept[:-1]])


@pytest.mark.parametrize("samples", [1, 3])
def test_the_error_of_responses_to_larger_pulses_is_the_nonlinear_part(samples: int) -> None:
    assert tangent(Line(samples), 32).prediction_error(1.0, 1.0) < 1e-9
    bent = tangent(Bent(samples), 32)
    assert bent.prediction_error(0.1, 1.0) == pytest.approx(0.01 / 1.01, rel=1e-6)
    assert bent.prediction_error(1e-5, 1.0) < 1e-9


def test_states_are_saved_and_put_back() -> None:
    measured = tangent(Line(3), 8)
    responses(measured, 1)
    kept = measured.save()
    later = responses(measured, 4)
    measured.restore(kept)
    assert responses(measured, 4) == later
    assert np.any(np.array(later) != 0.0)
