"""A component measured through saved states, with stubs whose states are known."""

import dataclasses
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.theory.stability import matrices
from orchestration.theory.stability.excitation import STANDS_OUT, Excitation, ImpreciseError, Rest, Rung
from orchestration.theory.stability.identification import in_continuous_time, of_samples
from orchestration.theory.stability.lifted_component import of_one_rate
from orchestration.theory.stability.linearised_component import Tangent
from quadcosim import UsageError


class Line:
    """A stub of an FMU: its input is its output some samples later, and decays in between."""

    name = "line"
    model = SimpleNamespace(path="Line.fmu")

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


def rest(fmu: Any) -> Rest:
    return Rest(fmu=fmu, inputs=("u",), held=np.zeros(1), outputs=("y",), time=0.0)


def tangent(fmu: Any) -> Tangent:
    return of_one_rate(of_samples(rest(fmu), 1.0).tangent())


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
    measured = tangent(Line(samples))
    assert len(measured.state) == samples - 1
    assert responses(measured, samples + 3) == pytest.approx(responses(Line(samples), samples + 3), abs=1e-8)


def test_more_states_than_the_ladder_shows_are_refused_by_name() -> None:
    with pytest.raises(UsageError, match="line: has 5 states or more, as 5 pulses and 5 steps show no more"):
        Tangent(Excitation(rest(Line(6))), [Rung(1, 1.0)] * 5, 5)


def test_a_dead_time_beyond_the_ladder_is_refused() -> None:
    with pytest.raises(UsageError, match="line: its linear model, of 0 states, does not predict the response"):
        tangent(Line(40))


class Bent(Line):
    """One that adds the cube of its input."""

    def step(self, t: float, h: float) -> None:
        self.kept = np.concatenate([[self.u + self.u**3], 0.9 * self.kept[:-1]])


@pytest.mark.parametrize("samples", [1, 3])
def test_pulses_are_as_large_as_the_response_is_linear(samples: int) -> None:
    bent, line = tangent(Bent(samples)), tangent(Line(samples))
    assert bent.pulse < 1e-4
    assert responses(bent, samples + 3) == pytest.approx(responses(Line(samples), samples + 3), abs=1e-9)
    assert bent.accuracy < 1e-9
    assert line.accuracy < 1e-12


class Levitated(Line):
    """A ball below an electromagnet, by its voltage: it falls away from where it rests, the faster the further."""

    CURRENT = (0.05 * 9.81 / 7e-5) ** 0.5 * 0.01
    VOLTAGE = 5.0 * CURRENT

    def __init__(self) -> None:
        self.kept, self.u = np.array([self.CURRENT, 0.0, 0.01]), self.VOLTAGE

    def later(self, h: float, rate: tuple[float, ...] = (0.0, 0.0, 0.0)) -> tuple[float, ...]:
        """The rates after `h` at a constant rate."""
        current, speed, gap = (value + h * each for value, each in zip(self.kept.tolist(), rate))
        pull = 7e-5 * (current / gap) ** 2 / 0.05
        return (self.u - 5.0 * current) / 0.02, 9.81 - pull, speed

    def step(self, t: float, h: float) -> None:
        count = int(np.ceil(h / 0.00025 - 1e-6))
        h /= count
        for _ in range(count):  # by the method of Runge and Kutta
            a = self.later(0.0)
            b = self.later(0.5 * h, a)
            c = self.later(0.5 * h, b)
            each = zip(self.kept.tolist(), a, b, c, self.later(h, c))
            self.kept = np.array([x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d) for x, a, b, c, d in each])


def test_pulses_are_enlarged_where_rounding_spoils_states_that_hardly_move_the_output() -> None:
    ball: Any = Levitated()
    held = np.array([ball.VOLTAGE])
    about = Rest(fmu=ball, inputs=("u",), held=held, outputs=("y",), time=0.0)
    tangent = in_continuous_time(about, 0.001, 0.0005)
    found = matrices.in_continuous_time(tangent, 0.00025)
    falls = (2.0 * 9.81 / 0.01) ** 0.5
    assert found.unfit is None
    assert 1e-9 < found.misfit < matrices.INEXACT
    assert found.misfit < STANDS_OUT * tangent.rounding < 10.0 * matrices.INEXACT
    poles = np.sort(np.linalg.eigvals(found.A).real)
    assert poles == pytest.approx([-250.0, -falls, falls], rel=1e-5)
    rng, off = np.random.default_rng(0), list[Floats]()
    for _ in range(3):
        noisy = [
            M + each * rng.standard_normal(M.shape) for M, each in zip(tangent.derivatives(0.00025), tangent.noise)
        ]
        other = matrices.continuous(tangent, (noisy[0], noisy[1]), 0.00025)
        off.append(np.sort(np.linalg.eigvals(other.A).real) - poles)
    errors = np.abs(poles - [-250.0, -falls, falls]) / np.sqrt(np.mean(np.square(off), axis=0))
    assert errors.max() < 4.0, "as far off as the noise of its derivatives explains"


