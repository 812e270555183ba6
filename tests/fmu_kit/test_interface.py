"""Variables that are declared as attributes: what FMI sees of them, and what a law may do with them."""

import enum
import re
from dataclasses import dataclass
from typing import Any, NamedTuple

import pytest

from fmu_kit.algebra import ZERO, Inertia, Quaternion, Vec3
from fmu_kit.errors import FmuError
from fmu_kit.failure import Failure
from fmu_kit.interface import (
    Declaration,
    FixedParameter,
    Input,
    Local,
    Output,
    Parameter,
    State,
    read_fields,
    set_fields,
)
from fmu_kit.slave import Slave


class Mode(enum.IntEnum):
    OFF = 1
    ON = 2


class Law(Slave):
    """Everything that can be declared.

    And a second paragraph, which the FMU does not show.
    """

    position = Input("measured", "m", ZERO)
    attitude = Input("measured", "1", Quaternion(ZERO, 1.0))
    x = Input("measured", "m")
    angle = State("evolves", "rad", 0.5)
    place = State("evolves", "m", Vec3(1.0, 2.0, 3.0))
    force = Output("command", "N", ZERO)
    is_on = Output("whether it is on", start=False)
    samples = Local("so far", unit=None, start=0)
    gain = Parameter("of x", "N/m", 2, minimum=0.0)
    first = Parameter("at the start", "N", 1.5, name="initial.force")
    mode = Parameter("what it does", start=Mode.ON)

    def step(self, t: float, h: float) -> None:
        self.force = Vec3(-self.gain * self.x, self.position.y, self.first)
        self.is_on = self.mode == Mode.ON
        self.samples = self.samples + 1
        self.angle = self.angle + h


def ready(law: Slave) -> Slave:
    law.setup_experiment(0.0)
    law.enter_initialization_mode()
    law.exit_initialization_mode()
    return law


def test_attributes_are_fmi_variables_in_order_reals_first():
    assert [v.name for v in Law.variables] == [
        "position.x", "position.y", "position.z", "attitude.x", "attitude.y", "attitude.z", "attitude.w", "x", "angle",
        "place.x", "place.y", "place.z", "force.x", "force.y", "force.z", "gain", "initial.force", "initial.angle",
        "initial.place.x", "initial.place.y", "initial.place.z", "is_on", "samples", "mode", "mode_index",
    ]  # fmt: skip
    found = {v.name: v for v in Law.variables}
    assert {name: found[name].type for name in ("gain", "is_on", "samples", "mode")} == {
        "gain": "Real", "is_on": "Boolean", "samples": "Integer", "mode": "Enumeration",
    }  # fmt: skip
    assert (found["attitude.w"].start, found["initial.place.y"].start, found["gain"].minimum) == (1.0, 2.0, 0.0)
    assert [found[name].variability for name in ("force.x", "angle", "initial.angle", "gain")] == [
        "discrete", "continuous", "fixed", "tunable",
    ]  # fmt: skip


class Motors(NamedTuple):
    left: float
    right: float


def test_a_named_tuple_has_a_variable_for_each_of_its_fields():
    class Cart(Slave):
        """Two motors."""

        measured = Input("of each motor", "N", Motors(1.0, 2.0))
        force = Output("of each motor", "N", Motors(0.0, 0.0))

        def step(self, t: float, h: float) -> None:
            self.force = Motors(left=self.measured.right, right=-self.measured.left)

    cart = ready(Cart(instance_name="it"))
    assert [v.name for v in Cart.variables] == ["measured.left", "measured.right", "force.left", "force.right"]
    cart.do_step(0.0, 1.0)
    assert (cart.measured, cart.force) == (Motors(1.0, 2.0), Motors(2.0, -1.0))
    with pytest.raises(TypeError, match=r"self.force = \(1.0, 2.0\): expected a Motors"):
        cart.force = (1.0, 2.0)


def test_a_variable_says_what_is_measured_its_usual_size_and_how_it_is_displayed():
    class Told(Slave):
        """Told."""

        turn = Input("by its unit", "rad/s")
        cutoff = Parameter("by its name", "rad/s", 30.0, quantity="AngularFrequency", nominal=30.0)
        ratio = Local("of what, no unit says")

        def step(self, t: float, h: float) -> None: ...

    assert [(v.quantity, v.displayed_in, v.nominal) for v in Told.variables] == [
        ("AngularVelocity", "deg/s", None),
        ("AngularFrequency", None, 30.0),
        (None, None, None),
    ]


class Weighed(Slave):
    """What others inherit."""

    weight = FixedParameter("of it", "kg", 2.0, name="body.weight")
    drift = Local("shown", "m")
    is_shown = Parameter("a switch", start=True)


