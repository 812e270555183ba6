"""A component about rest as matrices, from the derivatives of its FMU."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, nanoseconds
from orchestration.foundation.processes.passable import passable
from orchestration.theory.stability.lifted_component import LiftedTangent, lifted_names
from orchestration.theory.stability.linearised_component import Tangent

NEAR, FAR = 0.1, 0.5
"""Norms of Φ(h) - I between which its logarithm is most accurate"""
HALVINGS = 40
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
"""the least rational share of all"""
TURNED = 0.2
"""Difference of logarithms over a step and over that share of it, from which a state turns about within the step"""
INEXACT = 1e-7
"""Difference of Φ(2h) to Φ(h)² allowed, both by small differences; beyond it the component is no linear system in
continuous time"""
NO_FEEDTHROUGH = 1e-6
"""Share of the largest response of an output to an input in a step: smaller feedthrough is taken for rounding"""
NEGLIGIBLE = 1e-12
"""Share of the state between samples of several rates that counts as rounding"""
TERMS = 24
OF_FIXED_STEP = "a law with a parameter for its period in place of the step"
"""Law expected where samples must not depend on the time to the next one"""
INDEPENDENT = (0.1, 1e-3, 1e-5, 1e-8)
"""relative part of a coordinate outside of the span of those before it, at least; tried in turn"""


Derivatives = Callable[[float], tuple[Floats, Floats]]
"""Function of a step length [s] to the derivatives of the outputs and, below, the state after it, by the state before
and by the inputs"""


@passable
@dataclass(frozen=True, kw_only=True)
class Matrices:
    """A linear system, by the names of its inputs and outputs."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: Floats
    B: Floats
    C: Floats
    D: Floats


@passable
@dataclass(frozen=True, kw_only=True)
class Continuous(Matrices):
    """A component in continuous time: ẋ = A x + B u, y = C x + D u."""

    step: Derivatives | None = None
    """the step of the simulated component, where that differs from the matrices"""
    misfit: float = 0.0
    """Difference of the state after a step of 2 h to that after two of h, relative"""
    length: float = 0.0
    """Length of the step of whose derivatives they are the logarithm [s]"""
    unfit: str | None = None
    """why the matrices do not describe the component; None: they do"""


@passable
@dataclass(frozen=True, kw_only=True)
class SampledSystem(Matrices):
    """A sampled component: at each sample y = C x + D u, and then x becomes A x + B u."""

    later: tuple[Matrices, ...] = ()
    """Matrices of the samples that follow, of a component of several rates; then they repeat"""
    depends_on_step: bool = False
    """whether a sample depends on the time to the next one"""

    @property
    def turns(self) -> tuple[Matrices, ...]:
        """The matrices of its samples, in turn."""
        return Matrices(**{each.name: getattr(self, each.name) for each in fields(Matrices)}), *self.later

    def turned(self, by: int) -> SampledSystem:
        """The same, begun some samples later, or earlier."""
        first, *later = (self.turns[(k + by) % len(self.turns)] for k in range(len(self.turns)))
        return SampledSystem(**vars(first), later=tuple(later), depends_on_step=self.depends_on_step)


M = TypeVar("M", bound=Matrices)
Components = dict[str, Continuous | SampledSystem]


def of_samples(tangent: Tangent, period: float) -> Matrices:
    """The matrices of a component that is sampled every `period` [s]."""
    by_state, by_input = tangent.derivatives(period)
    count = len(tangent.outputs)
    return Matrices(
        inputs=tangent.inputs, outputs=tangent.outputs,
        A=by_state[count:], B=by_input[count:], C=by_state[:count], D=by_input[:count],
    )  # fmt: skip


def of_lifted(tangent: Tangent | LiftedTangent, period: float, samples: int) -> Matrices:
    """The matrices over several samples, a `period` [s] apart: by the inputs at each, the outputs at each."""
    whole, own = (tangent.whole, tangent.samples) if isinstance(tangent, LiftedTangent) else (tangent, 1)
    one, steps = of_samples(whole, own * period), samples // own
    if steps == 1:
        return one
    A, (p, m) = one.A, one.D.shape
    powers = [np.eye(len(A))]
    for _ in range(steps):
        powers.append(powers[-1] @ A)
    D = np.zeros((steps * p, steps * m))
    for k in range(steps):
        for j in range(k + 1):
            block = one.D if j == k else one.C @ powers[k - j - 1] @ one.B
            D[k * p : (k + 1) * p, j * m : (j + 1) * m] = block
    return Matrices(
        inputs=lifted_names(tangent.inputs, samples), outputs=lifted_names(tangent.outputs, samples), A=powers[steps],
        B=np.hstack([powers[steps - 1 - k] @ one.B for k in range(steps)]),
        C=np.vstack([one.C @ powers[k] for k in range(steps)]), D=D,
    )  # fmt: skip


