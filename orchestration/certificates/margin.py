"""How far a quantity of a loop may vary from draw to draw: certified, broken, and by the small gain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.extras import needs
from orchestration.basics.progress import ShareProgress, share_reporter
from orchestration.basics.terminal import Share
from orchestration.building.inputs import files_of
from orchestration.certificates.breaking import LONGEST, Broken, broken_at, least_breaking
from orchestration.certificates.causes import Cause, Caused, cause_at
from orchestration.certificates.family import Family
from orchestration.certificates.parts import Loop, loop_of
from orchestration.certificates.repeated import least_repeated
from orchestration.certificates.timeline import DELAY, JITTER, LOSS, Timeline, Varying
from orchestration.exact.scheduled import without_scheduler
from orchestration.fmi.foreign import computed
from orchestration.fmi.reuse import Instances
from orchestration.requests.ranges import paths_in
from orchestration.requests.request import RequestLike, request_of
from orchestration.stability.delay_bounds import SampledLoop, certain_jitter
from orchestration.stability.known_loops import rested
from orchestration.stability.loop_at_rest import at_rest
from orchestration.system.distribution import lowest
from orchestration.system.placement import messages_by_connection, tasks_of
from orchestration.system.request import Request, errors_in_own_terms, system_of
from orchestration.system.times import NANOSECONDS, down_to_nanoseconds
from orchestration.system.variable_names import variable_of

MOST_LOST = 8
"""losses in a row that are looked at"""
SHARES = (0.95, 0.97, 0.98, 0.99, 1.0)
"""of what breaks the loop, or of the largest value: tried for a certificate, upward; below the first by halves"""
FINEST = 0.02
"""of what breaks the loop: to which that is done"""


@dataclass(frozen=True, kw_only=True)
class Certified:
    """How far a quantity may vary; times in seconds, losses as the longest run of them."""

    of: str
    """The path of what varies: each draw is anywhere from 0 to the value."""
    certified: float | None
    """The largest value for which a proof was found that no sequence makes the loop unstable; None: there is none, as
    the loop is unstable without any, or on its computer none was found even for 0."""
    breaking: float | None
    """The least value at which a periodic sequence was found that makes it unstable; None: none that was tried does."""
    breaking_sequence: tuple[tuple[str, tuple[float, ...]], ...]
    """That sequence: what happens at each draw, with its values, again and again."""
    small_gain: float | None
    """What the small-gain bound of Kao and Lincoln promises; None where it does not apply."""
    largest: float
    """The largest value that was looked at."""
    searched: str
    """Which sequences were tried for `breaking`."""
    states: int
    """Numbers that go from one period to the next."""
    certificate: str | None
    """The proof, as the text of a file that `check` verifies."""

    def save(self, path: str | Path) -> Path:
        """Write the certificate; raises `UsageError` where there is none."""
        if self.certificate is None:
            raise UsageError("there is no certificate to write")
        Path(path).write_text(self.certificate, encoding="utf-8")
        return Path(path)


@needs("flint", "clarabel")
def margin(asked: RequestLike, of: str, *, progress: ShareProgress = None) -> Certified:
    """How far a quantity of a system may vary from draw to draw, the loop linearised about its operating point.

    `of` is the path of a sampled component's `sampling.jitter`, of a connection's `delay_jitter`, or of its `loss`,
    which stands for the longest run of messages that are lost one after the other; all else is punctual. Of a system
    with computers or networks it is that of a task's `execution`, or of the `jitter` of a task or message; all others
    are as they may be. What is found is about the linear loop: nothing is said of large errors.

    Raises `UsageError` where the loop cannot be made linear or the path is for something else, saying why.
    """
    request = request_of(asked)
    cause = cause_in(request, of)
    if cause is not None:
        with share_reporter(progress, "certifying") as heard:
            return _of_cause(request, cause, heard)
    varying = varying_of(request, of)
    expect_unshared(request)
    loop = measured(request)
    timeline = Timeline(loop, [varying])
    with share_reporter(progress, "certifying") as heard:
        return (_of_losses if varying.kind == LOSS else _of_times)(timeline, varying, heard)


def measured(request: Request) -> Loop:
    """The loop of a request about its operating point, from its FMUs; nothing makes it late."""
    return computed(files_of(system_of(request)).fmus.values(), _measured, request)


def _measured(request: Request) -> Loop:
    instances = Instances()
    try:
        with errors_in_own_terms(request), at_rest(without_scheduler(rested(request)), instances) as rest:
            return loop_of(rest)
    finally:
        instances.close()


def expect_unshared(request: Request) -> None:
    """Raise `UsageError` for what a scheduler decides, saying what to ask for instead."""
    system = system_of(request)
    for name, task in tasks_of(system).items():
        raise UsageError(
            f"{task.place}: a scheduler has {name} sampled; expected --of {task.place}.execution, as a cause"
        )
    for name, message in messages_by_connection(system).items():
        raise UsageError(f"{message.place}: {name} waits for other frames; expected --of the jitter of one, as a cause")


def cause_in(request: Request, of: str) -> Cause | None:
    """What a path is of, where it is of a computer or a network."""
    (path, *others) = paths_in(request, of) or (of,)
    return None if others else cause_at(system_of(request), path)


def varying_of(request: Request, of: str) -> Varying:
    """What a path is of; raises `UsageError` for one that nothing is certified for."""
    found = paths_in(request, of)
    for path in found[:1] if len(found) == 1 else ():
        table, _, rest = path.partition(".")
        name, _, key = rest.rpartition(".")
        if table == "connections" and key in (DELAY, LOSS):
            return Varying(kind=key, name=name, path=path)
        if table == "components" and key == JITTER:
            return Varying(kind=key, name=name.removesuffix(".sampling"), path=path)
    raise UsageError(
        f"--of {of}: expected connections.NAME.delay_jitter, connections.NAME.loss, components.NAME.sampling.jitter, "
        "computers.NAME.tasks.NAME.execution or jitter, or networks.NAME.messages.NAME.jitter"
    )


def _of_times(timeline: Timeline, varying: Varying, progress: Share) -> Certified:
    def up_to(value: float) -> Family:
        return timeline.family([value])

    largest = down_to_nanoseconds(timeline.largest())
    searched = (
        f"draws at either end of each range, sequences that repeat after at most {LONGEST}, values up to {largest:g} s"
    )
    if broken_at(up_to(0.0), 0.0) is not None:
        return _unstable(varying, largest, searched, up_to(0.0))
    broken = least_breaking(up_to, largest)
    top = largest if broken is None else broken.value
    value, certificate = largest_certified(up_to, [varying.path], top, progress)
    return Certified(
        of=varying.path, certified=value, breaking=None if broken is None else broken.value,
        breaking_sequence=() if broken is None else broken.sequence,
        small_gain=small_gain(timeline.loop, varying), largest=largest, searched=searched,
        states=len(up_to(top).kept), certificate=certificate,
    )  # fmt: skip


def _of_losses(timeline: Timeline, varying: Varying, progress: Share) -> Certified:
    from orchestration.certificates.certify import certified

    searched = f"sequences that repeat after at most the run and {LONGEST // 2} messages, runs up to {MOST_LOST}"
    if broken_at(timeline.family(), 0.0) is not None:
        return _unstable(varying, MOST_LOST, searched, timeline.family())
    broken: Broken | None = None
    value, certificate = None, None
    for run in range(MOST_LOST + 1):
        progress(run / (MOST_LOST + 1))
        family = timeline.family(run=run)
        broken = broken_at(family, run, run + LONGEST // 2)
        if broken is not None:
            break
        found = certified(family, [varying.path])
        if found is not None:
            value, certificate = run, found.certificate.to_json()
    return Certified(
        of=varying.path, certified=value, breaking=None if broken is None else broken.value,
        breaking_sequence=() if broken is None else broken.sequence, small_gain=None, largest=MOST_LOST,
        searched=searched, states=len(timeline.family(run=MOST_LOST).kept), certificate=certificate,
    )  # fmt: skip


def _of_cause(request: Request, cause: Cause, progress: Share) -> Certified:
    system, files = rested(request), files_of(system_of(request))
    with errors_in_own_terms(request):
        loop = measured(request)
        caused = Caused(loop, system, cause)
        tried = computed(files.fmus.values(), least_repeated, system, cause, files.models, loop.period)
    largest = caused.largest()
    top = largest if tried.breaking is None else min(largest, tried.breaking)
    value, certificate = None, None
    if tried.breaking != 0.0:
        value, certificate = largest_certified(caused.family, [cause.path], top, progress)
    return Certified(
        of=cause.path, certified=value, breaking=tried.breaking,
        breaking_sequence=tried.sequence,
        small_gain=None, largest=largest, searched=tried.searched, states=len(caused.family(0.0).kept),
        certificate=certificate,
    )  # fmt: skip


def _unstable(varying: Varying, largest: float, searched: str, family: Family) -> Certified:
    return Certified(
        of=varying.path, certified=None, breaking=0, breaking_sequence=(), small_gain=None, largest=largest,
        searched=searched, states=len(family.kept), certificate=None,
    )  # fmt: skip


def largest_certified(
    family_up_to: Callable[[float], Family],
    of: Sequence[str],
    top: float,
    progress: Share,
    shares: Sequence[float] | None = None,
) -> tuple[float | None, str | None]:
    """The largest value for which a certificate is found, below `top`, and that; None where even 0 has none."""
    from orchestration.certificates.certify import certified

    first, *more = shares or SHARES
    best: tuple[float | None, str | None] = (None, None)
    step, tried = 0, 0

    def works(share: float) -> bool:
        nonlocal best, step, tried
        tried += 1
        progress(1.0 - 0.7**tried)
        value = down_to_nanoseconds(share * top)
        found = certified(family_up_to(value), of, step)
        if found is not None:
            best, step = (value, found.certificate.to_json()), found.step
        return found is not None

    if works(first):
        all(works(share) for share in more)
        return best
    step = 0
    low, high = 0.0, first
    while high - low > FINEST:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if works(middle) else (low, middle)
    if best[0] is None:
        works(0.0)
    return best


def small_gain(loop: Loop, varying: Varying) -> float | None:
    """The bound of Kao and Lincoln [s]; None where the loop is not the one that it is for.

    It is for one component in continuous time and one that is sampled and has no memory, the command alone late.
    """
    names = list(loop.components)
    sampled = [name for name in names if loop.is_sampled(name)]
    if varying.kind != DELAY or len(names) != 2 or len(sampled) != 1 or len(loop.system.connections) != 2:
        return None
    law, plant = sampled[0], next(name for name in names if name not in sampled)
    command = loop.connection(varying.name)
    measurement = next(x for x in loop.system.connections if x.name != command.name)
    controller, of = loop.components[law], loop.components[plant]
    static = not len(controller.A) and not of.D.any() and len(loop.samples_of(law)) == 1
    if command.sender != law or measurement.delay or command.order != "gauss-seidel" or not static:
        return None
    taken = [of.outputs.index(variable_of(start)) for start in measurement.start]
    heard = [controller.inputs.index(variable_of(end)) for end in measurement.end]
    said = [controller.outputs.index(variable_of(start)) for start in command.start]
    moved = [of.inputs.index(variable_of(end)) for end in command.end]
    F = command.scale * measurement.scale * controller.D[np.ix_(said, heard)] @ of.C[taken]
    period = float(loop.period) / NANOSECONDS
    delay = lowest(command.delay)
    return certain_jitter(SampledLoop(A=of.A, B=of.B[:, moved], F=F, period=period, delay=delay))