def test_what_has_only_nearly_come_to_rest_and_falls_away_shows_no_further_states() -> None:
    ball: Any = Levitated()
    ball.kept[2] += 2e-7
    about = Rest(fmu=ball, inputs=("u",), held=np.array([ball.VOLTAGE]), outputs=("y",), time=0.0)
    found = in_continuous_time(about, 0.001, 0.0005)
    after = np.exp(0.0005 * (2.0 * 9.81 / 0.01) ** 0.5 * np.array([-1.0, 1.0]))
    after = np.sort([np.exp(-250.0 * 0.0005), *after])
    assert np.sort(np.linalg.eigvals(found.derivatives(0.0005)[0][1:]).real) == pytest.approx(after, rel=1e-4)


class Creeping(Line):
    """A fast state that the output shows, and one that creeps after it, which it shows by a share."""

    simulated = 0.0

    def __init__(self, share: float) -> None:
        self.kept, self.u, self.share = np.zeros(2), 0.0, share

    def reader(self, names: Any, into: Floats) -> Transfer:
        def read() -> None:
            into[0] = 1.0 + self.kept[0] + self.share * self.kept[1]

        return read

    def step(self, t: float, h: float) -> None:
        self.simulated += h
        flow = expm(h * np.array([[-50.0, 0.0, 50.0], [1.0, -0.01, 0.0], [0.0, 0.0, 0.0]]))
        self.kept = (flow @ np.append(self.kept, self.u))[:2]


def test_of_rates_far_apart_a_plant_is_measured_over_the_shortest_and_foretells_the_longest() -> None:
    plant = Creeping(0.1)
    found = in_continuous_time(rest(plant), 0.001, 0.001, until=10.0)
    rates = np.log(np.sort(np.linalg.eigvals(found.derivatives(0.001)[0][1:]))) / 0.001
    assert rates == pytest.approx([-50.0, -0.01], rel=1e-4)
    assert plant.simulated < 10.0 * 10.0
    plant = Creeping(0.0)
    found = in_continuous_time(rest(plant), 0.001, 0.001)
    assert found.foretells(10.0, 0.1)
    plant.share = 1e-4
    assert not found.foretells(10.0, 0.1)


class Swinging(Line):
    """One that swings whole times in a millisecond, beside a slow decay that the output shows more of."""

    def __init__(self, times: int) -> None:
        w = 2.0 * np.pi * 1e3 * times
        self.kept, self.u = np.zeros(3), 0.0
        self.A = np.array([[-1.0, w, 0.0, 0.0], [-w, -1.0, 0.0, w], [0.0, 0.0, -1.0, 1.0], [0.0] * 4])

    def reader(self, names: Any, into: Floats) -> Transfer:
        def read() -> None:
            into[0] = 0.01 * self.kept[0] + self.kept[2]

        return read

    def step(self, t: float, h: float) -> None:
        self.kept = (expm(h * self.A) @ np.append(self.kept, self.u))[:3]


@pytest.mark.parametrize("times", [1, 4, 8])
def test_what_swings_whole_times_in_a_step_is_seen_by_another_one(times: int) -> None:
    plant = Swinging(times)
    found = matrices.in_continuous_time(in_continuous_time(rest(plant), 0.001, 0.001), 0.001)
    assert np.abs(np.linalg.eigvals(found.A).imag).max() == pytest.approx(2.0 * np.pi * 1e3 * times, rel=1e-6)


class Leaning(Line):
    """One that follows its input by a factor upward and by another one downward."""

    def __init__(self, up: float, down: float) -> None:
        self.kept, self.u, self.up, self.down = np.zeros(1), 0.0, up, down

    def step(self, t: float, h: float) -> None:
        self.kept = 0.5 * self.kept + np.array([self.up * max(self.u, 0.0) + self.down * min(self.u, 0.0)])


