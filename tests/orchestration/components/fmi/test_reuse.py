"""Runs of a reused FMU are those of fresh processes, to the bit, whatever the FMU keeps."""

from pathlib import Path

import pytest

from orchestration.components.fmi.isolated_instance import IsolatedInstance
from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.opening import Repeatability, repeatability_of
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.processes.child import Child, Ending
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.component import Parameter
from tests.orchestration.components.fmi.small import needs_compiler, nothing_known, small
from tests.orchestration.components.fmi.test_foreign_fmus import alone, ran

pytestmark = needs_compiler

HABITS = {
    "none": Repeatability(reset=True, second_instance=True),
    "BROKEN_RESET": Repeatability(reset=False, second_instance=True),
    "STICKY_PARAMETER": Repeatability(reset=False, second_instance=True),
    "STATICS": Repeatability(reset=True, second_instance=False),
    "BROKEN_RESET STATICS": Repeatability(reset=False, second_instance=False),
    "ONCE": Repeatability(reset=True, second_instance=False),
    "REFUSES": Repeatability(reset=False, second_instance=False),
    "CRASHES": Repeatability(reset=False, second_instance=False),
}
SETTINGS: tuple[dict[str, Parameter], ...] = ({"gain": 3.0, "mode": "backward"}, {}, {"gain": 3.0})


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nothing is known of any FMU."""
    return nothing_known(tmp_path / "cache", monkeypatch)


def build(habits: str, folder: Path, fmi: int = 2) -> Path:
    return small(folder, *habits.split(), fmi=fmi, once="ONCE" in habits)


REUSED = ("none", "STICKY_PARAMETER", "STATICS", "BROKEN_RESET STATICS")


@pytest.mark.parametrize("habits", [habits for habits in HABITS if habits not in REUSED])
def test_what_is_shown_of_an_fmu_is_what_it_does(habits: str, tmp_path: Path) -> None:
    assert repeatability_of(build(habits, tmp_path)) == HABITS[habits]


def test_fmi_3_is_shown_likewise(tmp_path: Path) -> None:
    assert repeatability_of(build("none", tmp_path / "a", fmi=3)) == HABITS["none"]
    assert repeatability_of(build("BROKEN_RESET", tmp_path / "b", fmi=3)) == HABITS["BROKEN_RESET"]


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """The rows of processes of their own, in which no habit shows."""
    path = build("none", tmp_path_factory.mktemp("fresh"))
    return [ran(alone(path, parameters=setting), load=IsolatedInstance).rows.tobytes() for setting in SETTINGS]


@pytest.mark.parametrize("habits", REUSED)
def test_runs_one_after_another_are_those_of_fresh_processes(habits: str, fresh: list[bytes], tmp_path: Path) -> None:
    path = build(habits, tmp_path)
    systems = [alone(path, parameters=setting) for setting in SETTINGS]
    instances = Instances()
    kinds, rows = [], []
    for system in systems:
        with prepared(system, load=instances.load) as simulation:
            kinds.append(type(simulation.instances["it"]) is IsolatedInstance)
            simulation.master.initialise()
            simulation.master.run()
            rows.append(simulation.result().rows.tobytes())
    instances.close()
    assert rows == fresh
    assert repeatability_of(path) == HABITS[habits], "what it does is what is shown of it"
    needs_a_process = not HABITS[habits].reset and not HABITS[habits].second_instance
    assert kinds == [False] + [needs_a_process] * (len(SETTINGS) - 1)


def test_an_instance_is_kept_only_where_its_reset_is_one(tmp_path: Path) -> None:
    for habits, kept in (("none", True), ("BROKEN_RESET", False)):
        path, instances = build(habits, tmp_path / habits), Instances()
        with instances.load(path, "it") as first:
            pass
        with instances.load(path, "it") as second:
            assert (second is first) == kept
            assert isinstance(second, NativeInstance)
        instances.close()


def test_the_repeatability_of_an_fmu_is_shown_once_on_a_machine(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = build("BROKEN_RESET", tmp_path)
    first = repeatability_of(path)
    monkeypatch.setattr("orchestration.components.fmi.opening._known", {})
    monkeypatch.setattr(Child, "receive_all", lambda *_: pytest.fail("shown again"))
    assert repeatability_of(path) == first
    (stored,) = cache.rglob("*.json")
    stored.write_text("damaged")
    monkeypatch.setattr("orchestration.components.fmi.opening._known", {})
    with pytest.raises(pytest.fail.Exception, match="shown again"):
        repeatability_of(path)


def test_what_could_not_be_tried_to_the_end_is_not_relied_on_nor_kept(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped = Ending(code=None, reached="it takes longer than the limit of 60 s", out_of_time=True)
    monkeypatch.setattr(Child, "receive_all", lambda *_: stopped)
    assert repeatability_of(build("none", tmp_path)) == Repeatability(reset=False, second_instance=False)
    assert not list(cache.rglob("*.json"))


def test_the_fmus_of_this_project_are_reused(built: dict[str, Path]) -> None:
    for path in built.values():
        assert repeatability_of(path) == Repeatability(reset=True, second_instance=True)
