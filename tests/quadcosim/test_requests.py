"""Requests can be objects, paths of their files, dictionaries, lists; anything else is refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.foundation.basics.documents import read_toml
from quadcosim import Result, Scenario, UsageError
from tests.native import NATIVE, assert_the_same
from tests.places import EXAMPLES

SHORT = NATIVE.with_changes(stop_time=0.1)
ENTRIES: dict[str, Callable[[Any], object]] = {
    "run": quadcosim.run,
    "limit": lambda request: quadcosim.limit(request, "period", workers=1),
    "fly": lambda request: quadcosim.fly(request, {"seed": [0]}),
    "fly_until": lambda request: quadcosim.fly_until(request, 0.1, "nowhere"),
    "Simulation": quadcosim.Simulation,
}


@pytest.fixture(scope="module")
def expected() -> Result:
    return quadcosim.run(SHORT)


def test_a_file_is_run_by_its_path(tmp_path: Path, expected: Result) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(SHORT.to_toml(), encoding="utf-8")
    assert_the_same(quadcosim.run(path), expected)
    assert_the_same(quadcosim.run(str(path)), expected)


def test_a_dictionary_is_run_as_the_file_that_says_it(expected: Result) -> None:
    tables = {
        "stop_time": 0.1, "controller": {"fmu": "native/UnifiedController"}, "plant": {"fmu": "native/QuadrotorPlant"},
    }  # fmt: skip
    for _ in range(2):  # it is left as it is
        assert_the_same(quadcosim.run(tables), expected)


def test_a_list_gives_a_list(expected: Result) -> None:
    found = quadcosim.run([SHORT, SHORT.with_changes(stop_time=0.05)])
    assert_the_same(found[0], expected)
    assert [result.end for result in found] == [0.1, 0.05]


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("argument", [3, Scenario, object(), {3}], ids=["number", "class", "object", "set"])
def test_anything_else_is_refused_with_what_is_expected(entry: str, argument: Any) -> None:
    expected = r": expected a Scenario, a System, the path of a file of one, or its tables as a dictionary$"
    with pytest.raises(UsageError, match=expected):
        ENTRIES[entry](argument)


def test_a_vehicle_is_known_by_its_name() -> None:
    named, loaded = Scenario(vehicle="crazyflie"), quadcosim.load_vehicle("crazyflie", Path())  # type: ignore[arg-type]
    assert named == Scenario(vehicle=loaded) == Scenario().with_changes(vehicle="crazyflie")
    with pytest.raises(UsageError, match=r"^vehicle crazyfly: did you mean crazyflie\? expected one of"):
        Scenario(vehicle="crazyfly")  # type: ignore[arg-type]


def test_parameters_of_a_side_are_changed_by_their_names() -> None:
    first = Scenario().with_changes(plant={"mass": 1.5}, controller={"gain.eta": 4.0})
    assert first.with_changes(plant={"gravity": 9.8}).plant.parameters == {"mass": 1.5, "gravity": 9.8}
    assert first == Scenario().with_changes(parameters={"plant.mass": 1.5, "controller.gain.eta": 4.0})
    assert Scenario().with_changes(reference={"name": "circle", "radius": 2.0}).reference.name == "circle"


MANY: dict[str, tuple[Callable[[Any], Any], Callable[[Any], object]]] = {
    "study": (quadcosim.load_study, quadcosim.sweep),
    "comparison": (quadcosim.load_comparison, quadcosim.compare),
    "tuning": (quadcosim.load_tuning, lambda tuning: quadcosim.tune(tuning, out="nowhere")),
}


@pytest.mark.parametrize("kind", MANY)
def test_many_runs_are_asked_for_by_a_path_a_dictionary_or_an_object(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    load, start = MANY[kind]
    path = EXAMPLES / "quadrotor" / f"{kind}.toml"
    monkeypatch.chdir(path.parent)  # at which paths in tables start
    tables, loaded = read_toml(path, kind), load(path)
    tables.pop("scenario", None)
    for axis in (*tables.get("axes", ()), tables.get("axis", {})):
        axis |= {"values": np.array(axis["values"])} if axis else {}
    assert load({**tables, "base": loaded.base}) == loaded
    assert load(loaded) is loaded
    with pytest.raises(UsageError, match=rf"^many\.toml: expected a readable {kind} file: no such file"):
        start("many.toml")
    with pytest.raises(UsageError, match=r"^axees: no such key; expected one of .*base"):
        start({**tables, "axees": []})
    with pytest.raises(UsageError, match=f"^3: expected a {kind.title()}, the path of a file of one, or its tables"):
        start(3)
