"""Parameters that follow the sampling period of their component."""

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest

from orchestration.components.fmi.read_description import Model, read_model
from orchestration.foundation.basics.documents import tables_in
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.resolved import other_periods_in_words, varied_periods_in_words
from orchestration.systems.system.check import check
from orchestration.systems.system.component import OWN_PERIOD, Component, Sampling
from orchestration.systems.system.computers import Computer, Task
from orchestration.systems.system.file import system_from_tables
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed, value_at, with_followers
from orchestration.theory.stability.loop_at_rest import Start
from tests.orchestration.systems.system.described import described

CLOCK, FOLLOWS = "components.law.sampling.period", "components.law.parameters.period"
LAW = Component(
    fmu="Law.fmu", parameters={"gain": 2.0, "period": OWN_PERIOD, "other": 0.01}, sampling=Sampling(period=0.01)
)
SYSTEM = System(stop_time=1.0, components={"law": LAW})


def values(system: System) -> list[object]:
    return [*system.components["law"].parameters.values()]


@pytest.mark.parametrize("beside", [{}, {"seed": 3}, {"components.law.parameters.gain": 2.0}, {"stop_time": 2.0}])
def test_it_is_the_period_whatever_sets_that(beside: dict[str, float]) -> None:
    assert values(SYSTEM) == [2.0, 0.01, 0.01]
    assert values(changed(changed(SYSTEM, {CLOCK: 0.05, **beside}), {CLOCK: 0.03})) == [2.0, 0.03, 0.01]


def test_it_still_follows_after_copies_and_in_the_file_of_the_system() -> None:
    numpy = {**LAW.parameters, "gain": np.float64(3.0)}
    copies = [
        pickle.loads(pickle.dumps(SYSTEM)),
        system_from_tables(tables_in(SYSTEM.to_toml()), Path()),
        dataclasses.replace(SYSTEM, components={"law": dataclasses.replace(LAW, parameters=numpy)}),
    ]
    assert [values(changed(one, {CLOCK: 0.5}))[1] for one in copies] == [0.5] * 3
    assert with_followers(copies[0], [CLOCK]) == (CLOCK, FOLLOWS)


def test_a_number_stays_until_it_is_to_follow_again() -> None:
    stays = changed(SYSTEM, {FOLLOWS: 0.2, CLOCK: 0.1})
    assert value_at(changed(stays, {CLOCK: 0.3}), FOLLOWS) == 0.2
    assert value_at(changed(stays, {FOLLOWS: OWN_PERIOD}), FOLLOWS) == 0.1


def test_that_of_a_task_is_the_period_of_the_task() -> None:
    computer = Computer(tasks={"t": Task(period=0.02, component="law")})
    law = dataclasses.replace(LAW, sampling=None)
    system = System(stop_time=1.0, components={"law": law}, computers={"c": computer})
    assert values(system)[1] == 0.02
    assert values(changed(system, {"computers.c.tasks.t.period": 0.04}))[1] == 0.04


@pytest.mark.parametrize(
    ("parameter", "written", "line"),
    [
        ("gain", "sampling.perod", 'sampling.perod: expected a number, or "sampling.period": that of its component'),
        ("period", "5 ms", '5 ms: expected a number in s, or "sampling.period": that of its component'),
        ("other", "5 kN", "5 kN: expected a number in N"),
        ("other", OWN_PERIOD, "sampling.period: expected a number in N; sampling.period is in s"),
    ],
)
def test_another_text_and_another_unit_are_refused(parameter: str, written: str, line: str, tmp_path: Path) -> None:
    described(tmp_path, "Law", parameters={"gain": "Real", "period": "Real s", "other": "Real N"})
    models = {"law": read_model(tmp_path / "Law.fmu")}
    with pytest.raises(UsageError) as refused:
        check(changed(SYSTEM, {f"components.law.parameters.{parameter}": written}), models)
    assert str(refused.value) == f"components.law.parameters.{parameter} = {line}"


def test_a_component_without_sampling_has_no_period_to_follow() -> None:
    with pytest.raises(UsageError, match=r"^parameters.h = sampling.period: expected a number: beside step there is"):
        Component(fmu="Plant.fmu", parameters={"h": OWN_PERIOD}, step=0.1)


def test_a_law_that_keeps_the_period_of_its_file_is_told_how_it_follows(tmp_path: Path) -> None:
    described(tmp_path, "Law", parameters={"period": "Real s"})
    models = {"law": read_model(tmp_path / "Law.fmu")}
    law = dataclasses.replace(LAW, parameters={"period": 0.01})
    keeps = System(stop_time=1.0, components={"law": law})
    assert varied_periods_in_words(keeps, keeps, changed(keeps, {CLOCK: 0.02}), models) == [
        'law keeps its parameter period of 10 ms; with period = "sampling.period" under its parameters it follows'
    ]
    for other in (changed(keeps, {"stop_time": 2.0}), changed(keeps, {CLOCK: 0.02, FOLLOWS: 0.02})):
        assert varied_periods_in_words(keeps, keeps, other, models) == []
    follows = changed(keeps, {FOLLOWS: OWN_PERIOD})
    assert varied_periods_in_words(follows, follows, changed(follows, {CLOCK: 0.02}), models) == []


def test_code_that_is_told_its_period_believes_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Model, "believed_period", 0.01)
    models = {"law": read_model(described(tmp_path, "Law", parameters={"period": "Real s"}))}
    told = changed(SYSTEM, {CLOCK: 0.02})
    assert other_periods_in_words(told, models) == []
    (remark,) = other_periods_in_words(changed(told, {FOLLOWS: 0.01}), models)
    assert remark.startswith("law (Law): its code believes 0.01 s; at other periods")


def test_a_state_at_rest_serves_another_period_only_with_the_parameter_that_follows_it() -> None:
    """Else the law would go on from there with what it holds, the period before."""
    rest = Start(
        components=SYSTEM.components, saved={"law": (b"", 0.0, 1)}, held={}, ticking=frozenset(),
        tunable=frozenset({"law.period"}),
    )  # fmt: skip
    later = changed(SYSTEM, {CLOCK: 0.02})
    tuned = rest.tuned_to(later)
    assert not rest.serves(later)
    assert tuned is not None
    assert tuned.tuned == {"law": {"period": 0.02}}
