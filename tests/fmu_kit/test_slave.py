"""A slave of a few lines has all that FMI asks of it: only its variables and its step must be said."""

from typing import Any, ClassVar

import pytest

from fmu_kit.failure import Failure
from fmu_kit.slave import Slave
from fmu_kit.variables import (
    continuous_input,
    continuous_output,
    discrete_input,
    discrete_output,
    fixed_parameter,
)


class Sum(Slave):
    variables = (
        continuous_input("u", "to be summed", "m"),
        continuous_output("sum", "so far", "m"),
        fixed_parameter("gain", "of it", "1", 2.0, above=0.0),
        discrete_input("on", "whether it sums", None, True),
        discrete_output("count", "of steps", None, 0),
    )
    description = "A sum"

    def step(self, t: float, h: float) -> None:
        if self.boolean("on"):
            self.put("sum", self.real("sum") + self.real("gain") * self.real("u"))
        self.put_count("count", self.count("count") + 1)


class Switch(Slave):
    variables = (continuous_input("u", "", "1"), discrete_output("high", "", None, False))
    description = "A switch"

    def initialise(self, t: float) -> None:
        self.put_boolean("high", self.real("u") > 1.0)

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


def test_variables_out_of_order_are_refused_where_they_are_declared() -> None:
    with pytest.raises(TypeError, match=r"Disordered\.variables: expected all Reals before the others"):

        class Disordered(Sum):
            variables: ClassVar[Any] = (discrete_input("on", "", None, True), continuous_input("u", "", "1"))
