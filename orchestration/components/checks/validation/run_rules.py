"""Rules that run the FMU: it runs, and equal runs have equal results, whatever happened before or beside them."""

import contextlib
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from orchestration.components.checks.validation.excitation import PLAIN, ExcitationPlan
from orchestration.components.checks.validation.finding import Note
from orchestration.components.checks.validation.fmu import is_clocked
from orchestration.components.checks.validation.instance import CheckedInstance, Row, Value
from orchestration.components.checks.validation.probe import MIN_STEPS, Probe
from orchestration.components.checks.validation.run_comparison import same
from orchestration.components.fmi.instance import start_value
from orchestration.components.fmi.read_description import Variable, declared_of
from orchestration.components.fmi.slaves import WARNING
from orchestration.foundation.basics.errors import SimulatorError

_FEW = 20
"""Steps after which the first changes of what is fixed are looked for"""
_DIGITS = 5e-15
"""relative error of a number in a text of 15 digits"""


def runs(probe: Probe) -> Iterator[str]:
    """A run of the default experiment at start values completes without an error in the log."""
    first = probe.first
    if not first.is_complete:
        yield Note(f"slow: {first.steps} steps take {first.seconds:.2g} s; no run has more steps")
    clocked = [v.name for v in probe.fmu.variables if is_clocked(v)]
    if clocked and "event-mode" not in declared_of(probe.fmu.description):
        yield Note(f"{', '.join(clocked)}: not checked, as clocks tick in event mode only, in which it does not run")
    for status, message in dict.fromkeys((status, message) for status, _, message in first.messages):
        if status > WARNING:
            text = message.decode("utf-8", "replace").partition("\n")[0]
            yield f"it logs with status {status} though no call failed: {text}"


def getters(probe: Probe) -> Iterator[str]:
    """Every variable can be read by the function for its type."""
    try:
        with probe.instance() as instance:
            probe.begin(instance, PLAIN)
            instance.row(probe.elements)
    except SimulatorError:
        for v in probe.elements:
            with probe.instance() as instance:
                probe.begin(instance, PLAIN)
                try:
                    instance.row([v])
                except SimulatorError as error:
                    yield f"{v.name}: declared as {v.type}, but {error}"


def start_values(probe: Probe) -> Iterator[str]:
    """Variables have their declared start values to 15 digits, in FMUs of this project to the last bit; no step changes
    what is fixed, nor a parameter.

    FMI 2.0 allows no reading before initialisation; FMUs of this project support it nevertheless.
    """
    declared = [v for v in probe.elements if _keeps_start(v)]
    is_readable = probe.fmu.is_ours or probe.fmu.version > 2
    with probe.instance() as instance:
        moments = {"freshly instantiated": instance.row(declared)} if is_readable else {}
        instance.start({}, probe.start)
        moments["after initialisation"] = instance.row(declared)
        changed = list(_changed(probe, instance, probe.points(PLAIN)[:_FEW]))
    for v in declared:
        for moment, row in moments.items():
            if not _starts(row[v.name], start_value(v), exactly=probe.fmu.is_ours):
                yield f"{v.name}: start = {v.start}, but {moment} it is {row[v.name]!r}"
                break
    yield from changed


def _late_changes(probe: Probe) -> Iterator[str]:
    """What is fixed, and parameters, are not changed by the steps after those few of `start_values`, either."""
    points = probe.points(PLAIN)
    with probe.instance() as instance:
        probe.begin(instance, PLAIN)
        if not [*_changed(probe, instance, points[:_FEW])] and not instance.stopped:
            yield from _changed(probe, instance, points[_FEW:])


def _changed(probe: Probe, instance: CheckedInstance, points: Sequence[tuple[float, float]]) -> Iterator[str]:
    """The changes of what is fixed, and of parameters, by steps."""
    kept = [v for v in probe.elements if v.variability in ("constant", "fixed") or v.causality == "parameter"]
    before = instance.row(kept)
    steps = sum(1 for _ in itertools.takewhile(lambda point: instance.advance(*point), points))
    after = instance.row(kept)
    for v in kept:
        if not same(before[v.name], after[v.name]):
            yield (
                f"{v.name}: {before[v.name]!r}, but {after[v.name]!r} after {steps} steps more: expected a "
                f"{v.variability} {v.causality} to stay what it is unless it is set"
            )


def _keeps_start(v: Variable) -> bool:
    """Whether it has its start value after initialisation unless set: the model cannot change it."""
    return (v.is_settable or v.variability == "constant") and v.start is not None


def _starts(found: Value, declared: Value, *, exactly: bool) -> bool:
    """Whether a value is the declared one, to the last bit if `exactly`."""
    if exactly or not (isinstance(found, float) and isinstance(declared, float)):
        return same(found, declared)
    return math.isclose(found, declared, rel_tol=_DIGITS)


def finite_outputs(probe: Probe) -> Iterator[str]:
    """Outputs are finite after initialisation and after every step, with constant and moving inputs."""
    named: set[str] = set()
    for plan in (PLAIN, probe.general_plan):
        with probe.instance() as instance:
            probe.begin(instance, plan)
            rows = [instance.row(probe.outputs), *probe.run_steps(instance, plan)]
        for k, row in enumerate(rows):
            for name, value in _not_finite(row, probe.outputs):
                if name not in named:
                    named.add(name)
                    yield f"{name} = {value} {f'after step {k}' if k else 'after initialisation'}: expected it finite"


def _not_finite(row: Row, outputs: tuple[Variable, ...]) -> list[tuple[str, float]]:
    values = ((v.name, float(row[v.name])) for v in outputs if v.kind == "Real")
    return [(name, value) for name, value in values if not math.isfinite(value)]


