"""Rules that run the FMU: it runs, and every run is the same run, whatever happened before or beside it."""

import contextlib
import math
from collections.abc import Iterator
from dataclasses import replace

from orchestration.checks.validation.declared import Variable
from orchestration.checks.validation.finding import Note
from orchestration.checks.validation.instance import RefusedError, Row, Value, same
from orchestration.checks.validation.probe import FEWEST, PLAIN, Plan, Probe
from orchestration.fmi.messages import WARNING

_DIGITS = 5e-15
"""Relative; what a text of 15 digits may be away from the number that it was made of"""


def runs(probe: Probe) -> Iterator[str]:
    """From instantiation to its end at start values, by the default experiment, without an error in its log."""
    first = probe.first
    if not first.whole:
        yield Note(f"slow: {first.steps} steps take {first.seconds:.2g} s; all runs are of as many steps at most")
    clocked = [v.name for v in probe.fmu.variables if v.is_clocked]
    if clocked:
        yield Note(f"{', '.join(clocked)}: not looked at, for it runs without event mode, in which clocks tick")
    for status, message in dict.fromkeys((status, message) for status, _, message in first.messages):
        if status > WARNING:
            text = message.decode("utf-8", "replace").partition("\n")[0]
            yield f"it logs with status {status} though no call failed: {text}"


def getters(probe: Probe) -> Iterator[str]:
    """Every variable answers to the call for its type."""
    try:
        with probe.instance() as instance:
            probe.begin(instance, PLAIN)
            instance.get(probe.fmu.elements)
    except RefusedError:
        for v in probe.fmu.elements:
            with probe.instance() as instance:
                probe.begin(instance, PLAIN)
                try:
                    instance.get([v])
                except RefusedError as error:
                    yield f"{v.name}: declared as {v.type}, but {error}"


def start_values(probe: Probe) -> Iterator[str]:
    """What is declared to start at a value has it to 15 digits; in FMUs of this project to the last bit.

    FMI 2.0 lets nobody ask before initialisation, and the FMUs of this project answer nevertheless.
    """
    declared = [v for v in probe.fmu.elements if v.keeps_start]
    may_be_asked = probe.fmu.is_ours or probe.fmu.version > 2
    with probe.instance() as instance:
        moments = {"freshly instantiated": instance.get(declared)} if may_be_asked else {}
        instance.initialise({}, probe.start)
        moments["after initialisation"] = instance.get(declared)
    for v in declared:
        for moment, row in moments.items():
            if not _starts(row[v.name], v.start_value, exactly=probe.fmu.is_ours):
                yield f"{v.name}: start = {v.start}, but {moment} it is {row[v.name]!r}"
                break


def _starts(found: Value, declared: Value, *, exactly: bool) -> bool:
    """Whether a value is the declared one; of FMUs of this project to the last bit."""
    if exactly or not (isinstance(found, float) and isinstance(declared, float)):
        return same(found, declared)
    return math.isclose(found, declared, rel_tol=_DIGITS)


def finite_outputs(probe: Probe) -> Iterator[str]:
    """Outputs are finite after initialisation and after every step, with inputs at rest and moving."""
    named: set[str] = set()
    for plan in (PLAIN, probe.rich):
        with probe.instance() as instance:
            probe.begin(instance, plan)
            rows = [instance.get(probe.outputs), *probe.fly(instance, plan)]
        for k, row in enumerate(rows):
            for name, value in _not_finite(row, probe.outputs):
                if name not in named:
                    named.add(name)
                    yield f"{name} = {value} {f'after step {k}' if k else 'after initialisation'}: expected it finite"


def _not_finite(row: Row, outputs: tuple[Variable, ...]) -> list[tuple[str, float]]:
    values = ((v.name, float(row[v.name])) for v in outputs if v.kind == "Real")
    return [(name, value) for name, value in values if not math.isfinite(value)]


def variable_steps(probe: Probe) -> Iterator[str]:
    """An FMU that declares it takes steps of different lengths does, and a step is as long as its halves."""
    if not probe.fmu.can("canHandleVariableCommunicationStepSize"):
        return
    whole = probe.points(Plan(uneven=True, steps=20))
    halves = [(t + i * 0.5 * h, 0.5 * h) for t, h in whole for i in (0, 1)]
    ends = []
    for points in (whole, halves):
        with probe.instance() as instance:
            probe.begin(instance, PLAIN)
            for t, h in points:
                if not instance.step(t, h):
                    return
            ends.append(instance.get(probe.fmu.elements))
    for end in ends:
        for name, value in _not_finite(end, probe.outputs):
            yield f"{name} = {value} after steps of different lengths: expected it finite"
    for v in probe.of("independent"):
        a, b = (float(end[v.name]) for end in ends)
        if not math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9):
            yield f"{v.name} = {b!r} after halved steps, expected {a!r} as after whole ones"