@pytest.mark.parametrize(("up", "down"), [(2.0, 0.0), (1.01, 1.0)], ids=["at a limit", "kinked"])
def test_what_follows_inputs_up_by_another_factor_than_down_is_refused(up: float, down: float) -> None:
    """It responds to any pulse up and down, one less the other, as by the mean of both factors."""
    with pytest.raises(UsageError, match=r"up and down differ in effect, by .* as where it rests just at a limit"):
        tangent(Leaning(up, down))
    assert responses(tangent(Leaning(2.0, 2.0)), 2) == pytest.approx([2.0, 1.0])


class Bending(Line):
    """One that bends smoothly: a larger move up does more than one down."""

    def step(self, t: float, h: float) -> None:
        self.kept = 0.5 * self.kept + self.u + 1e4 * self.u**2


def test_what_bends_smoothly_is_linear_for_small_moves() -> None:
    assert responses(tangent(Bending(1)), 2) == pytest.approx([1.0, 0.5])


class Alternating(Line):
    """One that takes its input at every fourth step only, by a counter, and counts its steps."""

    turn, steps = 0, 0

    def step(self, t: float, h: float) -> None:
        taken = self.u if self.turn == 0 else 0.0
        self.kept = np.concatenate([[taken], 0.9 * self.kept[:-1]])
        self.turn, self.steps = (self.turn + 1) % 4, self.steps + 1

    def save(self) -> bytes:
        return np.array([*self.kept, self.turn]).tobytes()

    def restore(self, state: bytes) -> None:
        *kept, turn = np.frombuffer(state)
        self.kept, self.turn = np.array(kept), int(turn)


def test_a_component_of_several_rates_is_pulsed_at_one_sample_to_choose_and_what_has_no_effect_is_followed_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pulsed, choose = list[tuple[str, ...]](), Excitation.choose_pulse

    def noted(self: Excitation, rungs: Sequence[Rung]) -> int:
        pulsed.append(self.inputs)
        return choose(self, rungs)

    monkeypatch.setattr(Excitation, "choose_pulse", noted)
    fmu = Alternating(3)
    begun = of_samples(rest(fmu), 1.0)
    assert begun.samples == 4
    before = fmu.steps
    measured = begun.tangent()
    assert set(pulsed) == {("u",)}
    assert fmu.steps - before < 4000
    assert responses(measured, 9) == pytest.approx(responses(Alternating(3), 9), abs=1e-8)


class Cascaded(Alternating):
    """One whose slow task, which is not due at the first sample, moves it most; rounded at the last digit of 0.5."""

    turn = 1

    def step(self, t: float, h: float) -> None:
        gain = 0.6 if self.turn == 0 else 0.012
        self.kept = np.concatenate([[0.5 + gain * self.u], 0.5 + 0.9 * (self.kept[:-1] - 0.5)])
        self.turn = (self.turn + 1) % 4


def test_pulses_of_a_component_of_several_rates_are_chosen_for_all_of_its_tasks() -> None:
    fmu = Cascaded(3)
    fmu.kept += 0.5
    found = of_samples(rest(fmu), 1.0).tangent()
    assert responses(found, 6) == pytest.approx([0.0, 0.0, 0.012 * 0.81, 0.0, 0.0, 0.0], abs=1e-9)


class Drifting(Line):
    """One that responds by a little more from sample to sample."""

    def step(self, t: float, h: float) -> None:
        self.kept = np.concatenate([[self.u * (1.0 + 2e-5 * t)], 0.9 * self.kept[:-1]])


def test_a_model_that_does_not_predict_the_response_to_a_random_input_is_refused() -> None:
    with pytest.raises(UsageError, match=r"line: its linear model, of 2 states, does not predict the response"):
        tangent(Drifting(3))


class Switched(Line):
    """One that responds ten times as much once it is switched."""

    gain = 1.0

    def step(self, t: float, h: float) -> None:
        self.kept = np.concatenate([[self.u * self.gain], 0.9 * self.kept[:-1]])


def test_a_model_holds_where_the_same_instance_rests_again_and_responds_alike() -> None:
    fmu = Switched(3)
    measured = tangent(fmu)
    before = responses(measured, 4)
    again = measured.about(rest(fmu))
    assert again is not None
    assert responses(again, 4) == before
    assert measured.about(rest(Switched(3))) is None
    assert measured.about(dataclasses.replace(rest(fmu), held=np.ones(1))) is None
    assert measured.about(dataclasses.replace(rest(fmu), held=np.full(1, 1e-9))) is not None
    fmu.gain = 10.0
    assert measured.about(rest(fmu)) is None


