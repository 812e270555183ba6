"""Expectations of systems with computers and networks of deterministic timing."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.component import SamplingOnArrival
from orchestration.systems.system.computers import Arrivals, Computer, Message, Network, Task
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import changed
from orchestration.theory.exact.expect import expect
from orchestration.theory.exact.loops import expect_same_steps
from orchestration.theory.exact.timing import sampled_tasks
from orchestration.theory.stability import known_loops
from orchestration.theory.stability.matrices import Components, SampledSystem
from orchestration.theory.stability.periodic_schedule import periodic_schedule
from quadcosim import run
from tests.examples.common import native_example as example
from tests.extent import sample
from tests.places import EXAMPLES

DELAY, DELAY_JITTER, LOSS = (f"connections.command.{key}" for key in ("delay", "delay_jitter", "loss"))


def on_a_computer(name: str, computer: Computer | None = None, network: Network | None = None, **keys: Any) -> System:
    """An example whose controller is a task, by itself or beside those of `computer`; its command is not late."""
    whole = changed(example(name), {DELAY: 0.0})
    controller = replace(whole.components["controller"], sampling=None)
    tasks = {"control": Task(component="controller", **keys), **({} if computer is None else computer.tasks)}
    node = replace(computer or Computer(), tasks=tasks)
    components = {**whole.components, "controller": controller}
    return replace(whole, components=components, computers={"node": node}, networks={"bus": network} if network else {})


def of(system: System, **how: Any) -> dict[str, float]:
    """The objectives of a system with the radius of its loop."""
    found = expect(system, **how)
    values = {name: value for name, value in found.objectives.items() if value is not None}
    return {**values, "radius": found.mean_square_radius}


# -- known answers -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("execution", "how"), [(0.0, {}), (0.1, {}), (0.1, {"as_simulated": True}), (0.4, {"horizon": 7.3})], ids=str
)
def test_one_task_alone_costs_what_a_delay_of_its_execution_does(execution: float, how: dict[str, Any]) -> None:
    by_delay = example("minimum_variance", {DELAY: execution})
    by_task = on_a_computer("minimum_variance", period=1.0, execution=execution)
    assert of(by_task, **how) == pytest.approx(of(by_delay, **how), rel=1e-9)


@pytest.mark.parametrize("own", [{LOSS: 0.2}, {DELAY_JITTER: 0.3}, {DELAY: 0.7, LOSS: 0.1}], ids=str)
def test_what_is_left_to_chance_after_a_job_is_done_counts_on_top(own: dict[str, float]) -> None:
    by_delay = example("minimum_variance", {**own, DELAY: 0.1 + own.get(DELAY, 0.0)})
    by_task = changed(on_a_computer("minimum_variance", period=1.0, execution=0.1), own)
    assert of(by_task) == pytest.approx(of(by_delay), rel=1e-9)


@pytest.mark.parametrize("late", sample([0.0085, 0.002], 1))
def test_what_is_written_at_a_deadline_beyond_the_period_costs_what_that_delay_does(late: float) -> None:
    by_delay = example("distributed_servo", {DELAY: late})
    by_task = on_a_computer("distributed_servo", period=0.006, execution=0.001, deadline=late, write="deadline")
    assert of(by_task) == pytest.approx(of(by_delay), rel=1e-9)


BYTE_IN_1_5_MS = Network(
    kind="first-come-first-served", bit_rate=8 / 0.0015,
    messages={
        "angle": Message(connection="measurement", bytes=1, period=0.006),
        "command": Message(connection="command", bytes=1),
    },
)  # fmt: skip


@pytest.mark.parametrize("by_task", [True, False], ids=["task", "by itself"])
def test_a_servo_over_a_network_and_back_costs_what_jitterbug_says(*, by_task: bool) -> None:
    """Of its table: two delays of 1.5 ms. The controller runs whenever an angle arrives."""
    system = on_a_computer("distributed_servo", network=BYTE_IN_1_5_MS, on="measurement", deadline=0.006)
    if not by_task:
        controller = replace(system.components["controller"], sampling=SamplingOnArrival(on="measurement"))
        system = replace(system, components={**system.components, "controller": controller}, computers={})
    assert expect(system).objectives["J"] == pytest.approx(86.2175992472, rel=1e-11)


# -- beside others -----------------------------------------------------------------------------------------------

URGENT = {"urgent": Task(period=0.004, execution=0.0011, offset=0.0003)}
LOAD = {**URGENT, "slow": Task(period=0.012, execution=0.003, priority=3)}
CAN = Network(
    kind="can", bit_rate=125e3, messages={
        "command": Message(connection="command", bytes=8, identifier=2),
        "others": Message(bytes=8, period=0.004, identifier=1),
    },
)  # fmt: skip
TDMA = Network(
    kind="tdma", bit_rate=125e3, slots=(0.001, 0.0006),
    messages={"command": Message(connection="command", bytes=8, slot=1)},
)  # fmt: skip


@pytest.mark.parametrize(
    ("computer", "keys", "network"),
    sample(
        [
            (Computer(switch=1e-5, tasks=LOAD), {}, None),
            (Computer(scheduling="earliest-deadline-first", preemptive=False, tasks=LOAD), {"deadline": 0.002}, None),
            (Computer(scheduling="first-come-first-served", tasks=LOAD), {"offset": 0.0031}, None),
            (Computer(tasks=LOAD), {"read": "release", "write": "deadline", "deadline": 0.005}, None),
            (Computer(tasks=LOAD), {"overrun": "abort", "deadline": 0.002}, None),
            (Computer(tasks=LOAD), {"overrun": "skip", "execution": 0.0045}, None),
            (Computer(tasks=LOAD), {}, CAN),
            (Computer(tasks=LOAD), {}, TDMA),
            (Computer(tasks=URGENT, clock_ratio=0.8), {}, None),
        ],
        5,
    ),
    ids=sample(["switch", "deadlines", "first come", "logical", "abort", "skip", "can", "tdma", "clock"], 5),
)
def test_over_a_horizon_it_is_what_a_run_prints(
    computer: Computer, keys: dict[str, Any], network: Network | None
) -> None:
    """Without noise, to rounding: jobs and frames are late by what differs from one to the next."""

    def from_an_angle(system: System) -> System:
        angle = "components.servo.parameters.initial.angle"
        system = changed(system, {angle: 1.0, "sources.disturbance.noise": 0.0, "stop_time": 0.05})
        return replace(system, operating_point={angle: 0.0})

    task = {"period": 0.006, "execution": 0.001, "priority": 2, **keys}
    system = from_an_angle(on_a_computer("distributed_servo", computer, network, **task))
    printed = run(system).metrics["J"]
    assert expect(system, as_simulated=True, horizon=0.05).objectives["J"] == pytest.approx(printed, rel=1e-9)
    assert printed != pytest.approx(
        run(from_an_angle(example("distributed_servo", {DELAY: 0.0}))).metrics["J"], rel=1e-3
    )


def test_a_stationary_mean_is_what_means_over_long_horizons_come_to() -> None:
    system = on_a_computer(
        "distributed_servo", Computer(switch=1e-5, tasks=LOAD), period=0.006, execution=0.001, priority=2
    )
    stationary, short, long = (expect(system, horizon=end).objectives["J"] for end in (None, 1.2, 2.4))
    assert stationary is not None
    assert short is not None
    assert long is not None
    assert 2.0 * long - short == pytest.approx(stationary, rel=1e-9)  # of what it takes to get there nothing is left


# -- three servos ------------------------------------------------------------------------------------------------


def test_by_rates_the_slowest_of_three_servos_grows_as_its_radius_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its jobs pile up, and make nobody late: no task has less to say. The overload is said here and of a run."""
    servos, said = example("three_servos"), list[str]()
    monkeypatch.setattr(known_loops, "warn", said.append)
    found = expect(servos)
    assert found.period == pytest.approx(0.06)
    assert found.mean_square_radius > 1.0
    flown = run(replace(servos, stop_time=6.0))
    overload = (
        "computers.node: overloaded, its tasks demand 123.333 % of its time: jobs of slow wait, ever more of them"
    )
    assert said == [*flown.warnings] == [f"{overload}; what is computed is of the jobs that start"]
    angle = flown.signals["slow_servo.angle"]
    first, last = (np.abs(part).max() for part in (angle[: len(angle) // 3], angle))
    assert math.log(last / first) / (4.0 / found.period) == pytest.approx(
        0.5 * math.log(found.mean_square_radius), rel=0.01
    )


def test_with_less_to_do_all_three_die_out_as_they_do_in_a_run() -> None:
    changes = {f"computers.node.tasks.{name}.execution": 0.0015 for name in ("slow", "middle", "fast")}
    steps = {f"components.{name}_servo.step": 0.0005 for name in ("slow", "middle", "fast")}
    servos = replace(
        example("three_servos", {**changes, **steps}), criterion=Criterion(),
        objectives={"slow": "mean(slow_servo.angle ** 2)", "both": "mean(middle_servo.angle * fast_servo.angle)"},
    )  # fmt: skip
    for scheduling in ("fixed-priority", "earliest-deadline-first"):
        system = changed(servos, {"computers.node.scheduling": scheduling})
        found = expect(system, as_simulated=True, horizon=0.1)
        assert found.mean_square_radius < 1.0
        printed = run(replace(system, stop_time=0.1)).metrics
        assert found.objectives == pytest.approx({name: printed[name] for name in servos.objectives}, rel=1e-9)


# -- what is refused ---------------------------------------------------------------------------------------------


def test_by_deadlines_all_three_fall_behind_and_none_repeats_itself() -> None:
    servos = example("three_servos", {"computers.node.scheduling": "earliest-deadline-first"})
    named = (
        r"^computers\.node: overloaded, its tasks demand 123\.333 % of its time: jobs of slow and middle and fast wait"
    )
    with pytest.raises(UsageError, match=rf"{named}, .* computers\.node\.tasks\.slow: falls behind by \d+ jobs in "):
        expect(servos)


def test_messages_that_fall_behind_are_named() -> None:
    servo = load_system(EXAMPLES / "three_servos/can.toml")
    assert expect(servo).mean_square_radius < 1.0
    with pytest.raises(UsageError, match=r"^networks\.bus\.messages\.(command|angle): falls behind by \d+ messages in"):
        expect(changed(servo, {"networks.bus.messages.others.period": 0.00028}))


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("computers.node.tasks.control.execution", Distribution(uniform=(0.0, 0.001))),
        ("computers.node.tasks.load.jitter", 0.001),
        ("computers.node.tasks.sporadic.arrivals", None),
        ("networks.bus.messages.others.jitter", 0.001),
        ("networks.bus.error", 0.1),
        ("connections.measurement.delay_jitter", 0.001),
        ("connections.measurement.loss", 0.1),
    ],
)
def test_what_leaves_the_timetable_to_chance_is_refused_by_name(place: str, value: Any) -> None:
    load = {"load": Task(period=0.006, execution=0.001)}
    if value is None:
        load["sporadic"] = Task(arrivals=Arrivals(poisson=100.0), execution=0.001)
    angle = {"angle": Message(connection="measurement", bytes=8, identifier=3, period=0.006)}
    bus = replace(CAN, messages={**CAN.messages, **angle})
    system = on_a_computer("distributed_servo", Computer(tasks=load), bus, on="measurement", deadline=0.006)
    with pytest.raises(UsageError) as refused:
        expect(system if value is None else changed(system, {place: value}))
    assert str(refused.value).startswith(f"{place}: ")
    assert str(refused.value).endswith(
        "expected one value (the mean, or the largest), or an average over runs (quadcosim sweep)"
    )


def test_periods_that_have_nothing_in_common_are_refused() -> None:
    load = Computer(tasks={"load": Task(period=0.0070001, execution=0.001, priority=2)})
    with pytest.raises(UsageError, match=r"jobs and messages in 12 hyperperiods of 420\.006 s"):
        expect(on_a_computer("distributed_servo", load, period=0.006, execution=0.001))


def test_a_task_that_minds_how_long_its_step_is_has_to_sample_regularly() -> None:
    none = np.zeros((0, 0))
    parts: Components = {
        "controller": SampledSystem(inputs=(), outputs=(), A=none, B=none, C=none, D=none, depends_on_step=True)
    }
    for load, fits in ((0.0, True), (0.001, False)):
        computer = Computer(tasks={"load": Task(period=0.004, execution=load)})
        system = on_a_computer("distributed_servo", computer, period=0.006, execution=0.001, priority=2)
        tasks = sampled_tasks(system, periodic_schedule(system))
        assert tasks[0].numbers == (0, 1)
        if fits:
            expect_same_steps(system, tasks, parts)
        else:
            with pytest.raises(
                UsageError,
                match=r"which is .* to .* s, not its period of 0\.006 s; expected no other task.*, or a law with",
            ):
                expect_same_steps(system, tasks, parts)
