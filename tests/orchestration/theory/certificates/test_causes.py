"""Loops that a computer or a network makes late: what is certified of the causes, and what refutes too much."""

import re
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.command import margin as margin_command
from orchestration.experiments.limits.evaluation import is_good
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.unit_algebra import time_text
from orchestration.simulation.requests.request import request_of
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.computers import Computer, Message, Network, Task
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.certificates import margin as certificates
from orchestration.theory.certificates.breaking import unstable_sequence
from orchestration.theory.certificates.causes import ScheduledLoop, cause_at
from orchestration.theory.certificates.certified_loop import CertifiedLoop
from orchestration.theory.certificates.check_file import AnotherLoop, check_certificate
from orchestration.theory.certificates.find_certificate import find_certificate
from orchestration.theory.certificates.margin import Certified, linear_loop_of, margin
from orchestration.theory.certificates.region import margin_region
from orchestration.theory.certificates.repeated import least_repeated
from orchestration.theory.exact.loops import Loops
from tests.examples.common import native_example as example

LOGGER = "computers.node.tasks.logger.execution"
OWN = "computers.node.tasks.control.execution"
COMMAND = "connections.command.delay_jitter"


def on_a_computer(tasks: Mapping[str, Task] | None = None, control: Any = None, **computer: Any) -> System:
    """A double integrator under u = -x - v, sampled every second by a task that takes 0.1 s, beside a logger."""
    bare = example("double_integrator")
    controller = replace(bare.components["controller"], sampling=None)
    own: Any = {"period": 1.0, "execution": 0.1, "priority": 2} | dict(control or {})
    logger = Task(period=0.5, execution=0.05, priority=1)
    node = Computer(
        **computer, tasks={"logger": logger, "control": Task(component="controller", **own), **(tasks or {})}
    )
    return replace(bare, components={**bare.components, "controller": controller}, computers={"node": node})


def on_a_bus(**sampling: Any) -> System:
    """The same law with a clock of its own, its commands on a slow bus behind other frames."""
    bare = example("double_integrator")
    controller = replace(bare.components["controller"], sampling=Sampling(period=1.0, **sampling))
    messages = {
        "status": Message(period=0.5, bytes=8, identifier=1),
        "command": Message(connection="command", bytes=8, identifier=2),
    }
    bus = Network(kind="can", bit_rate=1350.0, messages=messages)  # 0.1 s a frame
    return replace(bare, components={**bare.components, "controller": controller}, networks={"bus": bus})


@pytest.fixture(scope="module")
def loop() -> CertifiedLoop:
    return linear_loop_of(request_of(on_a_computer()))


def scheduled_loop(loop: CertifiedLoop, system: System, path: str) -> ScheduledLoop:
    cause = cause_at(system, path)
    assert cause is not None
    return ScheduledLoop(loop, system, cause)


@pytest.fixture(scope="module")
def found() -> Certified:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(certificates, "FINEST", 0.2)
        return margin(on_a_computer(), LOGGER)


def test_a_loggers_execution_is_certified_below_what_breaks_the_loop(found: Certified) -> None:
    assert found.certified is not None
    assert found.breaking is not None
    assert 0.09 < found.certified < 0.13
    assert found.breaking == pytest.approx(0.4, abs=1e-3)  # twice that and the control fill the processor
    assert found.breaking_sequence == (("2 jobs", (found.breaking,)),)
    assert found.largest < 0.45
    assert found.unproved is not None
    assert found.certified < found.unproved < found.breaking
    assert f"; no proof was found for {time_text(found.unproved)}, one of" in found.verdict


def test_what_breaks_a_loop_does_so_where_it_is_run(found: Certified) -> None:
    """It is a fact of the system, not of its windows."""
    assert found.breaking is not None
    good = [is_good(quadcosim.run(changed(on_a_computer(), {LOGGER: share * found.breaking})).metrics)
            for share in (0.99, 1.01)]  # fmt: skip
    assert good == [True, False]


def test_in_windows_that_are_a_little_wider_a_sequence_grows(loop: CertifiedLoop) -> None:
    """No scheduler deals it; but of the windows alone no more can be proved."""
    windows = scheduled_loop(loop, on_a_computer(), LOGGER)
    assert unstable_sequence(windows.family(0.12), 2) is None
    assert unstable_sequence(windows.family(0.14), 2) is not None


def test_what_is_certified_dies_out_whatever_the_logger_takes(found: Certified) -> None:
    for seed, control in ((1, {}), (2, {"offset": 0.45})):
        system = replace(on_a_computer(control=control), seed=seed)
        random = changed(system, {LOGGER: Distribution(values=(0.0, found.certified or 0.0))})
        assert is_good(quadcosim.run(random).metrics)


