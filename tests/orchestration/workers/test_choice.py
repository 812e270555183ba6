"""Where nobody asks for an engine the fastest that can be had flies, and what does not is said."""

from pathlib import Path

import pytest

from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.building.fmus import native_twins
from orchestration.building.inputs import Files, files_of
from orchestration.engines.batch import shape
from orchestration.studies.store import open_for_reading
from orchestration.system.component import Component
from orchestration.system.model import System
from orchestration.workers.choice import Chosen, EngineChoice, alone, choice_named, chosen
from tests.orchestration.fmi.small import needs_compiler, small
from tests.orchestration.studies.common import axis, short, study, sweep

pytestmark = needs_compiler


def first(native: bool) -> tuple[System, Files]:
    system = short().as_system()
    system = native_twins(system) if native else system
    return system, files_of(system)


def no_compiler() -> int:
    raise QuadcosimError("no compiler")


@pytest.mark.parametrize("engine", ["auto", "batch"])
def test_lanes_fly_where_they_can_be_had(engine: EngineChoice) -> None:
    assert chosen(engine, False, first) == Chosen(native=True, in_lanes=True, engine=None)


@pytest.mark.parametrize("native", [False, True])
def test_an_engine_by_name_flies_the_fmus_that_were_asked_for(native: bool) -> None:
    assert chosen("python", native, first) == Chosen(native=native, in_lanes=False, engine="python")


def test_without_lanes_native_twins_fly_and_it_is_said_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shape, "preferred_lanes", no_compiler)
    found = chosen("auto", False, first)
    assert found == Chosen(native=True, in_lanes=False, engine=None, reason="no compiler")
    assert str(found) == "engine compiled: native FMUs, one run at a time (no compiler)"
    with pytest.raises(QuadcosimError, match="no compiler"):
        chosen("batch", False, first)


def test_without_native_twins_the_fmus_fly_as_they_are_and_it_is_said_why() -> None:
    def only_as_it_is(native: bool) -> tuple[System, Files]:
        return (no_compiler(), None) if native else first(native)  # type: ignore[return-value]

    found = chosen("auto", False, only_as_it_is)
    assert found == Chosen(native=False, in_lanes=False, engine=None, reason="no compiler")
    assert str(found) == "engine compiled: the FMUs as they are, one run at a time (no compiler)"
    with pytest.raises(QuadcosimError, match="no compiler"):
        chosen("batch", False, only_as_it_is)


def test_what_flies_alone_is_its_native_twin_where_there_is_one(tmp_path: Path) -> None:
    request, how = alone(short(), "auto")
    assert request.as_system().fmus == {"controller": "native/UnifiedController", "plant": "native/QuadrotorPlant"}
    assert (how.native, how.reason) == (True, None)
    foreign = System(stop_time=0.1, components={"one": Component(fmu=str(small(tmp_path)), step=0.01)})
    assert alone(foreign, "auto")[0] == foreign
    assert alone(short(), "python") == (short(), Chosen(native=False, in_lanes=False, engine="python"))


def test_an_engine_that_there_is_not_is_named() -> None:
    with pytest.raises(UsageError, match=r"engine = bach: did you mean batch\? expected one of auto, python, compiled"):
        choice_named("bach")


def test_a_sweep_says_what_flies_and_keeps_it(tmp_path: Path) -> None:
    said: list[str] = []
    chosen_study = study(axis("timing.period", 0.01, 0.02))
    summary = sweep(chosen_study, folder=tmp_path, engine="auto", announce=said.append)
    assert said[0] == "engine batch: native FMUs, many runs at once"
    assert (summary.engine, summary.study.native) == ("batch", True)
    with open_for_reading(summary.path) as opened:
        assert opened.about()["engine"] == "batch"
    said.clear()
    sweep(chosen_study, folder=tmp_path, engine="auto", announce=said.append)
    assert not said, "expected silence where nothing is left to fly"


def test_a_sweep_of_foreign_fmus_says_which_has_no_lanes(tmp_path: Path) -> None:
    system = System(stop_time=0.1, components={"one": Component(fmu=str(small(tmp_path)), step=0.01)})
    said: list[str] = []
    sweep(study(axis("seed", 1, 2), base=system), folder=tmp_path, engine="auto", announce=said.append)
    assert "one run at a time (components.one: " in said[0]
