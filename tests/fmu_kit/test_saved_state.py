"""Saved states that were damaged or made up: refused in words, or taken over as values of the right types."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit.failure import Failure
from fmu_kit.saved_state import DEEPEST, deserialise, serialise
from fmu_kit.slave import Slave
from plant_fmu.slave import QuadrotorPlant
from tests.extent import sample, tries
from tests.slaves import assert_fails

MODELS: tuple[type[Slave], ...] = (QuadrotorPlant, UnifiedController)


def saved(model: type[Slave]) -> Any:
    """The state of a model that has been stepped, as JSON gives it back."""
    slave = model(instance_name="saved")
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    slave.do_step(0.0, 0.01)
    return deserialise(model._fmu_state_to_bytes(slave._get_fmu_state()))


def restored(model: type[Slave], state: Any) -> Slave:
    """A new instance that has taken over the state from its bytes."""
    slave = model(instance_name="restored")
    slave._set_fmu_state(model._fmu_state_from_bytes(serialise(state)))
    return slave


@pytest.mark.parametrize("model", MODELS)
def test_what_a_slave_saves_is_taken_over(model: type[Slave]) -> None:
    state = saved(model)
    assert json.loads(json.dumps(restored(model, state)._get_fmu_state())) == state


def nested(levels: int) -> bytes:
    return b'{"a": ' + b"[" * levels + b"]" * levels + b"}"


@pytest.mark.parametrize(
    "content", [b"[" * 1000, nested(1000), nested(900), nested(DEEPEST), b'{"a": ' + b"9" * 5000 + b"}", b"\xff", b"7"]
)
def test_bytes_that_no_slave_has_saved_are_an_empty_state(content: bytes) -> None:
    assert deserialise(content) == {}


def test_nesting_that_is_allowed_is_read() -> None:
    assert deserialise(nested(DEEPEST - 1)) != {}


@pytest.mark.parametrize("model", sample([*MODELS], 1))
def test_a_flipped_bit_of_the_bytes_is_refused_or_changes_nothing(model: type[Slave]) -> None:
    state, refused = saved(model), 0
    content = serialise(state)
    places = sample(range(len(content)), 400)
    for place in places:
        flipped = bytearray(content)
        flipped[place] ^= 1 << place % 8
        if (found := deserialise(bytes(flipped))) != state:
            refused += 1
            slave = model(instance_name="damaged")
            assert_fails(lambda: slave._set_fmu_state(found), "FMU state (")  # noqa: B023
    assert refused > 0.99 * len(places)


def test_a_state_whose_checksum_is_another_is_refused_in_words() -> None:
    content = serialise(saved(QuadrotorPlant)).replace(b"9.81", b"9.91")
    slave = QuadrotorPlant(instance_name="damaged")
    words = "FMU state (its bytes): expected them as they were serialised, their checksum is another"
    assert_fails(lambda: slave._set_fmu_state(deserialise(content)), words)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("model", "\ud800", r"('\ud800', "),
        ("reals", 7, "FMU state (model, number of Reals)"),
        ("others", [[1e400, 0]], "FMU state (others) = "),
        ("others", [[0, 0]], "FMU state (others) = [0]: expected "),
        ("phase", "3", "FMU state (phase) = '3': expected of type int"),
        ("phase", 77, "77 is not a valid Phase"),
        ("start_time", None, "FMU state (start_time) = None"),
        ("stale", 0, "FMU state (stale) = 0: expected of type bool"),
        ("internal", {}, "FMU state (internal) = {}: expected what the model saves"),
        ("internal", {"actuators": [1.0, 2.0, 3.0, "x"]}, "FMU state (internal) = "),
    ],
)
def test_a_state_with_another_value_is_refused_in_words(key: str, value: Any, words: str) -> None:
    state = {**saved(QuadrotorPlant), key: value}
    assert_fails(lambda: restored(QuadrotorPlant, state), words)


@pytest.mark.parametrize("value", ["1", None, True, [1.0], 10**400])
def test_a_real_that_is_no_float_is_refused_by_name(value: Any) -> None:
    state = saved(QuadrotorPlant)
    state["reals"][0] = value
    assert_fails(lambda: restored(QuadrotorPlant, state), "FMU state (thrust) = ", "expected a float")


@pytest.mark.parametrize("value", [2**31, -(2**31) - 1, 1.5, "1", True, None])
def test_a_count_that_is_no_integer_of_32_bits_is_refused_by_name(value: Any) -> None:
    state = saved(UnifiedController)
    reference = UnifiedController._index["sample_count"]
    state["others"] = [[vr, value if vr == reference else old] for vr, old in state["others"]]
    assert_fails(lambda: restored(UnifiedController, state), "FMU state (sample_count) = ", "an integer of 32 bits")


def test_a_parameter_out_of_range_is_refused_as_it_is_when_set() -> None:
    state = saved(QuadrotorPlant)
    state["reals"][QuadrotorPlant._index["mass"]] = -1.0
    assert_fails(lambda: restored(QuadrotorPlant, state), "mass = -1.0: expected a finite value > 0")


# -- any damage -----------------------------------------------------------------------------------------------

SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
)


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to everything in a state."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from places(inner, (*path, key))


SAVED = {model: saved(model) for model in MODELS}
PLACES = {model: [path for path in places(SAVED[model]) if path] for model in MODELS}


@settings(max_examples=tries(300, sampled=12))
@given(st.data())
def test_a_state_damaged_anywhere_is_refused_or_gives_values_that_can_be_read(data: st.DataObject) -> None:
    model = data.draw(st.sampled_from(MODELS))
    state = json.loads(json.dumps(SAVED[model]))
    *way, last = data.draw(st.sampled_from(PLACES[model]))
    inner = state
    for key in way:
        inner = inner[key]
    if isinstance(inner, dict) and data.draw(st.booleans()):
        del inner[last]
    else:
        inner[last] = data.draw(VALUES)
    slave = model(instance_name="damaged")
    content = model._fmu_state_from_bytes(serialise(state))
    model._fmu_state_to_bytes(content)
    try:
        slave._set_fmu_state(content)
        slave.do_step(0.01, 0.01)
    except Failure as failure:
        repr(failure).encode()
    reals = [i for i, v in enumerate(slave.variables) if v.type == "Real"]
    assert all(type(value) is float for value in slave.get_real(reals))
    for vr in slave._others:
        get = slave.get_boolean if slave.variables[vr].type == "Boolean" else slave.get_integer
        assert -(2**31) <= get([vr])[0] < 2**31


@given(st.binary(max_size=60) | VALUES.map(lambda value: json.dumps(value).encode()))
def test_no_bytes_make_the_reader_raise(content: bytes) -> None:
    assert isinstance(deserialise(content), dict)
