"""Rules that run the FMU: it runs, and every run is the same run, whatever happened before or beside it."""

import contextlib
import math
from collections.abc import Iterator
from dataclasses import replace

from orchestration.checks.validation.finding import Note
from orchestration.checks.validation.fmu import Variable
from orchestration.checks.validation.instance import RefusedError, Row, Value, same
from orchestration.checks.validation.probe import FEWEST, PLAIN, Bench, Plan
from orchestration.fmi.messages import WARNING

_DIGITS = 5e-15
"""Relative; what a text of 15 digits may be away from the number that it was made of"""


def runs(bench: Bench) -> Iterator[str]:
    """From instantiation to its end at start values, by the default experiment, without an error in its log."""
    first = bench.first
    if not first.whole:
        yield Note(f"slow: {first.steps} steps take {first.seconds:.2g} s; all runs are of as many steps at most")
    for status, message in dict.fromkeys((status, message) for status, _, message in first.messages):
        if status > WARNING:
            text = message.decode("utf-8", "replace").partition("\n")[0]
            yield f"it logs with status {status} though no call failed: {text}"


def getters(bench: Bench) -> Iterator[str]:
    """Every variable answers to the call for its type."""
    try:
        with bench.instance() as instance:
            bench.begin(instance, PLAIN)
            instance.get(bench.fmu.variables)
    except RefusedError:
        for v in bench.fmu.variables:
            with bench.instance() as instance:
                bench.begin(instance, PLAIN)
                try:
                    instance.get([v])
                except RefusedError as error:
                    yield f"{v.name}: declared as {v.type}, but {error}"


def start_values(bench: Bench) -> Iterator[str]:
    """What is declared to start at a value has it to 15 digits; in FMUs of this project to the last bit."""
    declared = [v for v in bench.fmu.variables if v.keeps_start]
    with bench.instance() as instance:
        moments = {"freshly instantiated": instance.get(declared)} if bench.fmu.is_ours else {}
        instance.initialise({}, bench.start)
        moments["after initialisation"] = instance.get(declared)
    for v in declared:
        for moment, row in moments.items():
            if not _starts(row[v.name], v.start_value, exactly=bench.fmu.is_ours):
                yield f"{v.name}: start = {v.start}, but {moment} it is {row[v.name]!r}"
                break


def _starts(found: Value, declared: Value, *, exactly: bool) -> bool:
    """Whether a value is the declared one; of FMUs of this project to the last bit."""
    if exactly or not (isinstance(found, float) and isinstance(declared, float)):
        return same(found, declared)
    return math.isclose(found, declared, rel_tol=_DIGITS)


def finite_outputs(bench: Bench) -> Iterator[str]:
    """Outputs are finite after initialisation and after every step, with inputs at rest and moving."""
    named: set[str] = set()
    for plan in (PLAIN, bench.rich):
        with bench.instance() as instance:
            bench.begin(instance, plan)
            rows = [instance.get(bench.outputs), *bench.fly(instance, plan)]
        for k, row in enumerate(rows):
            for name, value in _not_finite(row, bench.outputs):
                if name not in named:
                    named.add(name)
                    yield f"{name} = {value} {f'after step {k}' if k else 'after initialisation'}: expected it finite"


def _not_finite(row: Row, outputs: tuple[Variable, ...]) -> list[tuple[str, float]]:
    values = ((v.name, float(row[v.name])) for v in outputs if v.type == "Real")
    return [(name, value) for name, value in values if not math.isfinite(value)]


def variable_steps(bench: Bench) -> Iterator[str]:
    """An FMU that declares it takes steps of different lengths does, and a step is as long as its halves."""
    if not bench.fmu.can("canHandleVariableCommunicationStepSize"):
        return
    whole = bench.points(Plan(uneven=True, steps=20))
    halves = [(t + i * 0.5 * h, 0.5 * h) for t, h in whole for i in (0, 1)]
    ends = []
    for points in (whole, halves):
        with bench.instance() as instance:
            bench.begin(instance, PLAIN)
            for t, h in points:
                if not instance.step(t, h):
                    return
            ends.append(instance.get(bench.fmu.variables))
    for end in ends:
        for name, value in _not_finite(end, bench.outputs):
            yield f"{name} = {value} after steps of different lengths: expected it finite"
    for v in bench.fmu.of_causality("independent"):
        a, b = (float(end[v.name]) for end in ends)
        if not math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9):
            yield f"{v.name} = {b!r} after halved steps, expected {a!r} as after whole ones"