def test_a_certificate_says_up_to_which_value_it_is_one_of_a_system(found: Certified, tmp_path: Path) -> None:
    path = found.save(tmp_path / "certificate.json")
    assert check_certificate(path).up_to is None
    own = check_certificate(path, on_a_computer())
    assert own.of == (LOGGER,)
    assert own.up_to == found.certified
    assert own.verdict.startswith(
        f"the proof holds for {LOGGER} from 0 to {time_text(own.up_to or 0.0)} of this system: "
    )
    late, *_ = margin_command._checked(path, None).lines
    assert re.match(
        rf"late +{len(own.ranges)} parts \(each with --json\) within 0 s to \S+ ms and 0 s to \S+ ms, any", late
    )
    for other in ({"execution": 0.05}, {"period": 1.01}, {"read": "release"}):
        with pytest.raises(AnotherLoop):
            check_certificate(path, on_a_computer(control=other))


def test_more_urgent_tasks_that_do_not_vary_leave_less(found: Certified, tmp_path: Path) -> None:
    """Of the same windows: what another task takes counts as what the logger may take."""
    urgent = on_a_computer({"urgent": Task(period=1.0, execution=0.03, priority=1)})
    less = check_certificate(found.save(tmp_path / "certificate.json"), urgent)
    assert less.up_to == pytest.approx((found.certified or 0.0) - 0.03, abs=2e-9)


# -- what varies -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("control", "computer", "kinds"),
    [
        ({}, {}, 2),
        ({}, {"preemptive": False}, 1),
        ({"read": "release"}, {}, 1),
        ({"write": "deadline", "deadline": 0.2}, {}, 1),
        ({"write": "deadline", "deadline": 0.2, "read": "release"}, {}, 0),
        ({"priority": 0}, {}, 0),
    ],
)
def test_only_what_a_task_lets_vary_is_drawn(loop: CertifiedLoop, control: Any, computer: Any, kinds: int) -> None:
    family = scheduled_loop(loop, on_a_computer(control=control, **computer), LOGGER).family(0.08)
    assert {len(letter.ranges) for letter in family.letters} == {kinds}
    assert find_certificate(family, [LOGGER]) is not None


@pytest.mark.parametrize(
    ("control", "computer"),
    [
        ({"priority": 0}, {}),
        ({"priority": 0}, {"switch": 0.05}),
        ({"priority": 0, "write": "deadline", "deadline": 0.25}, {"switch": 0.05}),
        ({"priority": 0, "write": "deadline", "deadline": 0.25, "offset": 0.3}, {"switch": 0.05}),
        ({"write": "deadline", "deadline": 0.25, "read": "release"}, {}),
    ],
)
def test_where_nothing_varies_the_map_is_that_of_the_timetable(
    loop: CertifiedLoop, control: Any, computer: Any
) -> None:
    system = on_a_computer(control=control, **computer)
    family = scheduled_loop(loop, system, LOGGER).family(0.05)
    (letter,) = family.letters
    radius = np.abs(np.linalg.eigvals(family.at(letter))).max()
    assert Loops(files_of(system).models).radius(system, agree=1e-9) == pytest.approx(radius**2, rel=1e-8)


def test_where_nothing_is_made_late_all_that_is_looked_at_is_certified(tmp_path: Path) -> None:
    """Of a task that reads at its releases and writes at its deadlines, as far as it meets them."""
    logical = on_a_computer(control={"write": "deadline", "read": "release", "deadline": 0.2})
    found = margin(logical, LOGGER)
    assert found.certified == found.largest == pytest.approx(0.1, abs=1e-3)
    assert found.breaking is not None
    assert found.breaking > found.largest
    assert "(beyond, no proof is sought: computers.node.tasks.control: may respond after 0.2000" in found.verdict
    assert check_certificate(found.save(tmp_path / "certificate.json"), logical).up_to == found.largest


def test_a_sequence_that_breaks_a_loop_does_so_where_it_is_a_trace(tmp_path: Path) -> None:
    slow = on_a_computer(control={"period": 1.8, "execution": 0.018})
    slow = changed(slow, {"computers.node.tasks.logger.period": 0.9})
    cause = cause_at(slow, LOGGER)
    assert cause is not None
    tried = least_repeated(slow, cause, files_of(slow).models, Fraction(1_800_000_000))
    turns = [value for _, (value,) in tried.sequence]
    assert tried.searched.startswith(
        "in turns of 2 jobs, each 0 or the value, that repeat after at most 4 turns: values from 0 to "
    )
    assert turns == [tried.breaking] * 3 + [0.0]
    good = []
    for share in (0.99, 1.01):
        path = tmp_path / f"{share}.csv"
        path.write_text("\n".join(["taken", *(str(share * turn) for turn in turns for _ in range(2))]))
        trace = Distribution(file=path, column="taken", order="as recorded")
        good.append(is_good(quadcosim.run(changed(slow, {LOGGER: trace})).metrics))
    assert good == [True, False]


