"""How far a quantity of a loop may vary from draw to draw: certified, breaking, and by the small-gain bound."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmu_kit.new_files import write_atomically
from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError, told_apart
from orchestration.foundation.basics.extras import needs
from orchestration.foundation.basics.terminal import Share, ShareProgress, share_reporter
from orchestration.foundation.basics.times import NANOSECONDS, floor_to_nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity, time_text
from orchestration.simulation.requests.ranges import paths_in
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.workers.choice import single_run_execution
from orchestration.systems.system.connection import variable_of
from orchestration.systems.system.distribution import highest, lowest
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import value_at
from orchestration.systems.system.placement import messages_by_connection, tasks_of
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of
from orchestration.theory.certificates.breaking import (
    LONGEST_SEQUENCE,
    MOST_ARRIVALS,
    BreakingSequence,
    breaking_at,
    breaking_losses,
    least_breaking,
)
from orchestration.theory.certificates.causes import Cause, ScheduledLoop, cause_at
from orchestration.theory.certificates.certified_loop import DELAY, JITTER, LOSS, CertifiedLoop, Varying, certified_loop
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.repeated import NOT_SEARCHED, least_repeated
from orchestration.theory.certificates.timeline import LoopTimeline
from orchestration.theory.stability.delay_bounds import SampledLoop, certain_jitter
from orchestration.theory.stability.in_double import are_in_double, of_code
from orchestration.theory.stability.known_loops import rested, warned_of_timing
from orchestration.theory.stability.loop_at_rest import at_rest
from orchestration.theory.stability.operating_point import inform_of_chance
from orchestration.theory.stability.scheduled import without_scheduler

MOST_LOST, MOST_LOST_GIVEN = 8, 16
"""Losses in a row that are considered, and that may be requested: sequences double with each"""
ELSEWHERE = "a margin --of each has it alone, expect includes them in mean square"
"""Commands that include chance which a margin leaves out"""
MOST_STATES = 40
"""states that act on one another for which a proof is sought"""
_OPEN_AT_ONCE = "beyond, two draws would be open at once"
SHARES = (0.95, 0.97, 0.98, 0.99, 1.0)
"""Shares of the breaking or the largest value: tried for a certificate, upward; below the first by bisection"""
FINEST = 0.02
"""Tolerance of the bisection, as a share of the breaking value"""


@dataclass(frozen=True, kw_only=True)
class Certified:
    """How far a quantity may vary; times in seconds, losses as the longest run of them."""

    of: str
    """The path of the varying quantity: each draw is anywhere from 0 to the value."""
    certified: float | None = None
    """The largest value for which a proof was found that no sequence makes the loop unstable; None: the loop is
    unstable even for 0, or on its computer no proof was found for 0."""
    breaking: float | None = None
    """The least value at which a periodic sequence was found that makes it unstable; None: none was found."""
    breaking_sequence: tuple[tuple[str, tuple[float, ...]], ...] = ()
    """Sequence that breaks the loop: the letter of each draw with its values, repeated."""
    small_gain: float | None = None
    """The small-gain bound of Kao and Lincoln; None where it does not apply."""
    largest: float
    """The largest value that was considered."""
    own: float | None = None
    """The largest value of the system's own file [s]; None for losses."""
    beyond: str = ""
    """Why it is the largest; empty: it is `last`."""
    not_sought: str = ""
    """Why no proof was sought; empty: one was."""
    unproved: float | None = None
    """Least value for which a proof was sought, and none was found; None: each had one."""
    refused: str = ""
    """Why proofs were sought no further, of a cause; empty: `largest` or `breaking` is the end."""
    searched: str
    """Sequences that were tried for `breaking`, as text."""
    states: int
    """The size of the state from period to period."""
    certificate: str | None = None
    """The proof, as the text of a file that `check` verifies."""
    in_double: tuple[str, ...] = ()
    """The components whose float code in C is taken in double precision."""

    @property
    def verdict(self) -> str:
        """How far a quantity may vary with the loop proved stable, and what is known to break it."""

        def shown(value: float, text: Callable[[float], str] = time_text) -> str:
            return f"{value:g} in a row" if self.of.endswith("loss") else text(value)

        def rounded(value: float) -> str:
            return shown(value, lambda value: quantity(value, "s"))

        if self.breaking == 0.0:
            return f"unstable even without variation of {self.of}"
        proved = f"no proof sought: {self.not_sought}" if self.not_sought else "no proof found"
        if self.certified is not None:
            proved = f"every sequence up to {shown(self.certified)} is stable"
            if self.own is not None and self.certified < self.own:
                proved += f", less than the file's {shown(self.own)}, for which nothing is proved"
                if self.breaking is None or self.own < self.breaking:
                    proved += " (no sign that it is unstable)"
            if self.unproved is not None:
                proved += f"; no proof was found for {shown(self.unproved)}"
            elif self.refused:
                proved += f" (beyond, no proof is sought: {self.refused})"
        beyond = f" ({self.beyond})" if self.beyond else ""
        broken = f"none found up to {shown(self.largest)}, the most that is tried{beyond}, that breaks the loop"
        if self.searched == NOT_SEARCHED:
            broken = "none sought that breaks the loop"
        if self.breaking is not None:
            broken = f"one of {rounded(self.breaking)} breaks the loop"
        best = ""
        if self.small_gain is not None and self.small_gain > (self.certified or 0.0):
            best = f"up to {rounded(self.small_gain)} is stable by the small-gain bound, without a certificate; "
        return f"{self.of}: {best}{proved}, {broken} (small deviations{of_code(self.in_double)})"

    def __post_init__(self) -> None:
        """Raise `RuntimeError` for what cannot be: a value that is proved to be stable, and breaks the loop."""
        if self.certified is not None and self.breaking is not None and self.breaking < self.certified:
            raise RuntimeError(f"{self.of}: {self.certified} is certified, but {self.breaking} breaks the loop")

    def save(self, path: str | Path) -> Path:
        """Write the certificate; raises `UsageError` where there is none."""
        if self.certificate is None:
            raise UsageError("there is no certificate to write")
        write_atomically(Path(path), self.certificate)
        return Path(path)


