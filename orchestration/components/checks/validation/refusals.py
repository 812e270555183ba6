"""Rules of this project on calls that must be refused, and on a run that must not be."""

import math
from collections.abc import Callable, Iterator

from orchestration.components.checks.validation.excitation import PLAIN
from orchestration.components.checks.validation.instance import Value
from orchestration.components.checks.validation.probe import Probe
from orchestration.components.fmi.instance import start_value
from orchestration.components.fmi.read_description import Variable
from orchestration.foundation.basics.errors import SimulatorError


def general_run(probe: Probe) -> Iterator[str]:
    """Parameters near their starts, moving inputs and uneven steps are accepted; other runs rely on that."""
    try:
        probe.run(probe.full_plan)
    except SimulatorError as error:
        yield f"with parameters near their starts, moving inputs and uneven steps: {error}"


def fixed_parameters(probe: Probe) -> Iterator[str]:
    """A fixed parameter cannot be set after initialisation, not even to its value."""
    for v in probe.elements_of("parameter"):
        if v.variability == "fixed" and _continues_with(probe, v, start_value(v), initialised=True):
            yield f"{v.name}: set after initialisation, expected a fixed parameter to be refused"


def bounds_enforced(probe: Probe) -> Iterator[str]:
    """A parameter outside its bounds is refused at initialisation, a tunable one at the next step, at the latest."""
    for v in probe.elements_of("parameter"):
        for bound, sign in ((v.minimum, -1.0), (v.maximum, 1.0)):
            if bound is None:
                continue
            outside = bound + sign * max(1.0, abs(bound))
            value = outside if v.kind == "Real" else int(outside)
            moments = (False, True) if v.variability == "tunable" else (False,)
            for initialised in moments:
                if _continues_with(probe, v, value, initialised=initialised):
                    when = "after" if initialised else "before"
                    yield f"{v.name} = {value:g} set {when} initialisation: expected it refused, its bound is {bound:g}"


def not_finite_refused(probe: Probe) -> Iterator[str]:
    """A value that is not finite is refused when it is set, so that the message names the variable."""
    for v in (*probe.inputs, *probe.elements_of("parameter")):
        if v.kind != "Real":
            continue
        cases = [(math.nan, False)]
        if v.causality == "input" or v.variability == "tunable":
            cases += [(math.nan, True), (math.inf, True)]
        for value, initialised in cases:
            if _can_set(probe, v, value, initialised=initialised):
                when = "after" if initialised else "before"
                yield f"{v.name} = {value} set {when} initialisation: expected the call to be refused"
                break


def consecutive_steps(probe: Probe) -> Iterator[str]:
    """A step that does not begin at the end of the last one is refused; FMI leaves that to the master."""
    for shift, where in ((-1.0, "at the beginning of the step before"), (1.0, "a step after its end")):
        with probe.instance() as instance:
            probe.begin(instance, PLAIN)
            (t, h), *_ = probe.points(PLAIN)
            instance.advance(t, h)
            if _succeeds(lambda: instance.advance(t + h + shift * h, h)):  # noqa: B023
                yield f"a second step begins {where}: expected it refused"


def stop_before_start(probe: Probe) -> Iterator[str]:
    """A stop time before the start time is refused."""
    with probe.instance() as instance:
        if _succeeds(lambda: instance.begin({}, probe.start, stop=probe.start - probe.step)):
            yield f"stopTime = {probe.start - probe.step} accepted, with startTime = {probe.start}: expected it refused"


def terminated_once(probe: Probe) -> Iterator[str]:
    """A terminated instance cannot be terminated again."""
    with probe.instance() as instance:
        probe.begin(instance, PLAIN)
        instance.terminate()
        if _succeeds(instance.terminate):
            yield f"fmi{probe.fmu.version}Terminate succeeds twice: expected the second refused"


def _succeeds(call: Callable[[], object]) -> bool:
    """Whether the FMU carries out a call."""
    try:
        call()
    except SimulatorError:
        return False
    return True


def _continues_with(probe: Probe, v: Variable, value: Value, *, initialised: bool) -> bool:
    """Whether the FMU continues with a value: through initialisation, or through a step."""
    try:
        with probe.instance() as instance:
            if initialised:
                probe.begin(instance, PLAIN)
                instance.put({v.name: value})
                instance.advance(probe.start, probe.step)
            else:
                instance.put({v.name: value})
                probe.begin(instance, PLAIN)
    except SimulatorError:
        return False
    return True


def _can_set(probe: Probe, v: Variable, value: Value, *, initialised: bool) -> bool:
    """Whether the call that sets the value succeeds."""
    with probe.instance() as instance:
        if initialised:
            probe.begin(instance, PLAIN)
        try:
            instance.put({v.name: value})
        except SimulatorError:
            return False
    return True


RULES = (
    general_run,
    fixed_parameters,
    bounds_enforced,
    not_finite_refused,
    consecutive_steps,
    stop_before_start,
    terminated_once,
)
