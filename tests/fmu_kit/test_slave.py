"""A slave of a few lines fulfils FMI: it needs only its variables and a step."""

from pathlib import Path
from typing import Any

import pytest

from fmu_kit.assigned_names import expect_declared
from fmu_kit.failure import Failure
from fmu_kit.interface import FixedParameter, Input, Output
from fmu_kit.slave import Slave
from fmu_kit.variables import Variable


class Sum(Slave):
    """A sum."""

    u = Input("to be summed", "m")
    sum = Output("so far", "m")
    gain = FixedParameter("of it", "1", 2.0, above=0.0)
    on = Input("whether it sums", start=True)
    count = Output("of steps", None, 0)

    def step(self, t: float, h: float) -> None:
        if self.on:
            self.sum = self.sum + self.gain * self.u
        self.count = self.count + 1


class Switch(Slave):
    """A switch."""

    u = Input()
    high = Output(start=False)

    def initialise(self, t: float) -> None:
        self.high = self.u > 1.0

    def step(self, t: float, h: float) -> None:
        self.initialise(t)


def started(kind: type[Slave], u: float = 0.0) -> Any:
    slave = kind(instance_name="s")
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.set_real([0], [u])
    return slave


def test_a_slave_needs_variables_and_a_step_only() -> None:
    slave = started(Sum, 3.0)
    slave.exit_initialization_mode()
    slave.do_step(0.0, 0.1)
    slave.set_boolean([3], [False])
    slave.do_step(0.1, 0.1)
    assert (slave.get_real([1]), slave.get_integer([4]), slave.get_boolean([3])) == ([6.0], [2], [False])


def test_its_state_is_saved_and_put_back_with_nothing_said_about_it() -> None:
    slave = started(Sum, 3.0)
    slave.exit_initialization_mode()
    slave.do_step(0.0, 0.1)
    state = slave._get_fmu_state()
    slave.do_step(0.1, 0.1)
    other = Sum(instance_name="other")
    other._set_fmu_state(state)
    other.do_step(0.1, 0.1)
    assert other._get_fmu_state() == slave._get_fmu_state()


def test_its_parameters_are_checked_all_the_same() -> None:
    slave = started(Sum)
    slave.set_real([2], [0.0])
    with pytest.raises(Failure, match=r"gain = 0\.0: expected .*> 0"):
        slave.exit_initialization_mode()


def test_a_boolean_asked_for_first_has_seen_the_inputs_of_initialisation() -> None:
    slave = started(Switch, 2.0)
    assert slave.get_boolean([1]) == [True]
    slave.set_real([0], [0.5])
    assert slave.get_boolean([1]) == [False]


def test_variables_as_a_list_are_refused_where_they_are_declared() -> None:
    u = Variable(name="u", description="", causality="input", variability="continuous")
    with pytest.raises(TypeError, match=r"Listed\.variables: expected variables as attributes"):
        type("Listed", (Slave,), {"variables": (u,)})


def test_an_output_whose_dependencies_are_no_variables_is_refused_where_it_is_declared() -> None:
    class Moving(Slave):
        start = FixedParameter("its start", "m", 0.0, name="initial.position")
        position = Output("its position", "m")

        @classmethod
        def initial_dependencies(cls, output: str) -> frozenset[str]:
            return frozenset({f"initial.{output}"})

        def step(self, t: float, h: float) -> None: ...

    with pytest.raises(TypeError, match=r"initial_dependencies of speed: there is no initial\.speed"):
        type("Faster", (Moving,), {"speed": Output("its speed", "m/s")})


def test_an_attribute_that_a_method_sets_without_declaring_it_is_refused_with_its_line_whatever_sets_it() -> None:
    class Mistyped(Sum):
        @property
        def twice(self) -> float:
            return 2.0 * self.sum

        def _keep(self) -> None:
            self._kept = self.count = 1
            if self._kept > 2:
                self.sum, self.som = 1.0, 2.0  # never reached

    with pytest.raises(AttributeError) as error:
        expect_declared(Mistyped)
    line = next(
        i for i, text in enumerate(Path(__file__).read_text("utf-8").splitlines(), 1) if "never reached" in text
    )
    assert f"test_slave.py, line {line}: self.som: no such variable; expected sum, count, or a name" in str(error.value)
    expect_declared(Sum)


def test_an_attribute_or_a_name_that_a_method_only_reads_is_refused_where_nothing_declares_it() -> None:
    class Misread(Sum):
        _kept = 1.0

        def step(self, t: float, h: float) -> None:
            self.sum += self.gain * self._kept * self.cuont

    with pytest.raises(
        AttributeError, match=r"line \d+: self\.cuont: no such variable; expected u, sum, gain, on, count, or"
    ):
        expect_declared(Misread)

    class Misnamed(Sum):
        def step(self, t: float, h: float) -> None:
            def added(x: float) -> float:
                return x + abs(GIAN)  # type: ignore[name-defined]  # noqa: F821

            self.sum = added(self.sum)

    with pytest.raises(AttributeError, match=r"line \d+: GIAN: expected a name of its module or of Python"):
        expect_declared(Misnamed)
