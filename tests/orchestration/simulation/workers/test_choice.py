"""By default the fastest available engine is chosen, and the reason is reported if it is not the fastest."""

from dataclasses import replace
from pathlib import Path

import pytest

from orchestration.components.building.fmus import native_twins
from orchestration.experiments.studies.store import open_for_reading
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.simulation.engines.batch import shape
from orchestration.simulation.workers.choice import (
    EngineChoice,
    Execution,
    choose_execution,
    engine_choice,
    single_run_execution,
)
from orchestration.systems.expressions.reductions import REDUCTIONS
from orchestration.systems.system.component import Component
from orchestration.systems.system.files import Files, files_of
from orchestration.systems.system.model import System
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.experiments.studies.common import axis, short, study, sweep

pytestmark = needs_compiler


def first(native: bool) -> tuple[System, Files]:
    system = short().as_system()
    system = native_twins(system) if native else system
    return system, files_of(system)


def no_compiler() -> int:
    raise QuadcosimError("no compiler")


@pytest.mark.parametrize("engine", ["auto", "batch"])
def test_lanes_are_chosen_where_available(engine: EngineChoice) -> None:
    assert choose_execution(engine, False, first) == Execution(native=True, in_lanes=True, engine=None)


@pytest.mark.parametrize("native", [False, True])
def test_an_engine_by_name_runs_the_requested_fmus(native: bool) -> None:
    assert choose_execution("python", native, first) == Execution(native=native, in_lanes=False, engine="python")


def test_without_lanes_native_twins_are_chosen_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shape, "preferred_lanes", no_compiler)
    execution = choose_execution("auto", False, first)
    assert execution == Execution(native=True, in_lanes=False, engine=None, reason="no compiler", failed=True)
    assert str(execution) == "engine compiled: native FMUs, one run at a time (no compiler)"
    with pytest.raises(QuadcosimError, match="no compiler"):
        choose_execution("batch", False, first)


def test_with_a_reduction_that_has_no_form_in_lanes_runs_are_alone_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(REDUCTIONS, "highest", REDUCTIONS["max"])
    system, files = first(True)
    objectives = {**system.objectives, "peak": "highest(plant.thrust)"}
    execution = choose_execution("auto", False, lambda _: (replace(system, objectives=objectives), files))
    assert (execution.native, execution.in_lanes, execution.failed) == (True, False, False)
    assert str(execution.reason).startswith("highest(…) is not computed in SIMD lanes")


def test_without_native_twins_the_fmus_are_run_as_they_are_with_the_reason() -> None:
    def only_as_it_is(native: bool) -> tuple[System, Files]:
        return (no_compiler(), None) if native else first(native)  # type: ignore[return-value]

    execution = choose_execution("auto", False, only_as_it_is)
    assert execution == Execution(native=False, in_lanes=False, engine=None, reason="no compiler", failed=True)
    assert str(execution) == "engine compiled: the FMUs as they are, one run at a time (no compiler)"
    with pytest.raises(QuadcosimError, match="no compiler"):
        choose_execution("batch", False, only_as_it_is)


def test_single_runs_use_native_twins_where_available(tmp_path: Path) -> None:
    request, how = single_run_execution(short(), "auto")
    assert request.as_system().fmus == {"controller": "native/UnifiedController", "plant": "native/QuadrotorPlant"}
    assert (how.native, how.reason) == (True, None)
    foreign = System(stop_time=0.1, components={"one": Component(fmu=str(small(tmp_path)), step=0.01)})
    assert single_run_execution(foreign, "auto")[0] == foreign
    assert single_run_execution(short(), "python") == (
        short(),
        Execution(native=False, in_lanes=False, engine="python"),
    )


def test_an_unknown_engine_is_refused() -> None:
    with pytest.raises(UsageError, match=r"engine = bach: did you mean batch\? expected one of auto, python, compiled"):
        engine_choice("bach")


def test_a_sweep_reports_its_engine_and_keeps_it(tmp_path: Path) -> None:
    lines: list[str] = []
    chosen_study = study(axis("timing.period", 0.01, 0.02))
    summary = sweep(chosen_study, out=tmp_path, engine="auto", announce=lines.append)
    assert lines[0] == "engine batch: native FMUs, many runs at once"
    assert (summary.engine, summary.study.native) == ("batch", True)
    with open_for_reading(summary.path) as opened:
        assert opened.about()["engine"] == "batch"
    lines.clear()
    sweep(chosen_study, out=tmp_path, engine="auto", announce=lines.append)
    assert not lines, "expected silence where no run is left"


def test_a_sweep_of_foreign_fmus_reports_which_has_no_lanes(tmp_path: Path) -> None:
    system = System(stop_time=0.1, components={"one": Component(fmu=str(small(tmp_path)), step=0.01)})
    lines: list[str] = []
    sweep(study(axis("seed", 1, 2), base=system), out=tmp_path, engine="auto", announce=lines.append)
    assert "one run at a time (components.one: " in lines[0]