@needs("flint", "clarabel")
def margin(request: RequestLike, of: str, *, last: float | None = None, progress: ShareProgress = None) -> Certified:
    """How far a quantity of a system may vary from draw to draw, the loop linearised about its operating point.

    `of` is the path of a sampled component's `sampling.jitter`, of a connection's `delay_jitter`, or of its `loss`,
    which means the longest run of messages lost in a row; all else is without jitter. Of a system with computers or
    networks it is that of a task's `execution`, or of the `jitter` of a task or message; the others, and samples by
    clocks of components, vary as the file allows. Values up to `last` are considered; by default 8 losses, and times as
    long as no two draws are open at once.
    The result is about the linear loop, not about large errors.

    Raises `UsageError` where the loop has no linear form or the path is unsupported, saying why.
    """
    request = request_of(request)
    cause = cause_in(request, of)
    if cause is not None:
        if last is not None:
            raise UsageError(
                f"--to {last:g}: expected none for {of}, of which all values that have a proof are considered"
            )
        with share_reporter(progress, "certifying", steady=False) as report:
            return _of_cause(request, cause, report)
    varying = varying_of(request, of)
    if varying.kind == LOSS and system_of(request).uses_scheduler:
        raise UsageError(
            f"--of {of}: losses have a proof without computers and networks; expected limit --of {of}, which flies them"
        )
    expect_without_scheduler(request)
    most = MOST_LOST if last is None else last
    if varying.kind == LOSS and most not in range(1, MOST_LOST_GIVEN + 1):
        raise UsageError(f"--to {most:g}: expected a number of losses in a row, from 1 to {MOST_LOST_GIVEN}")
    inform_of_chance(system_of(request), but=[varying.path], includes=ELSEWHERE)
    loop = linear_loop_of(request)
    timeline = LoopTimeline(loop, [varying])
    with share_reporter(progress, "certifying", steady=False) as report:
        if varying.kind == LOSS:
            beyond = "--to tries more" if last is None else ""
            found = replace(_of_losses(timeline, varying, int(most), report), beyond=beyond)
        else:
            found = _of_times(timeline, varying, last, report)
    own = None if varying.kind == LOSS else highest_at(system_of(request), varying.path)
    return replace(found, own=own, in_double=are_in_double(loop.system.components))


def highest_at(system: System, path: str) -> float:
    """The largest value of the time at a path [s]."""
    return float(highest(value_at(system, path) or 0.0))


def linear_loop_of(request: Request) -> CertifiedLoop:
    """The loop of a request about its operating point, from its FMUs, without computers and networks."""
    loaded, _ = single_run_execution(request, "auto")
    files = files_of(system := system_of(loaded))
    with warned_of_timing(system, files):
        return isolated_call(files.fmus.values(), _linear_loop_of, loaded)


def _linear_loop_of(request: Request) -> CertifiedLoop:
    with (
        errors_in_own_terms(request), closing(Instances()) as instances,
        at_rest(without_scheduler(rested(request)), instances) as rest,
    ):  # fmt: skip
        return certified_loop(rest)


