"""A sampled component of several rates, lifted: its samples up to where its response repeats are one step.

A counter of samples makes the response to an input differ from sample to sample, and repeat after a few. Taken together
these samples respond alike each time, with the inputs and outputs of each as signals of their own.
"""

from collections.abc import Sequence
from copy import copy
from typing import Any, cast

import numpy as np

from orchestration.components.fmi.instance import Instance
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.theory.stability.excitation import Rest
from orchestration.theory.stability.linear_simulator import LinearSimulator
from orchestration.theory.stability.linearised_component import Tangent

TAKE_SEVERAL = "limit, linearise, bode, step, locus or expect, which take several"


class LiftedInstance:
    """An instance that takes several samples at a step, each with inputs and outputs of its own."""

    def __init__(self, rest: Rest, samples: int) -> None:
        self.fmu = rest.fmu
        self._held: Floats = np.tile(rest.held, (samples, 1))
        self._outputs: Floats = np.zeros((samples, len(rest.outputs)))
        self._input, self._output = rest.held.copy(), self._outputs[0].copy()
        self._write, self._read = (
            rest.fmu.writer(rest.inputs, self._input),
            rest.fmu.reader(rest.outputs, self._output),
        )
        self._read()
        self._outputs[:] = self._output

    def __getattr__(self, name: str) -> Any:
        return getattr(self.fmu, name)

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As `Simulator`: of all inputs of all samples."""

        def transfer() -> None:
            self._held[:] = source.reshape(self._held.shape)

        return transfer

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """As `Simulator`: of all outputs of all samples."""

        def transfer() -> None:
            into[:] = self._outputs.ravel()

        return transfer

    def step(self, t: float, h: float) -> None:
        """As `Simulator`: the samples in turn, each as long as the others."""
        period = h / len(self._held)
        for k, (held, outputs) in enumerate(zip(self._held, self._outputs)):
            self._input[:] = held
            self._write()
            self.fmu.step(t + k * period, period)
            self._read()
            outputs[:] = self._output


def lifted_rest(rest: Rest, fmu: LiftedInstance, samples: int) -> Rest:
    """A component at rest as one of several samples; the signals of sample k end in [k]."""
    return Rest(
        fmu=cast(Instance, fmu), inputs=lifted_names(rest.inputs, samples), held=np.tile(rest.held, samples),
        outputs=lifted_names(rest.outputs, samples), time=rest.time,
    )  # fmt: skip


def lifted_names(names: Sequence[str], samples: int) -> tuple[str, ...]:
    """The names of signals at each of some samples, those of the first one before; of one sample the names alone."""
    return tuple(names) if samples == 1 else tuple(f"{name}[{k}]" for k in range(samples) for name in names)


def of_one_rate(tangent: "Tangent | LiftedTangent") -> Tangent:
    """The tangent of a component whose samples are alike; raises `UsageError` for one of several rates."""
    if isinstance(tangent, Tangent):
        return tangent
    raise several_rates(tangent.name, tangent.samples)


def several_rates(name: str, samples: int, *, expected: str = TAKE_SEVERAL) -> UsageError:
    """That a component responds alike only every some samples, where one rate is needed."""
    return UsageError(
        f"{name}: responds alike only at every {_nth(samples)} sample, as code of several rates does: expected an FMU, "
        f"and a component, for each rate, or {expected}"
    )


def _nth(number: int) -> str:
    return f"{number}{ {2: 'nd', 3: 'rd'}.get(number, 'th') }"


class LiftedTangent(LinearSimulator):
    """A component of several rates about rest: `whole` is linear over `samples` of them, beginning with sample 0."""

    def __init__(self, whole: Tangent, rest: Rest, fmu: LiftedInstance, samples: int) -> None:
        super().__init__(rest.inputs, rest.outputs, states=len(whole.state))
        self.whole, self.samples, self.name, self._fmu = whole, samples, rest.fmu.name, fmu
        self._given: Floats = np.zeros((samples, len(rest.inputs)))

    def step(self, t: float, h: float) -> None:
        """As `Simulator`: the next sample, whatever the time."""
        by_state, by_input = self.whole.derivatives(self.samples * h)
        self._given[self.sample] = self.input + self.added
        given, count = np.concatenate(self._given[: self.sample + 1]), len(self.outputs)
        rows = slice(self.sample * count, (self.sample + 1) * count)
        self.output[:] = by_state[rows] @ self.state + by_input[rows, : len(given)] @ given
        self.sample += 1
        if self.sample == self.samples:
            after = slice(self.samples * count, None)
            self.state[:], self.sample = by_state[after] @ self.state + by_input[after] @ given, 0

    def abreast(self, runs: int) -> "LiftedTangent":
        """As that of `LinearSimulator`."""
        other = super().abreast(runs)
        other._given = np.zeros((*self._given.shape[:2], runs))
        return other

    def about(self, rest: Rest) -> "LiftedTangent | None":
        """As that of `Tangent`."""
        if rest.fmu is not self._fmu.fmu:
            return None
        again = self.whole.about(lifted_rest(rest, self._fmu, self.samples))
        return None if again is None else LiftedTangent(again, rest, self._fmu, self.samples)

    def with_pulse(self, factor: float) -> "LiftedTangent":
        """As that of `Tangent`."""
        again = copy(self)
        again.whole = self.whole.with_pulse(factor)
        again.state = np.zeros(len(again.whole.state))
        return again
