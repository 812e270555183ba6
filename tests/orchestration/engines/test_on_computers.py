"""Systems on computers and networks are flown to the same bits by all engines, in windows, and beyond a pause."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.runs.simulation import prepared
from orchestration.schedule import cursor
from orchestration.system.model import System
from orchestration.system.paths import changed
from tests.native import assert_the_same
from tests.orchestration.engines.batch.lanes import assert_the_same_signals, in_lanes, shape_of
from tests.orchestration.engines.moving import moving
from tests.orchestration.engines.systems_on_computers import systems_on_computers
from tests.orchestration.engines.test_compiled import ENGINES, Kept, both, of, ran
from tests.orchestration.fmi.small import needs_compiler

pytestmark = needs_compiler


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return moving(tmp_path_factory.mktemp("moving"))


@pytest.fixture(scope="module")
def kept() -> Iterator[Kept]:
    instances = Kept()
    yield instances
    instances.close()


@settings(max_examples=100, derandomize=True, deadline=None)
@given(systems_on_computers(), st.sampled_from((1, 7, 2**13)))
def test_random_systems_on_computers_run_the_same_in_schedules_of_any_length(
    fmu: Path, kept: Kept, what: System, instants: int
) -> None:
    whole = both(of(what, fmu), load=kept.load)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cursor, "INSTANTS", instants)
        assert_the_same(both(of(what, fmu), load=kept.load), whole)


@settings(max_examples=30, derandomize=True, deadline=None)
@given(systems_on_computers(), st.floats(0.0, 1.0), st.tuples(ENGINES, ENGINES), st.sampled_from((5, cursor.INSTANTS)))
def test_and_go_on_from_a_pause_as_if_there_was_none(
    fmu: Path, kept: Kept, what: System, share: float, engines: tuple[Any, Any], size: int
) -> None:
    system, (first, then) = of(what, fmu), engines
    whole = ran(system, "python", load=kept.load)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cursor, "INSTANTS", size)
        with prepared(system, engine=first, load=kept.load) as run:
            run.master.initialise()
            if run.master.run(pause_at=int(share * 1e9 * system.stop_time)):
                return
            state, saved = json.loads(json.dumps(run.master.state())), run.master.saved()
    with prepared(system, engine=then, load=kept.load) as run:
        run.master.restore(state, saved)
        run.master.run()
        assert_the_same(run.result(), whole)


@st.composite
def crowds(draw: st.DrawFn) -> list[System]:
    """Systems of one structure whose tasks take other times, with other seeds and priorities."""
    first = draw(systems_on_computers())
    crowd = [first]
    for place in range(draw(st.integers(1, 5))):
        paths: dict[str, Any] = {"seed": first.seed + draw(st.integers(0, 1)) * (place + 1)}
        for name, computer in first.computers.items():
            for task in computer.tasks:
                path = f"computers.{name}.tasks.{task}"
                paths |= {f"{path}.execution": draw(st.sampled_from((0.0, 0.002, 0.01)))}
                paths |= {f"{path}.priority": draw(st.integers(0, 3))}
        crowd.append(changed(first, paths))
    return crowd


@settings(max_examples=30, derandomize=True, deadline=None)
@given(crowds())
def test_and_in_lanes_beside_others(fmu: Path, kept: Kept, crowd: list[System]) -> None:
    flown = [of(what, fmu) for what in crowd]
    shape = shape_of(flown[0])
    found = in_lanes(shape, flown)
    for lane, what in enumerate(flown):
        assert_the_same_signals(shape, found, lane, ran(what, "compiled", load=kept.load))