@pytest.mark.parametrize("scheduling", ["fixed-priority", "earliest-deadline-first"])
def test_of_the_laws_own_task_a_larger_value_is_never_earlier(loop: CertifiedLoop, scheduling: Any) -> None:
    system = on_a_computer(control={"deadline": 0.3}, scheduling=scheduling)
    own = scheduled_loop(loop, system, OWN)
    for value in (0.01, 0.1):
        assert own.value_of(own.family(value)) >= value


def test_of_frames_before_the_command_the_jitter_is_certified(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(certificates, "SHARES", (0.5,))
    found = margin(on_a_bus(), "networks.bus.messages.status.jitter")
    assert (found.certified, found.breaking, found.searched) == (0.5 * found.largest, None, "no sequences")
    assert "none sought that breaks the loop" in found.verdict
    up_to = check_certificate(found.save(tmp_path / "certificate.json"), on_a_bus()).up_to
    assert up_to is not None
    assert found.certified <= up_to < found.largest  # as no other value would make the command later
    monkeypatch.setattr(certificates, "MOST_STATES", 1)
    found = margin(on_a_bus(), "networks.bus.messages.status.jitter")
    assert found.certified is None
    assert "no proof sought: " in found.verdict


def with_measurements(period: float, identifier: int | None = None) -> System:
    """That law, with messages of the plant that have their own clock: on a bus of their own, or on the same one."""
    system = on_a_bus(offset=0.25)
    bus, own = system.networks["bus"], Message(connection="measurement", bytes=8, identifier=3, period=period)
    command = bus.messages["command"]
    if identifier is not None:
        messages = {"command": command, "own": replace(own, identifier=identifier)}
        return replace(system, networks={"bus": replace(bus, messages=messages)})
    alone = {"bus": replace(bus, messages={"command": command}), "field": replace(bus, messages={"own": own})}
    return replace(system, networks=alone)


@pytest.mark.parametrize("period", [0.125, 0.5, 1.0])
def test_what_a_bus_measures_is_a_sample_of_its_own(period: float) -> None:
    """Where no frame waits the map is that of the timetable."""
    system = with_measurements(period)
    own = scheduled_loop(linear_loop_of(request_of(system)), system, "networks.field.messages.own.jitter")
    family = own.family(0.0)
    (letter,) = family.letters
    radius = np.abs(np.linalg.eigvals(family.at(letter))).max()
    assert Loops(files_of(system).models).radius(system, agree=1e-9) == pytest.approx(radius**2, rel=1e-8)


def test_of_a_law_whose_messages_share_a_bus_there_is_a_family() -> None:
    """Of the measurement it is a choice whether a sample reads it, of the command a draw."""
    system, cause = with_measurements(0.5, identifier=1), "networks.bus.messages.own.jitter"
    own = scheduled_loop(linear_loop_of(request_of(system)), system, cause)
    few, more = own.family(0.01), own.family(0.1)
    assert 0.01 <= own.value_of(few) < 0.1 <= own.value_of(more) < own.largest() <= 0.5
    assert len(few.letters) < len(more.letters)


def test_a_loop_that_constant_execution_times_break_has_none() -> None:
    slow = on_a_computer(control={"period": 2.1})
    none = margin(slow, LOGGER)
    assert (none.certified, none.breaking, none.certificate) == (None, 0.0, None)


# -- what is refused ---------------------------------------------------------------------------------------------------


def test_a_delay_of_what_a_scheduler_delays_is_refused_for_its_cause() -> None:
    with pytest.raises(UsageError, match=r"^computers\.node\.tasks\.control: .* of .*control\.execution, as a cause"):
        margin(on_a_computer(), COMMAND)
    with pytest.raises(UsageError, match=r"^networks\.bus\.messages\.command: .* of the jitter of one"):
        margin(on_a_bus(), COMMAND)
    with pytest.raises(UsageError, match=r"^of = connections\.command\.loss: .*; expected limit of conn"):
        margin(on_a_computer(), "connections.command.loss")
    with pytest.raises(UsageError, match="as a cause"):
        margin_region(on_a_computer(), COMMAND, "connections.measurement.delay_jitter")


def test_where_too_many_times_vary_at_once_the_components_are_named() -> None:
    system = example("three_servos")
    at_ease = {f"computers.node.tasks.{name}.execution": 0.0005 for name in ("slow", "middle", "fast")}
    with pytest.raises(UsageError, match=r"slow\.execution: 4 times of slow and middle vary at once, of 2 at most"):
        margin(changed(system, at_ease), "computers.node.tasks.slow.execution")


def test_a_path_of_something_else_is_refused() -> None:
    with pytest.raises(UsageError, match=r"computers\.NAME\.tasks\.NAME\.execution"):
        margin(on_a_computer(), "computers.node.tasks.logger.period")