def turns_of(tangent: Tangent | LiftedTangent, period: float) -> list[Matrices]:
    """The matrices of a component sampled every `period` [s], at each sample until it responds as before.

    Between two samples the state is what the outputs and the state to come depend on, of the state before all of them
    and the inputs since; it is filled up with zeros to one size.
    """
    samples = 1 if isinstance(tangent, Tangent) else tangent.samples
    whole = of_lifted(tangent, period, samples)
    n, p, m = len(whole.A), len(whole.C) // samples, whole.D.shape[1] // samples
    onto, back = [np.eye(n)], [np.eye(n)]
    for k in range(1, samples):
        ahead = np.block([[whole.C[k * p :], whole.D[k * p :, : k * m]], [whole.A, whole.B[:, : k * m]]])
        columns = np.linalg.norm(ahead, axis=0)
        columns[columns == 0.0] = 1.0
        rows = np.linalg.norm(ahead / columns, axis=1, keepdims=True)
        rows[rows == 0.0] = 1.0
        _, values, right = np.linalg.svd(ahead / columns / rows, full_matrices=False)
        right = right[values > NEGLIGIBLE * values.max(initial=0.0)]
        onto.append(right * columns)
        back.append(right.T / columns[:, None])
    size = max(map(len, onto))
    found = []
    for k in range(samples):
        row, given = slice(k * p, (k + 1) * p), slice(k * m, (k + 1) * m)
        y = np.hstack([whole.C[row], whole.D[row, : k * m]]) @ back[k], whole.D[row, given]
        if k + 1 < samples:
            then = onto[k + 1][:, : n + k * m] @ back[k], onto[k + 1][:, n + k * m :]
        else:
            then = np.hstack([whole.A, whole.B[:, : k * m]]) @ back[k], whole.B[:, given]
        A, B, C = np.zeros((size, size)), np.zeros((size, m)), np.zeros((p, size))
        A[: len(then[0]), : then[0].shape[1]], B[: len(then[1])], C[:, : y[0].shape[1]] = *then, y[0]
        found.append(Matrices(inputs=tangent.inputs, outputs=tangent.outputs, A=A, B=B, C=C, D=y[1]))
    return found


def in_continuous_time(
    tangent: Tangent, first: float, differs: float = INEXACT, own: float | None = None, most: float = INEXACT
) -> Continuous:
    """The matrices of a component in continuous time.

    `first` is a step [s] that it takes. Where two steps differ from one of twice the length by more than `differs`,
    relative, shorter ones are tried down to its `own`, with which it is simulated; default: `first`. The matrices are
    unfit where these differ by more than `most`, too.
    """
    h = first if tangent.unit is not None else _informative_step(tangent, first)
    shortest = first if own is None else min(own, first)
    while (differs_by := misfit(tangent, h)) > differs and h > shortest:
        h = max(whole_nanoseconds(0.5 * h), shortest)
    unfit = f"a step of {2 * h:g} s differs from two of {h:g} s by {differs_by:.1g}" if differs_by > most else None
    return replace(continuous(tangent, tangent.derivatives(h), h, unfit), misfit=differs_by)


def continuous(tangent: Tangent, derivatives: tuple[Floats, Floats], h: float, unfit: str | None = None) -> Continuous:
    """The matrices of a component in continuous time, by the derivatives of its step of `h` [s]."""
    count, (by_state, by_input) = len(tangent.outputs), derivatives
    state, moved = by_state[count:], by_input[count:]
    change = state - np.eye(len(state))
    if len(change) and np.linalg.norm(change, 2) > 2.0 * FAR:
        unfit = f"a step of {h:g} s is too long to show what happens within it"
        A, B, C, D = np.zeros_like(change), np.zeros_like(moved), by_state[:count], by_input[:count]
    else:
        A = _logarithm(change) / h
        B = np.asarray(np.linalg.solve(_mean_exponential(A * h), moved)) / h
        C = by_state[:count] @ np.linalg.inv(state)
        D = _feedthrough(by_input[:count], C, moved)
    return Continuous(inputs=tangent.inputs, outputs=tangent.outputs, A=A, B=B, C=C, D=D, length=h, unfit=unfit)