def expect_without_scheduler(request: Request) -> None:
    """Raise `UsageError` for a system with a scheduler, naming the paths to use instead."""
    system = system_of(request)
    for name, task in tasks_of(system).items():
        raise UsageError(
            f"{task.place}: a scheduler decides when {name} samples; expected --of {task.place}.execution, as a cause"
        )
    for name, message in messages_by_connection(system).items():
        raise UsageError(f"{message.place}: {name} waits for other frames; expected --of the jitter of one, as a cause")


def cause_in(request: Request, of: str) -> Cause | None:
    """The cause at a path of a computer or a network; None: it is of neither."""
    (path, *others) = paths_in(request, of) or (of,)
    return None if others else cause_at(system_of(request), path)


def varying_of(request: Request, of: str) -> Varying:
    """The varying quantity at a path; raises `UsageError` for an unsupported path."""
    found = paths_in(request, of)
    for path in found[:1] if len(found) == 1 else ():
        table, _, rest = path.partition(".")
        name, _, key = rest.rpartition(".")
        if table == "connections" and key in (DELAY, LOSS):
            return Varying(kind=key, name=name, path=path)
        if table == "components" and key == JITTER:
            return Varying(kind=key, name=name.removesuffix(".sampling"), path=path)
    if of.endswith(".delay"):
        raise UsageError(
            f"--of {of}: expected a quantity that varies, as {of}_jitter; bode has the margin of a constant delay"
        )
    raise UsageError(
        f"--of {of}: expected connections.NAME.delay_jitter, connections.NAME.loss, components.NAME.sampling.jitter, "
        "computers.NAME.tasks.NAME.execution or jitter, or networks.NAME.messages.NAME.jitter"
    )


def not_sought_for(family: LoopFamily) -> str:
    """Why no proof is sought for a loop that is too large; empty for others."""
    from orchestration.theory.certificates.find_certificate import parts_of

    largest = max(map(len, parts_of(family)))
    return (
        "" if largest <= MOST_STATES
        else f"{largest} states act on one another, messages on their way included, of at most {MOST_STATES}"
    )  # fmt: skip


def _of_times(timeline: LoopTimeline, varying: Varying, last: float | None, progress: Share) -> Certified:
    tried = 0

    def up_to(value: float) -> LoopFamily:
        nonlocal tried
        tried += 1
        progress(0.5 * (1.0 - 0.95**tried))
        return timeline.family([value])

    possible = floor_to_nanoseconds(timeline.largest())
    largest = possible if last is None else floor_to_nanoseconds(last)
    if last is not None and not 0.0 < last <= possible:
        given, allowed = told_apart(last, possible)
        raise UsageError(f"--to {given}: expected above 0, and at most {allowed} s; {_OPEN_AT_ONCE}")
    beyond = _OPEN_AT_ONCE if largest == possible else ""
    searched = (
        f"draws at either end of each range, sequences that repeat after at most {LONGEST_SEQUENCE}, "
        f"values up to {largest:.9g} s"
    )
    if breaking_at(up_to(0.0), 0.0) is not None:
        states = len(up_to(0.0).kept)
        return Certified(of=varying.path, breaking=0, largest=largest, searched=searched, states=states)
    broken = least_breaking(up_to, largest)
    top = largest if broken is None else broken.value
    most, not_sought = LargestCertified(), not_sought_for(up_to(top))
    if not not_sought:
        most = largest_certified(lambda value: timeline.family([value]), [varying.path], top, progress)
    return Certified(
        of=varying.path, certified=most.value, unproved=most.unproved, beyond=beyond, not_sought=not_sought,
        breaking=None if broken is None else broken.value,
        breaking_sequence=() if broken is None else broken.sequence,
        small_gain=small_gain(timeline.loop, varying), largest=largest, searched=searched,
        states=len(up_to(top).kept), certificate=most.certificate,
    )  # fmt: skip


def _of_losses(timeline: LoopTimeline, varying: Varying, most: int, progress: Share) -> Certified:
    from orchestration.theory.certificates.find_certificate import find_certificate

    searched = f"one or two runs of up to {most} losses, 1 to {MOST_ARRIVALS} arrivals after each, repeated"
    if breaking_at(timeline.family(), 0.0) is not None:
        states = len(timeline.family().kept)
        return Certified(of=varying.path, breaking=0, largest=most, searched=searched, states=states)
    broken: BreakingSequence | None = None
    families = [timeline.family()]
    for run in range(1, most + 1):
        progress(0.5 * run / (most + 1))
        family = timeline.family(run=run)
        broken = breaking_losses(family, run)
        if broken is not None:
            break
        families.append(family)
    value, certificate, not_sought = None, None, not_sought_for(timeline.family(run=most))
    stable = [] if not_sought else families
    step = 0
    for run, family in enumerate(stable):  # a proof for a run is one for all shorter ones, and failing takes longest
        progress(0.5 + 0.5 * run / len(stable))
        found = find_certificate(family, [varying.path], step)
        if found is None:
            break
        value, certificate, step = run, found.certificate.to_json(), found.step
    return Certified(
        of=varying.path, certified=value, breaking=None if broken is None else broken.value,
        breaking_sequence=() if broken is None else broken.sequence, largest=most,
        searched=searched, states=len(timeline.family(run=most).kept), certificate=certificate, not_sought=not_sought,
    )  # fmt: skip