def repeatable(bench: Bench) -> Iterator[str]:
    """Two fresh instances run the same; without that, as with `rand()`, the rules that compare runs are not tried."""
    if bench.repeats is not None:
        text = f"{bench.repeats}, as in an equal run before; what compares runs is not tried"
        yield text if bench.fmu.is_ours else Note(text)


def inputs_set_twice(bench: Bench) -> Iterator[str]:
    """Setting an input again to what it is changes nothing."""
    twice = bench.flown(replace(bench.rich, times_set=2))
    yield from bench.parted(twice, bench.expected, "{}, as with inputs set once")


def reset(bench: Bench) -> Iterator[str]:
    """A run after a reset is the run of a fresh instance, whatever was run before."""
    short = Plan(steps=20)
    fresh = bench.flown(short)
    with bench.instance() as instance:
        for plan, expected in ((bench.rich, bench.expected), (short, fresh), (bench.rich, bench.expected)):
            bench.begin(instance, plan)
            texts = list(
                bench.parted(bench.fly(instance, plan), expected, "{}, as without the run and reset before it")
            )
            if texts:
                yield from texts
                return
            instance.reset()


def instances(bench: Bench) -> Iterator[str]:
    """An instance runs the same beside another one."""
    if bench.fmu.can("canBeInstantiatedOnlyOncePerProcess"):
        return
    plan, other = bench.rich, Plan(steps=bench.rich.steps)
    rows = []
    with bench.instance() as first, bench.instance() as second:
        bench.begin(first, plan)
        bench.begin(second, other)
        for k in range(len(bench.expected)):
            rows += bench.fly(first, plan, k, k + 1)
            bench.fly(second, other, k, k + 1)
    yield from bench.parted(rows, bench.expected, "{}, as without a second instance")


def saved_state(bench: Bench) -> Iterator[str]:
    """A run that goes on from a state that was saved goes on as it did."""
    if not bench.fmu.can("canGetAndSetFMUstate"):
        return
    plan, half = bench.rich, len(bench.expected) // 2
    with bench.instance() as instance:
        bench.begin(instance, plan)
        bench.fly(instance, plan, 0, half)
        state = instance.state()
        after = bench.fly(instance, plan, half)
        yield from bench.parted(after, bench.expected[half:], f"after the state was taken at step {half}: {{}}")
        instance.put_back(state)
        after = bench.fly(instance, plan, half)
    yield from bench.parted(after, bench.expected[half:], f"from the state of step {half}: {{}}")


def serialised_state(bench: Bench) -> Iterator[str]:
    """Another instance goes on from a serialised state as the first one did."""
    if not (bench.fmu.can("canSerializeFMUstate") and bench.fmu.can("canGetAndSetFMUstate")):
        return
    plan, half = bench.rich, len(bench.expected) // 2
    with bench.instance() as instance:
        bench.begin(instance, plan)
        bench.fly(instance, plan, 0, half)
        content = instance.serialised()
    with bench.instance() as other:
        other.put_back_bytes(content)
        after = bench.fly(other, plan, half)
    text = f"another instance, from the bytes of the state of step {half}: {{}}"
    yield from bench.parted(after, bench.expected[half:], text)


def stop_time(bench: Bench) -> Iterator[str]:
    """A step past the stop time that was set is an error, or ends the run (FMI 2.0.4, section 2.1.6)."""
    *allowed, (t, h) = bench.points(Plan(steps=FEWEST))
    if not allowed:
        return
    with bench.instance() as instance:
        instance.initialise({}, bench.start, stop=t)
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