def test_states_are_saved_and_put_back() -> None:
    measured = tangent(Line(3))
    responses(measured, 1)
    kept = measured.save()
    later = responses(measured, 4)
    measured.restore(kept)
    assert responses(measured, 4) == later
    assert np.any(np.array(later) != 0.0)


def test_smaller_pulses_have_the_states_of_larger_ones_and_no_more_than_asked_for() -> None:
    measured = tangent(Line(3))
    smaller = measured.with_pulse(0.25)
    assert (smaller.pulse, len(smaller.state)) == (0.25 * measured.pulse, 2)
    assert responses(smaller, 4) == pytest.approx(responses(measured, 4), abs=1e-8)
    assert len(Tangent(Excitation(rest(Line(3))), [Rung(1, 1.0)] * 8, 6, most=2).state) == 2  # of three


class Differentiating(Line):
    """A law whose derivative is large beside its integral."""

    def __init__(self) -> None:
        super().__init__(1)
        self.kept = np.zeros(3)  # the integral, the last input, and the output

    def step(self, t: float, h: float) -> None:
        held, before, _ = self.kept
        self.kept = np.array([held + 1e-4 * self.u, self.u, 120.0 * (self.u - before) + 2.0 * self.u + held])


def test_a_model_without_a_slow_integral_is_refused_by_the_response_to_a_held_input() -> None:
    ladder = [Rung(1, 1.0)] * 8
    with_integral, without = (Tangent(Excitation(rest(Differentiating())), ladder, 6, most=most) for most in (2, 1))
    with_integral.prove_held(1.0)
    with pytest.raises(UsageError, match=r"does not predict the response to u held over"):
        without.prove_held(1.0)


class Limited(Differentiating):
    """A law whose output has limits, about 0.7, which its integral reaches where the input is held."""

    limit = 0.003

    def __init__(self) -> None:
        super().__init__()
        self.kept = np.array([0.7, 0.0, 0.7])

    def step(self, t: float, h: float) -> None:
        held, _, _ = self.kept
        limited = float(np.clip(self.u + held, 0.7 - self.limit, 0.7 + self.limit))
        self.kept = np.array([held + 0.04 * self.u, self.u, limited])


def test_a_law_that_a_held_input_leads_to_its_limits_is_linear_about_rest() -> None:
    fmu = Limited()
    measured = tangent(fmu)
    assert responses(measured, 3) == pytest.approx([1.0, 0.04, 0.04])
    fmu.limit = 1e-9
    with pytest.raises(UsageError, match="where y stays the same, as at a limit"):
        measured.prove_held(1.0)


class Growing(Line):
    """A law with states that grow and, hidden behind them, ones that decay; `offset` is what its states rest at."""

    poles = np.array([-14.3, -12.7, 0.02, 0.5])

    def __init__(self, offset: float = 0.0) -> None:
        super().__init__(4)
        self.kept, self.offset = np.full(4, offset), offset

    def reader(self, names: Any, into: Floats) -> Transfer:
        def read() -> None:
            into[0] = sum(self.kept - self.offset)

        return read

    def step(self, t: float, h: float) -> None:
        self.kept = self.offset + self.poles * (self.kept - self.offset) + self.u


@pytest.mark.parametrize("factor", [1.0, 1.3, 5.0])
def test_poles_far_outside_the_unit_circle_hide_none_inside_it(factor: float) -> None:
    """Neither where the first pulses tried are linear for as long as larger ones."""
    fmu = Growing()
    fmu.poles = Growing.poles * [factor, factor, 1.0, 1.0]
    measured = tangent(fmu)
    found = np.linalg.eigvals(measured.derivatives(1.0)[0][1:])
    assert np.sort(found.real) == pytest.approx(fmu.poles, rel=1e-3)
    assert measured.accuracy < 1e-9


class Leaving(Growing):
    """A law that by itself grows from where it only nearly rests into its limit."""

    poles = np.array([-1.8, 0.3, 0.02, 0.5])

    def step(self, t: float, h: float) -> None:
        self.kept = np.clip(self.poles * self.kept + self.u, -1.0, 1.0)


