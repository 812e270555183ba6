"""The tangent of a component about rest: by pulses of the right size, over the right times."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import counted
from orchestration.theory.stability.excitation import COARSE, FINER, MAX_PULSE, Excitation, Rest, Rung
from orchestration.theory.stability.lifted_component import LiftedInstance, LiftedTangent, lifted_rest
from orchestration.theory.stability.linearised_component import EXACT, Tangent
from orchestration.theory.stability.matrices import GOLDEN, misfit

HORIZON, LONGER_BY, LAST_HORIZON = 16.0, 8.0, 1024.0
"""Length of the first ladder, in periods, factor from one to the next, and length of the last: longer ones are tried
while they show more states, as a fast loop leaves slow states no time, or do not foretell the longest period"""
FINEST = 0.25
"""First rung of a ladder in continuous time, in periods, at most"""
MIN_RUNGS, MAX_RUNGS = 8, 20
"""Rungs of a ladder in continuous time, each time about twice the one before"""
SPAN = 32.0
"""Length of a ladder, in first rungs, at least"""
PROBES = 40
"""Points of time at which it is seen how long a response is linear"""
LONGEST_STEP = 64.0
"""Steps that make a ladder, in periods, at most"""
SAMPLES = 32
"""Samples of the ladder of a sampled component"""
LONGER = 4
"""Factor on it where it does not show a slow state precisely"""
LARGER = 1.0 / FINER
"""Factor on it where the error is larger"""
FEW = 4
"""Samples over which it is seen whether a sampled component rounds coarsely"""
SHRUNK = (1.0, 0.125, 0.015625)
"""Factors on the pulses, tried in turn"""
FEWEST = 6
"""Samples at which its states are produced at least"""
TURN = 1e-3
"""Difference of the responses to a pulse on all inputs at two samples, up to which they are alike"""
MOST_SAMPLES = 20
"""Samples after which the response of a component of several rates repeats, at most"""
FEWEST_LIFTED = 8
"""Rungs of the ladder of such a component, at least, each of all its samples"""


@dataclass(frozen=True, kw_only=True)
class SampledRest:
    """A sampled component at rest, with its pulses chosen, before its tangent is measured."""

    rest: Rest
    period: float
    """Interval from sample to sample [s]"""
    excitation: Excitation
    count: int
    """Samples over which it is linear"""
    samples: int
    """Samples after which its response to a pulse repeats: more than 1 of a component of several rates"""

    def tangent(self) -> Tangent | LiftedTangent:
        """Its tangent; of several rates that of its samples together.

        Its pulses are chosen with each input moved over all of these samples, as one alone may pass its tasks by.
        Raises `UsageError` as `Tangent`.
        """
        samples, rest = self.samples, self.rest
        if samples == 1:
            return _tangent(self.excitation, Rung(1, self.period), self.count)
        rest.fmu.restore(self.excitation.rest.saved)
        excitation = Excitation(rest)
        rungs = max(FEWEST_LIFTED, SAMPLES // samples)
        count = _choose_pulse(excitation, [Rung(samples, self.period)] * (2 * rungs))
        rest.fmu.restore(excitation.rest.saved)
        fmu = LiftedInstance(rest, samples)
        lifted = Excitation(lifted_rest(rest, fmu, samples))
        lifted.pulse = excitation.pulse
        return LiftedTangent(_tangent(lifted, Rung(1, samples * self.period), count, samples), rest, fmu, samples)


def of_samples(rest: Rest, period: float) -> SampledRest:
    """A component that is sampled every `period` [s].

    Raises `UsageError` where its response differs from sample to sample, and does not repeat.
    """
    excitation, sample = Excitation(rest), Rung(1, period)
    count = _choose_pulse(excitation, [sample] * (2 * SAMPLES))
    samples = _samples_until_alike(excitation, sample, count)
    return SampledRest(rest=rest, period=period, excitation=excitation, count=count, samples=samples)


def _choose_pulse(excitation: Excitation, rungs: Sequence[Rung]) -> int:
    """Choose the pulse; the rungs over which it is linear. Raises `ImpreciseError` for what rounds coarsely."""
    count = excitation.choose_pulse(rungs)
    excitation.expect_fine(rungs[:FEW])
    return count


def _tangent(excitation: Excitation, sample: Rung, count: int, samples: int = 1) -> Tangent:
    """The tangent of a component whose samples, or groups of several, are alike, and linear over `count` of them."""
    ins, outs = len(excitation.inputs), len(excitation.outputs)
    # As many states are seen in the futures as are produced: where it is linear over a few samples, none is left over.
    points = max(1, count // 2 if count >= 2 * FEWEST else round(count * outs / max(1, ins + outs)))
    ladder = [sample] * max(1, count - points)

    def proved(excitation: Excitation) -> Tangent:
        tangent = Tangent(excitation, ladder, max(FEWEST, _dead_samples(excitation, ladder) + 2), points=points)
        tangent.prove(sample.h, 2.0 * len(ladder) * sample.h)
        return tangent

    found, refused = list[Tangent](), list[UsageError]()
    for factor in SHRUNK:  # all inputs at once may lead where the component saturates
        smaller = copy(excitation)
        smaller.pulse = factor * excitation.pulse
        try:
            found.append(proved(smaller))
            if found[-1].accuracy <= COARSE:
                break
        except UsageError as error:
            refused.append(error)
    if not found:
        raise refused[0]
    best = min(found, key=lambda one: one.accuracy)
    try:
        best.prove_held(sample.h, samples)
    except UsageError:  # away from zero outputs are rounded: over a longer time a slow integral stands out
        longer = copy(excitation)
        if (
            samples > 1
            or len(ladder) > SAMPLES
            or (more := _choose_pulse(longer, [sample] * (LONGER * count))) <= count
        ):
            raise
        return _tangent(longer, sample, more)
    return best


def in_continuous_time(
    rest: Rest, period: float, step: float, *, until: float = 0.0, unit: float | None = None
) -> Tangent:
    """The tangent of a component in a loop whose shortest period is `period`, its own step `step` [s].

    It foretells responses `until` the longest period. Where it only takes steps of one length, that is its `unit`.
    Else as `of_samples`.
    """
    excitation = Excitation(rest)
    longest = step if unit is not None else excitation.longest_step(step, LONGEST_STEP * period)
    for rung in _rungs(np.array([HORIZON * period]), longest, unit):
        _, excitation.later = excitation.followed(excitation.later, rung)
    first, found, linear_until = min(FINEST * period, step), None, -1.0
    second, end = LONGER_BY * HORIZON * period, HORIZON * period
    while True:
        if linear_until < 0.0 or end > second:  # the pulse for the second length does for the first
            probes = _rungs(np.geomspace(first, 2.0 * max(end, second), PROBES), longest, unit)
            linear = probes[: excitation.choose_pulse(probes)]
            linear_until = 0.5 * sum(rung.duration for rung in linear) if len(linear) < len(probes) else np.inf
        ladder = _rungs(_points(first, min(end, linear_until)), longest, unit)
        tangent, before = Tangent(copy(excitation), ladder, len(ladder), unit=unit), found
        found = tangent if before is None or len(tangent.state) >= len(before.state) else before
        is_complete = before is not None and len(tangent.state) <= len(before.state)
        if end >= linear_until or (is_complete and (end >= until or found.foretells(until, longest))):
            break
        if LONGER_BY * end > LAST_HORIZON * max(period, until):
            break
        end *= LONGER_BY
    _prove(found, step)
    return _above_rounding(found, step)


def _above_rounding(found: Tangent, step: float) -> Tangent:
    """A tangent by larger pulses, as long as these show the same states more accurately.

    The pulse that is linear for longest may be so small that rounding spoils states which hardly move the outputs.
    """
    error = _error(found, step)
    while error > EXACT and LARGER * found.pulse <= MAX_PULSE:
        try:
            larger = found.with_pulse(LARGER)
            _prove(larger, step)
        except UsageError:
            break
        after = _error(larger, step)
        if len(larger.state) < len(found.state) or after >= error:
            break
        found, error = larger, after
    return found


def _error(tangent: Tangent, step: float) -> float:
    """Its largest known error: a misfit that is small by chance leaves the one expected of its measurement."""
    return max(tangent.accuracy, tangent.rounding, misfit(tangent, step))


def _prove(tangent: Tangent, step: float) -> None:
    tangent.prove(step, 2.0 * sum(rung.duration for rung in tangent.ladder))


def _points(first: float, end: float) -> Floats:
    """Times [s] of the points of a ladder, each about twice the one before."""
    if not end:
        return np.array([first])
    first = min(first, end / SPAN)
    return np.geomspace(first, end, int(np.clip(np.ceil(np.log2(end / first)) + 1, MIN_RUNGS, MAX_RUNGS)))


def _rungs(times: Floats, longest: float, unit: float | None) -> list[Rung]:
    """Rungs that end at these times [s], of steps no longer than `longest`; where there is a `unit`, of that one."""
    if unit is not None:
        ends = np.unique([0, *(max(1, round(time / unit)) for time in times)])
        return [Rung(int(count), unit) for count in np.diff(ends)]
    lengths = np.diff(times, prepend=0.0)
    counts = [max(1, int(np.ceil(length / longest - 1e-6))) for length in lengths]
    return [Rung(count, float(length) / count) for count, length in zip(counts, lengths)]


def _samples_until_alike(excitation: Excitation, sample: Rung, count: int) -> int:
    """After how many samples the response to a pulse repeats: more than 1 of a component of several rates.

    Raises `UsageError` where it does not repeat within `MOST_SAMPLES`.
    """
    rest, responses, rungs, compared = excitation.rest, list[Floats](), MOST_SAMPLES + 1, 2 * MOST_SAMPLES
    at_rest = excitation.outputs_after(rest, [sample] * (rungs + compared))
    left = excitation.left(at_rest)
    if FEW + 1 < left < len(at_rest):  # what grows from where it only nearly rests may come to a limit
        rungs = min(rungs, max(FEW, min(count, left // 2)))
        compared = min(compared, left - rungs)
    shares = 1.0 / (1.0 + (GOLDEN * np.arange(len(excitation.held))) % 1.0)  # no two inputs cancel, as their difference
    pulsed = excitation.held + shares * excitation.pulses
    for k in range(compared):
        legs = [(pulsed, sample), *((excitation.held, sample) for _ in range(rungs - 1))]
        responses.append((excitation.course(rest, legs) - at_rest[k : k + rungs]) / excitation.pulse)
        _, rest = excitation.followed(rest, sample)
    allowed = TURN * max(float(np.abs(each).max(initial=1.0)) for each in responses)
    for samples in range(1, compared // 2 + 1):
        apart = (np.abs(a - b).max(initial=0.0) for a, b in zip(responses, responses[samples:]))
        if max(apart) <= allowed:
            return samples
    if left < len(at_rest):
        raise UsageError(
            f"{excitation.name}: grows by itself out of the range in which it is linear within "
            f"{counted(left + 1, 'sample')}, so it is not seen whether its responses to a pulse are "
            "alike at each: expected a law that grows more slowly"
        )
    raise UsageError(
        f"{excitation.name}: responds to a pulse differently from sample to sample, and not alike again within "
        f"{MOST_SAMPLES} samples, as code whose slowest task has a longer period"
    )


def _dead_samples(excitation: Excitation, ladder: Sequence[Rung]) -> int:
    """The samples before the last of the inputs is responded to, as far as there is a response."""
    dead = [0]
    for i in range(len(excitation.inputs)):
        responds = (excitation.followed_response(i, ladder) != 0.0).any(axis=1)
        dead.append(int(np.argmax(responds)) if responds.any() else 0)
    return max(dead)