class Turned(Weighed):
    """A separate group."""

    inertia = FixedParameter("of it", "kg.m2", Inertia(xx=1.0, yy=2.0, zz=3.0, xy=0.5), name="body.inertia")


class Both(Turned):
    """Inherits groups and adds to them."""

    force = Output("command", "N", ZERO)
    mode = Parameter("what it does", start=Mode.ON)

    def step(self, t: float, h: float) -> None: ...


def test_what_is_inherited_comes_first_and_real_locals_after_all_other_reals():
    assert [v.name for v in Both.variables] == [
        "body.weight", *(f"body.inertia.{axis}" for axis in ("xx", "yy", "zz", "xy", "xz", "yz")),
        "force.x", "force.y", "force.z", "drift", "is_shown", "mode", "mode_index",
    ]  # fmt: skip
    found = {v.name: v for v in Both.variables}
    assert (found["body.weight"].variability, found["mode"].variability) == ("fixed", "tunable")
    assert [found[f"body.inertia.{axis}"].start for axis in ("yy", "xy", "yz")] == [2.0, 0.5, 0.0]


def test_an_enumeration_may_be_set_by_the_integer_beside_it_in_any_order_and_is_read_back_as_set():
    place, index = (Law._index[name] for name in ("mode", "mode_index"))
    for settings, found in [([], Mode.ON), ([(index, 1), (place, 2)], Mode.OFF), ([(place, 1), (index, 0)], Mode.OFF)]:
        law = Law()
        for variable, value in settings:
            law.set_integer([variable], [value])
        ready(law).do_step(0.0, 0.1)
        assert (law.get_integer([place]), law.is_on) == ([found], found == Mode.ON)


def test_the_integer_beside_an_enumeration_is_refused_where_it_is_no_item():
    law = Law()
    law.set_integer([Law._index["mode_index"]], [3])
    with pytest.raises(Failure, match="mode_index = 3: expected a whole number >= 0 and <= 2"):
        ready(law)


def test_a_name_that_two_variables_have_is_refused():
    taken = {"mode": Parameter(start=Mode.ON), "mode_index": Parameter(unit=None, start=1)}
    with pytest.raises(TypeError, match=r"Named\.mode_index: expected one variable of this name"):
        type("Named", (Slave,), taken)


def test_an_inertia_is_read_whole_and_refused_unless_it_is_positive_definite():
    slave = Both()
    assert [*slave.inertia] == [1.0, 2.0, 3.0, 0.5, 0.0, 0.0]
    slave.inertia = Inertia(xx=1.0, yy=1.0, zz=1.0, xy=2.0)
    words = "body.inertia.{xx,yy,zz,xy,xz,yz} = xx 1, yy 1, zz 1, xy 2, xz 0, yz 0: expected a positive definite matrix"
    with pytest.raises(FmuError, match=re.escape(words)):
        _ = slave.inertia


@dataclass(frozen=True, kw_only=True)
class Gains:
    gain: float
    first: float


class Found(NamedTuple):
    angle: float
    x: float
    force: Vec3
    nothing: float


def test_parameters_are_gathered_by_the_fields_of_a_record_with_a_prefix():
    assert read_fields(Law(), Gains) == Gains(gain=2.0, first=1.5)

    class Prefixed(Slave):
        law_gain = Parameter("of x", "N/m", 3.0)
        law_first = Parameter("at the start", "N", 4.0)

        def step(self, t: float, h: float) -> None: ...

    assert read_fields(Prefixed(), Gains, "law_") == Gains(gain=3.0, first=4.0)


def test_outputs_are_shown_by_their_names_and_what_is_given_to_the_slave_stays():
    law = Law()
    set_fields(law, Found(0.75, 9.0, Vec3(1.0, 2.0, 3.0), 4.0))
    assert (law.angle, law.x, law.force) == (0.75, 0.0, Vec3(1.0, 2.0, 3.0))


def test_a_law_reads_and_sets_its_attributes():
    law = Law()
    law.x, law.position, law.gain = 3.0, Vec3(0.0, 4.0, 0.0), 5.0
    law.step(0.0, 0.1)
    assert (law.force, law.is_on, law.samples) == (Vec3(-15.0, 4.0, 1.5), True, 1)


def test_states_start_from_their_parameters():
    law = Law()
    law.set_real([law._index["initial.angle"]], [0.25])
    ready(law)
    assert (law.angle, law.place) == (0.25, Vec3(1.0, 2.0, 3.0))
    law.do_step(0.0, 0.5)
    assert law.angle == 0.75


def test_its_description_is_the_first_line_of_its_docstring():
    assert Law.description == "Everything that can be declared"


