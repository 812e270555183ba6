"""Rules that run the FMU: it runs, and every run is the same run, whatever happened before or beside it."""

import math
from collections.abc import Iterator
from dataclasses import replace

from orchestration.validation.bench import PLAIN, Bench, Plan, difference
from orchestration.validation.fmu import Variable
from orchestration.validation.instance import RefusedError, Row, same

_WARNING = 1  # fmi2Status


def runs(bench: Bench) -> Iterator[str]:
    """From instantiation to its end at start values, by the default experiment, without an error in its log."""
    with bench.instance() as instance:
        bench.begin(instance, PLAIN)
        for t, h in bench.points(PLAIN):
            if not instance.step(t, h):
                break
        instance.terminate()
    for status, message in dict.fromkeys((status, message) for status, _, message in instance.messages):
        if status > _WARNING:
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
    """What is declared to start at a value has it, to the last bit: after initialisation, and from the beginning."""
    declared = [v for v in bench.fmu.variables if v.keeps_start]
    with bench.instance() as instance:
        moments = {"freshly instantiated": instance.get(declared)} if bench.fmu.is_ours else {}
        instance.initialise({}, bench.start)
        moments["after initialisation"] = instance.get(declared)
    for v in declared:
        for moment, row in moments.items():
            if not same(row[v.name], v.start_value):
                yield f"{v.name}: start = {v.start}, but {moment} it is {row[v.name]!r}"
                break


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


def inputs_set_twice(bench: Bench) -> Iterator[str]:
    """Setting an input again to what it is changes nothing."""
    differs = difference(bench.flown(replace(bench.rich, times_set=2)), bench.expected)
    if differs:
        yield f"{differs}, as with inputs set once"


def reset(bench: Bench) -> Iterator[str]:
    """A run after a reset is the run of a fresh instance, whatever was run before."""
    short = Plan(steps=20)
    fresh = bench.flown(short)
    with bench.instance() as instance:
        for plan, expected in ((bench.rich, bench.expected), (short, fresh), (bench.rich, bench.expected)):
            bench.begin(instance, plan)
            differs = difference(bench.fly(instance, plan), expected)
            if differs:
                yield f"{differs}, as without the run and reset before it"
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
    differs = difference(rows, bench.expected)
    if differs:
        yield f"{differs}, as without a second instance"


def saved_state(bench: Bench) -> Iterator[str]:
    """A run that goes on from a state that was saved goes on as it did."""
    if not bench.fmu.can("canGetAndSetFMUstate"):
        return
    plan, half = bench.rich, len(bench.expected) // 2
    with bench.instance() as instance:
        bench.begin(instance, plan)
        bench.fly(instance, plan, 0, half)
        state = instance.state()
        differs = difference(bench.fly(instance, plan, half), bench.expected[half:])
        if differs:
            yield f"after the state was taken at step {half}: {differs}"
        instance.put_back(state)
        differs = difference(bench.fly(instance, plan, half), bench.expected[half:])
    if differs:
        yield f"from the state of step {half}: {differs}"


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
        differs = difference(bench.fly(other, plan, half), bench.expected[half:])
    if differs:
        yield f"another instance, from the bytes of the state of step {half}: {differs}"


FIRST = (runs, getters)
"""Without these the others cannot be tried"""
RULES = (
    start_values,
    finite_outputs,
    variable_steps,
    inputs_set_twice,
    reset,
    instances,
    saved_state,
    serialised_state,
)