def _of_cause(request: Request, cause: Cause, progress: Share) -> Certified:
    system, files = rested(request), files_of(system_of(request))
    clocks = [f"components.{name}.sampling.jitter" for name in system.components]
    inform_of_chance(system, but=clocks, includes=ELSEWHERE)
    with errors_in_own_terms(request):
        loop = linear_loop_of(request)
        scheduled = ScheduledLoop(loop, system, cause)
        search = isolated_call(files.fmus.values(), least_repeated, system, cause, files.models, loop.period)
    largest = scheduled.largest()
    top = largest if search.breaking is None else min(largest, search.breaking)
    tried = largest if search.last is None else search.last
    most, not_sought = LargestCertified(), not_sought_for(scheduled.family(0.0))
    if search.breaking != 0.0 and not not_sought:
        shares = SHARES[-1:] if top == largest else SHARES  # all that is looked at is often stable
        most = largest_certified(scheduled.family, [cause.path], top, progress, shares)
    return Certified(
        of=cause.path, certified=most.value, unproved=most.unproved, breaking=search.breaking,
        refused=scheduled.refusal(largest + scheduled.tolerance) if most.value == largest else "",
        breaking_sequence=search.sequence, searched=search.searched,
        largest=tried if search.breaking is None else largest, own=highest_at(system, cause.path),
        states=len(scheduled.family(0.0).kept), certificate=most.certificate, not_sought=not_sought,
        in_double=are_in_double(loop.system.components),
    )  # fmt: skip


class LargestCertified(NamedTuple):
    """How far proofs reach."""

    value: float | None = None
    """Largest value with a certificate; None: even 0 has none"""
    certificate: str | None = None
    unproved: float | None = None
    """Least value that was tried in vain; None: each had one"""


def largest_certified(
    family_up_to: Callable[[float], LoopFamily],
    of: Sequence[str],
    top: float,
    progress: Share,
    shares: Sequence[float] | None = None,
) -> LargestCertified:
    """The largest value up to `top` with a certificate, and the least above it that was tried in vain."""
    from orchestration.theory.certificates.find_certificate import find_certificate

    first, *more = shares or SHARES
    best = LargestCertified()
    step, attempts = 0, 0

    def works(share: float) -> bool:
        nonlocal best, step, attempts
        attempts += 1
        progress(1.0 - 0.5 * 0.7**attempts)
        value = floor_to_nanoseconds(share * top)
        found = find_certificate(family_up_to(value), of, step)
        if found is None:
            best = best._replace(unproved=value)
        else:
            best, step = best._replace(value=value, certificate=found.certificate.to_json()), found.step
        return found is not None

    if works(first):
        all(works(share) for share in more)
        return best
    step = 0
    low, high = 0.0, first
    while high - low > FINEST:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if works(middle) else (low, middle)
    if best.value is None:
        works(0.0)
    return best


def small_gain(loop: CertifiedLoop, varying: Varying) -> float | None:
    """The bound of Kao and Lincoln [s]; None where it does not apply to the loop.

    It applies to one component in continuous time and a sampled one without memory, with delays of the command alone.
    """
    names = list(loop.components)
    sampled = [name for name in names if loop.is_sampled(name)]
    if varying.kind != DELAY or len(names) != 2 or len(sampled) != 1 or len(loop.system.connections) != 2:
        return None
    law, plant = sampled[0], next(name for name in names if name not in sampled)
    command = loop.connection(varying.name)
    measurement = next(x for x in loop.system.connections if x.name != command.name)
    controller, of = loop.components[law], loop.components[plant]
    static = not len(controller.A) and not of.D.any()
    if command.sender != law or measurement.delay or command.order != "gauss-seidel" or not static:
        return None
    measured = [of.outputs.index(variable_of(start)) for start in measurement.start]
    inputs = [controller.inputs.index(variable_of(end)) for end in measurement.end]
    commands = [controller.outputs.index(variable_of(start)) for start in command.start]
    driven = [of.inputs.index(variable_of(end)) for end in command.end]
    F = command.scale * measurement.scale * controller.D[np.ix_(commands, inputs)] @ of.C[measured]
    period = float(loop.period) / NANOSECONDS
    delay = lowest(command.delay)
    return certain_jitter(SampledLoop(A=of.A, B=of.B[:, driven], F=F, period=period, delay=delay))
