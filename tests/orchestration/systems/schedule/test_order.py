"""The order of components at one instant, and at initialisation."""

import sys

from orchestration.simulation.engines.initial import groups
from orchestration.systems.schedule.plan import ranked
from tests.orchestration.simulation.engines.stubs import wire


def test_without_connections_the_order_is_that_of_the_file():
    assert ranked(["b", "a", "c"], []) == ("b", "a", "c")


def test_a_sender_precedes_its_receiver():
    assert ranked(["plant", "filter", "controller"], [("filter", "controller"), ("controller", "plant")]) == (
        "filter", "controller", "plant",
    )  # fmt: skip


def test_a_connection_that_closes_a_cycle_is_ignored():
    assert ranked(["a", "b"], [("b", "a"), ("a", "b")]) == ("b", "a")


def test_the_first_exchange_follows_the_dependencies():
    measurement, command = wire("plant.y", "controller.y"), wire("controller.u", "plant.u")
    depends = lambda component, output: frozenset({"y"}) if component == "controller" else frozenset()  # noqa: E731
    assert groups([command, measurement], depends) == ((1,), (0,))


def test_outputs_that_depend_on_each_other_are_one_group():
    there, back = wire("a.y", "b.u"), wire("b.y", "a.u")
    everything = lambda component, output: None  # noqa: E731
    assert groups([there, back], everything) == ((0, 1),)


def test_a_chain_of_many_needs_no_deep_stack():
    many = sys.getrecursionlimit() + 200
    chain = [wire(f"c{i}.y", f"c{i + 1}.u") for i in range(many)]
    assert groups(chain[::-1], lambda component, output: None) == tuple((i,) for i in reversed(range(many)))