def test_first_outputs_depend_on_inputs_where_the_law_says_how_it_begins():
    class Begins(Law):
        """Begins."""

        def initialise(self, t: float) -> None: ...

    assert (Law.depends_initially(), Begins.depends_initially()) == (False, True)


def test_first_outputs_depend_on_the_start_of_a_state_or_where_the_law_says_how_it_begins_on_all_that_is_given():
    class Begins(Law):
        """Begins."""

        initially_idle = frozenset({"gain"})

        def initialise(self, t: float) -> None: ...

    given = {v.name for v in Law.variables if v.causality in ("input", "parameter")}
    assert Law.initial_dependencies("angle") == {"initial.angle"}
    assert Law.initial_dependencies("force.x") == set()
    assert Begins.initial_dependencies("force.x") == Begins.initial_dependencies("angle") == given - {"gain"}


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("self.force = 1.0", "self.force = 1.0: expected a Vec3"),
        ("self.angle = Vec3(0.0, 0.0, 0.0)", "expected a number"),
        ("self.angle = None", "self.angle = None: expected a number"),
        ("self.x = 1.0", "self.x cannot be set: it is an input"),
        ("self.gain = 1.0", "self.gain cannot be set: it is a parameter"),
        ("self.angle = 1.0 / 0.0", "at t = 0.0: float division by zero, expected finite values (in "),
    ],
)
def test_what_a_law_may_not_do_is_said_in_a_line_with_its_own_place(statement, words, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(f"def law(self):\n    {statement}\n", encoding="utf-8")
    space: dict[str, Any] = {"Vec3": Vec3}
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), space)
    law = ready(type("Wrong", (Law,), {"step": lambda self, t, h: space["law"](self)})())
    with pytest.raises(Failure) as caught:
        law.do_step(0.0, 0.1)
    first = str(caught.value).partition("\n")[0]
    assert words in first
    assert f"{tmp_path.name}/mine.py, line 2" in first


def test_what_is_kept_beside_the_variables_is_not_lost_in_silence():
    class Forgetful(Law):
        """Forgets."""

        def step(self, t: float, h: float) -> None:
            self._last = t

    law = ready(Forgetful())
    law.do_step(0.0, 0.1)
    with pytest.raises(Failure, match=r"self\._last is not saved: expected a Local instead"):
        law._get_fmu_state()


@pytest.mark.parametrize("name", ["step", "description", "log_queue", "version"])
def test_names_that_every_slave_has_are_refused(name):
    with pytest.raises(TypeError, match=rf"Taken.{name}: every slave has this name"):
        type("Taken", (Slave,), {name: _named(name)})


def test_a_name_of_another_variable_of_a_base_is_refused():
    with pytest.raises(TypeError, match=r"Taken.gain: Law has a variable of this name, with causality parameter; exp"):
        type("Taken", (Law,), {"gain": Output("gain", "1")})


def test_a_unit_that_is_none_is_refused_where_it_is_written():
    with pytest.raises(ValueError, match="unit m/sq: expected powers of"):
        Input("speed", "m/sq")


@pytest.mark.parametrize("start", ["on", [1.0, 2.0], None])
def test_a_start_that_no_variable_can_have_is_refused_where_it_is_written(start):
    with pytest.raises(TypeError, match=re.escape(f"start = {start!r}: expected a number, a truth value, a member")):
        Input("measured", "m", start)


def test_a_list_is_told_what_to_write_instead():
    with pytest.raises(TypeError, match=r"in place of a list a class Row\(NamedTuple\) with 2 fields of type float$"):
        Parameter("gains", "1", [1.0, 2.0])


def test_without_author_and_licence_an_fmu_says_nothing_of_them():
    assert not {"author", "license", "copyright"} & Law.to_xml(Law()).attrib.keys()
    theirs: Any = type("Theirs", (Law,), {"author": "Ada", "license": "MIT", "copyright": "Ada, 2026"})
    attributes = theirs.to_xml(theirs()).attrib
    assert (attributes["author"], attributes["license"], attributes["copyright"]) == ("Ada", "MIT", "Ada, 2026")


def test_a_state_is_whole_without_a_word_of_the_law():
    law = ready(Law())
    law.do_step(0.0, 0.1)
    state = law._get_fmu_state()
    other = Law()
    other._set_fmu_state(state)
    assert (other.angle, other.samples) == (0.6, 1)


def _named(name: str) -> Declaration:
    declared = Output("taken", "1")
    declared.__set_name__(Slave, name)
    return declared


def test_a_start_in_the_place_of_the_unit_is_refused_in_words() -> None:
    with pytest.raises(TypeError, match=r"^unit = 0.0: expected a text, as in Parameter\('gain', \"1\", 0.0\)$"):
        Parameter("gain", 0.0)  # type: ignore[arg-type]