@pytest.mark.parametrize(("away", "growth"), [(1e-11, -1.8), (1e-9, -3.0)])
def test_a_law_that_leaves_its_rest_for_its_limit_by_itself_has_one_rate_none_the_less(
    away: float, growth: float
) -> None:
    fmu = Leaving()
    fmu.poles = np.array([growth, *Leaving.poles[1:]])
    fmu.kept[0] = away
    begun = of_samples(rest(fmu), 1.0)
    assert begun.samples == 1
    poles = np.linalg.eigvals(of_one_rate(begun.tangent()).derivatives(1.0)[0][1:])
    assert poles[np.abs(poles) > 1.0] == pytest.approx([growth], rel=1e-6)


def test_a_law_that_leaves_before_its_samples_are_compared_is_refused_as_that() -> None:
    fmu = Leaving()
    fmu.poles, fmu.kept[0] = np.array([-20.0, *Leaving.poles[1:]]), 1e-3
    with pytest.raises(
        UsageError, match=r"line: grows by itself out of the range in which it is linear within 1 sample, so"
    ):
        of_samples(rest(fmu), 1.0)


class Observing(Line):
    """A state feedback of an observer that is fast, and unstable by itself; it rests away from 0."""

    A = np.array([[-6.1, 0.3, 0.0], [-60.0, 0.9, -0.06], [700.0, 0.3, 0.7]])
    B, C, held = np.array([7.0, 60.0, -700.0]), np.array([1000.0, 4000.0, 0.0]), 0.01

    def reader(self, names: Any, into: Floats) -> Transfer:
        def read() -> None:
            into[0] = 4.2 + self.C @ self.kept

        return read

    def step(self, t: float, h: float) -> None:
        self.kept = self.A @ self.kept + self.B * (self.u - self.held)


def test_a_law_that_is_fast_and_unstable_by_itself_is_followed_for_long_by_pulses_that_are_not_rounded() -> None:
    fmu = Observing(3)
    resting = dataclasses.replace(rest(fmu), held=np.array([fmu.held]))
    A = of_one_rate(of_samples(resting, 1.0).tangent()).derivatives(1.0)[0][1:]
    assert np.poly(A) == pytest.approx(np.poly(fmu.A), rel=1e-6)


def test_a_model_without_a_state_that_decays_beside_one_that_grows_is_refused() -> None:
    excitation = Excitation(rest(Growing()))
    excitation.pulse = 1e-20
    with pytest.raises(UsageError, match="of 2 states, does not predict the response to a random input"):
        Tangent(excitation, [Rung(1, 1.0)] * 8, 6, most=2).prove(1.0, 16.0)


def test_a_model_does_not_hold_where_a_state_that_growth_hides_decays_otherwise() -> None:
    fmu = Growing()
    at_rest, measured = fmu.save(), tangent(fmu)
    for changed in (False, True):
        fmu.restore(at_rest)
        fmu.poles = Growing.poles * [1.0, 1.0, 1.0, 0.9 if changed else 1.0]
        assert (measured.about(rest(fmu)) is None) == changed


def test_where_rounding_hides_what_a_growing_response_does_the_states_are_refused() -> None:
    with pytest.raises(UsageError, match=r"line: has .* states or more, .* which grows [\d.]+-fold in a step"):
        tangent(Growing(0.7))


class InSinglePrecision(Line):
    """Its sum with 9.81 is held in single precision."""

    held = np.float32(9.81)

    def step(self, t: float, h: float) -> None:
        first = self.held + np.float32(0.9) * np.float32(self.u)
        self.kept = np.concatenate([[float(first) - float(self.held)], 0.9 * self.kept[:-1]])


class Quantising(Line):
    """One whose input is that of a converter with steps of 0.005."""

    def step(self, t: float, h: float) -> None:
        self.kept = np.concatenate([[0.005 * round(self.u / 0.005)], 0.9 * self.kept[:-1]])


class Noisy(Line):
    """One whose output has three digits."""

    def step(self, t: float, h: float) -> None:
        super().step(t, h)
        self.kept[0] = 0.3 * round((0.01 * self.u + 0.15) / 0.3)


@pytest.mark.parametrize(
    ("fmu", "said"),
    [
        (Quantising(2), "follows a change of u by 0.01, but not by 1e-06"),
        (Noisy(2), "jump as u changes by"),
        (InSinglePrecision(2), r"as code in single precision.* expected double precision, floats as C with"),
    ],
)
def test_of_a_component_that_rounds_coarsely_nothing_is_told(fmu: Line, said: str) -> None:
    with pytest.raises(ImpreciseError, match=said):
        tangent(fmu)