def repeatable(probe: Probe) -> Iterator[str]:
    """Two fresh instances run the same; without that, as with `rand()`, the rules that compare runs are not tried."""
    if probe.repeats is not None:
        text = f"{probe.repeats}, as in an equal run before; what compares runs is not tried"
        yield text if probe.fmu.is_ours else Note(text)


def inputs_set_twice(probe: Probe) -> Iterator[str]:
    """Setting an input again to what it is changes nothing."""
    twice = probe.flown(replace(probe.rich, times_set=2))
    yield from probe.parted(twice, probe.expected, "{}, as with inputs set once")


def reset(probe: Probe) -> Iterator[str]:
    """A run after a reset is the run of a fresh instance, whatever was run before."""
    short = Plan(steps=20)
    fresh = probe.flown(short)
    with probe.instance() as instance:
        for plan, expected in ((probe.rich, probe.expected), (short, fresh), (probe.rich, probe.expected)):
            probe.begin(instance, plan)
            texts = list(
                probe.parted(probe.fly(instance, plan), expected, "{}, as without the run and reset before it")
            )
            if texts:
                yield from texts
                return
            instance.reset()


def instances(probe: Probe) -> Iterator[str]:
    """An instance runs the same beside another one."""
    if probe.fmu.can("canBeInstantiatedOnlyOncePerProcess"):
        return
    plan, other = probe.rich, Plan(steps=probe.rich.steps)
    rows = []
    with probe.instance() as first, probe.instance() as second:
        probe.begin(first, plan)
        probe.begin(second, other)
        for k in range(len(probe.expected)):
            rows += probe.fly(first, plan, k, k + 1)
            probe.fly(second, other, k, k + 1)
    yield from probe.parted(rows, probe.expected, "{}, as without a second instance")


def saved_state(probe: Probe) -> Iterator[str]:
    """A run that goes on from a state that was saved goes on as it did."""
    if not probe.fmu.saves:
        return
    plan, half = probe.rich, len(probe.expected) // 2
    with probe.instance() as instance:
        probe.begin(instance, plan)
        probe.fly(instance, plan, 0, half)
        state = instance.state()
        after = probe.fly(instance, plan, half)
        yield from probe.parted(after, probe.expected[half:], f"after the state was taken at step {half}: {{}}")
        instance.put_back(state)
        after = probe.fly(instance, plan, half)
    yield from probe.parted(after, probe.expected[half:], f"from the state of step {half}: {{}}")


def serialised_state(probe: Probe) -> Iterator[str]:
    """Another instance goes on from a serialised state as the first one did."""
    if not (probe.fmu.serialises and probe.fmu.saves):
        return
    plan, half = probe.rich, len(probe.expected) // 2
    with probe.instance() as instance:
        probe.begin(instance, plan)
        probe.fly(instance, plan, 0, half)
        content = instance.serialised()
    with probe.instance() as other:
        other.put_back_bytes(content)
        after = probe.fly(other, plan, half)
    text = f"another instance, from the bytes of the state of step {half}: {{}}"
    yield from probe.parted(after, probe.expected[half:], text)


def stop_time(probe: Probe) -> Iterator[str]:
    """A step past the stop time that was set is an error, or ends the run (FMI 2.0.4, section 2.1.6)."""
    *allowed, (t, h) = probe.points(Plan(steps=FEWEST))
    if not allowed:
        return
    with probe.instance() as instance:
        instance.initialise({}, probe.start, stop=t)
        if not all(instance.step(*point) for point in allowed):
            return
        with contextlib.suppress(RefusedError):
            if instance.step(t, h):
                yield f"a step from {t} to {t + h} is done, though stopTime = {t}: expected it refused"


FIRST = (runs, getters)
"""Without these the others cannot be tried"""
RULES = (start_values, finite_outputs, variable_steps, repeatable)
COMPARED = (inputs_set_twice, reset, instances, saved_state, serialised_state)
"""For FMUs whose runs can be repeated"""
LAST = (stop_time,)
"""They leave an instance that has failed, which another one may not stand beside"""