def misfit(tangent: Tangent, h: float) -> float:
    """By how much the state after a step of 2 `h` [s] differs from that after two of `h`, relative."""
    once, twice = (tangent.derivatives(step)[0][len(tangent.outputs) :] for step in (h, 2.0 * h))
    return float(np.abs(twice - once @ once).max(initial=0.0)) / max(1.0, float(np.abs(twice).max(initial=0.0)))


def depends_on_step(tangent: Tangent, period: float) -> bool:
    """Whether a sample depends on the time to the next one."""
    usual, sooner = (np.hstack(tangent.derivatives(h)) for h in (period, 0.9 * period))
    return bool(np.abs(usual - sooner).max(initial=0.0) > INEXACT * np.abs(usual).max(initial=1.0))


def in_output_coordinates(of: M, after: Floats) -> M:
    """In coordinates that are outputs, now or, by `after`, periods later with inputs at rest: the first independent."""
    rows, power = [], np.eye(len(of.A))
    for _ in range(max(len(of.A), 1)):
        rows += list(of.C @ power)
        power = after @ power
    chosen, span = list[Floats](), np.zeros((0, len(of.A)))
    for ratio in INDEPENDENT:
        for row in rows:
            size = float(np.linalg.norm(row))
            beyond = row - (row @ span.T) @ span
            beyond -= (beyond @ span.T) @ span
            norm = float(np.linalg.norm(beyond))
            if len(chosen) < len(of.A) and norm > ratio * size > 0.0:
                chosen.append(row)
                span = np.vstack([span, beyond / norm])
    if len(chosen) < len(of.A):
        return of
    onto = np.array(chosen).reshape(len(of.A), len(of.A))
    back = np.linalg.inv(onto) if len(onto) else onto
    return replace(of, A=onto @ of.A @ back, B=onto @ of.B, C=of.C @ back)


def _feedthrough(whole: Floats, C: Floats, moved: Floats) -> Floats:
    """The direct feedthrough: responses less what comes by the states; 0 where it may be rounding."""
    found: Floats = whole - C @ moved
    terms = np.maximum(np.abs(whole), np.abs(C) @ np.abs(moved))  # they may cancel
    found[np.abs(found) <= NO_FEEDTHROUGH * terms.max(axis=1, keepdims=True, initial=0.0)] = 0.0
    return found


def _informative_step(tangent: Tangent, first: float) -> float:
    """A step over which the state changes neither too little nor too much."""
    count, h = len(tangent.outputs), first
    for _ in range(HALVINGS):
        by_state = tangent.derivatives(h)[0][count:]
        size = float(np.linalg.norm(by_state - np.eye(len(by_state)), 2)) if len(by_state) else NEAR
        if size > FAR and nanoseconds(h) >= 2:
            h = whole_nanoseconds(0.5 * h)
        elif size < NEAR and h < 64.0 * first:
            h = 2.0 * h
        elif _turns_within(tangent, h):
            first = h = whole_nanoseconds(GOLDEN * h)
        else:
            break
    return h


def _turns_within(tangent: Tangent, h: float) -> bool:
    """Whether a state turns about within a step and is nearly back at its end: over a part of it, it is elsewhere."""
    rates, count = list[Floats](), len(tangent.outputs)
    for step in (h, whole_nanoseconds(GOLDEN * h)):
        after = tangent.derivatives(step)[0][count:]
        change = after - np.eye(len(after))
        if len(change) and np.linalg.norm(change, 2) > 2.0 * FAR:
            return step < h
        rates.append(_logarithm(change) / step)
    return bool(np.abs(rates[0] - rates[1]).max(initial=0.0) * h > TURNED)


def whole_nanoseconds(seconds: float) -> float:
    """A time rounded to whole nanoseconds [s], as for derivatives."""
    return max(1, nanoseconds(seconds)) / NANOSECONDS


def _logarithm(change: Floats) -> Floats:
    """The logarithm of I + change, by the series of the inverse hyperbolic tangent."""
    if not len(change):
        return change
    x = np.linalg.solve(2.0 * np.eye(len(change)) + change, change)
    square, power = x @ x, x
    found: Floats = np.zeros_like(x)
    for k in range(TERMS):
        found = found + power / (2 * k + 1)
        power = power @ square
    return 2.0 * found


def _mean_exponential(A: Floats) -> Floats:
    """(e^A - I) A⁻¹, by its series."""
    found, term = np.eye(len(A)), np.eye(len(A))
    for k in range(1, TERMS + 1):
        term = term @ A / (k + 1)
        found = found + term
    return found