def variable_steps(probe: Probe) -> Iterator[str]:
    """An FMU that declares variable step sizes takes them, and a step is as long as its halves."""
    if not probe.model.varies_step:
        return
    whole = probe.points(ExcitationPlan(uneven=True, steps=20))
    halves = [(t + i * 0.5 * h, 0.5 * h) for t, h in whole for i in (0, 1)]
    ends = []
    for points in (whole, halves):
        with probe.instance() as instance:
            probe.begin(instance, PLAIN)
            for t, h in points:
                if not instance.advance(t, h):
                    return
            ends.append(instance.row(probe.elements))
    for end in ends:
        for name, value in _not_finite(end, probe.outputs):
            yield f"{name} = {value} after steps of different lengths: expected it finite"
    for v in probe.elements_of("independent"):
        a, b = (float(end[v.name]) for end in ends)
        if not math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9):
            yield f"{v.name} = {b!r} after halved steps, expected {a!r} as after whole ones"


def repeatable(probe: Probe) -> Iterator[str]:
    """Two fresh instances give the same run; otherwise, as with `rand()`, rules that compare runs are not tried.

    So they do where fresh memory has other contents. That memory grows from step to step is a note. Late
    steps change nothing that is fixed.
    """
    if probe.repeats is not None:
        text = f"{probe.repeats}, as in an equal run before; rules that compare runs are not tried"
        yield text if probe.fmu.is_ours else Note(text)
    elif probe.reads_unwritten is not None:
        yield f"{probe.reads_unwritten}, if fresh memory has other contents: it reads what nobody has written"
    if probe.growth:
        yield Note(f"its memory grows by {probe.growth} bytes in each step: a long run may exhaust it")
    yield from _late_changes(probe)


def inputs_set_twice(probe: Probe) -> Iterator[str]:
    """Setting an input twice to the same value changes nothing."""
    twice = probe.run(replace(probe.general_plan, times_set=2))
    yield from probe.deviations(twice, probe.expected_rows, "{}, as with inputs set once")


def reset(probe: Probe) -> Iterator[str]:
    """A run after a reset equals the run of a fresh instance, whatever was run before."""
    short = ExcitationPlan(steps=20)
    fresh = probe.run(short)
    with probe.instance() as instance:
        for plan, expected in (
            (probe.general_plan, probe.expected_rows),
            (short, fresh),
            (probe.general_plan, probe.expected_rows),
        ):
            probe.begin(instance, plan)
            texts = list(
                probe.deviations(
                    probe.run_steps(instance, plan), expected, "{}, as without the run and reset before it"
                )
            )
            if texts:
                yield from texts
                return
            instance.reset()


def instances(probe: Probe) -> Iterator[str]:
    """A run is the same beside another instance."""
    if probe.fmu.interface.canBeInstantiatedOnlyOncePerProcess:
        return
    plan, other = probe.general_plan, ExcitationPlan(steps=probe.general_plan.steps)
    rows = []
    with probe.instance() as first, probe.instance() as second:
        probe.begin(first, plan)
        probe.begin(second, other)
        for k in range(len(probe.expected_rows)):
            rows += probe.run_steps(first, plan, k, k + 1)
            probe.run_steps(second, other, k, k + 1)
    yield from probe.deviations(rows, probe.expected_rows, "{}, as without a second instance")


def saved_state(probe: Probe) -> Iterator[str]:
    """A run from a restored state continues as it did from the saved one."""
    if not probe.fmu.interface.canGetAndSetFMUstate:
        return
    plan, half = probe.general_plan, len(probe.expected_rows) // 2
    with probe.instance() as instance:
        probe.begin(instance, plan)
        probe.run_steps(instance, plan, 0, half)
        state = instance.state()
        after = probe.run_steps(instance, plan, half)
        yield from probe.deviations(
            after, probe.expected_rows[half:], f"after the state was taken at step {half}: {{}}"
        )
        instance.restore_state(state)
        after = probe.run_steps(instance, plan, half)
    yield from probe.deviations(after, probe.expected_rows[half:], f"from the state of step {half}: {{}}")


def serialised_state(probe: Probe) -> Iterator[str]:
    """Another instance continues from a serialised state as the first one did."""
    if not probe.model.saves_state:
        return
    plan, half = probe.general_plan, len(probe.expected_rows) // 2
    with probe.instance() as instance:
        probe.begin(instance, plan)
        probe.run_steps(instance, plan, 0, half)
        content = instance.save()
    with probe.instance() as other:
        other.restore(content)
        after = probe.run_steps(other, plan, half)
    text = f"another instance, from the bytes of the state of step {half}: {{}}"
    yield from probe.deviations(after, probe.expected_rows[half:], text)


def stop_time(probe: Probe) -> Iterator[str]:
    """A step past the stop time is an error, or ends the run (FMI 2.0.4, section 2.1.6)."""
    if probe.model.interface == "model-exchange":  # its time is set from outside
        return
    *allowed, (t, h) = probe.points(ExcitationPlan(steps=MIN_STEPS))
    if not allowed:
        return
    with probe.instance() as instance:
        instance.start({}, probe.start, stop=t)
        if not all(instance.advance(*point) for point in allowed):
            return
        with contextlib.suppress(SimulatorError):
            if instance.advance(t, h):
                yield f"a step from {t} to {t + h} is done, though stopTime = {t}: expected it refused"


FIRST = (runs, getters)
"""the others rely on these"""
RULES = (start_values, finite_outputs, variable_steps, repeatable)
COMPARED = (inputs_set_twice, reset, instances, saved_state, serialised_state)
"""Rules for FMUs whose runs are repeatable"""
LAST = (stop_time,)
"""they leave a failed instance, which may disturb others"""
