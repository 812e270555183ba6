"""FMUs for model exchange and in event mode, in runs: their known answers, by each version of FMI and each engine."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.components.fmi.access import Access
from orchestration.components.fmi.opening import open_here
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from tests.orchestration.components.fmi.exchange import exchange
from tests.orchestration.components.fmi.small import needs_compiler

pytestmark = needs_compiler

BOUNCES = [0.4515236410, 1.0836567384, 1.5261499065, 1.8358951242]


def ran(path: Path, stop: float, step: float, engine: Any = "compiled", **keys: Any) -> Any:
    """A run of one FMU."""
    component = {"fmu": str(path), "step": step, **keys}
    return quadcosim.run({"stop_time": stop, "components": {"it": component}}, engine=engine, in_process=True)


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_ball_bounces_when_it_must(fmi: int, tmp_path: Path) -> None:
    rows = ran(exchange(tmp_path, "ball", fmi=fmi), 4.0, 0.1, "python").signals
    assert rows["it.count"][-1] == 12
    t, bounces = 1.3, BOUNCES[1]
    since = t - bounces
    up = 0.7**2 * np.sqrt(2 * 9.81)
    assert rows["it.x2"][13] == pytest.approx(up - 9.81 * since, abs=1e-9)
    assert rows["it.x1"][13] == pytest.approx(up * since - 9.81 / 2 * since**2, abs=1e-9)


@pytest.mark.parametrize(("fmi", "event_mode"), [(2, False), (3, False), (3, True)])
def test_a_row_has_the_values_just_after_a_time_event_at_its_instant(
    fmi: int, event_mode: bool, tmp_path: Path
) -> None:
    keys = {"interface": "event-mode"} if event_mode else {}
    result = ran(exchange(tmp_path, "stair", fmi=fmi, event_mode=event_mode), 7.7, 0.7, **keys)
    assert result.signals["it.count"].tolist() == [1, 1, 2, 3, 3, 4, 5, 5, 6, 7, 8, 8]


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_oscillator_is_as_accurate_as_is_asked(fmi: int, tmp_path: Path) -> None:
    fmu, known = exchange(tmp_path, "oscillator", fmi=fmi), [2.008149762, -0.04250887527]
    for tolerance in (1e-6, 1e-10):
        rows = ran(fmu, 20.0, 0.1, tolerance=tolerance).signals
        assert [rows["it.x1"][-1], rows["it.x2"][-1]] == pytest.approx(known, abs=20 * tolerance)


def test_both_engines_and_a_process_give_the_same_rows(tmp_path: Path) -> None:
    fmu = exchange(tmp_path, "ball")
    expected = ran(fmu, 2.0, 0.1, "python").rows.tobytes()
    assert ran(fmu, 2.0, 0.1, "compiled").rows.tobytes() == expected
    system = {"stop_time": 2.0, "components": {"it": {"fmu": str(fmu), "step": 0.1}}}
    assert quadcosim.run(system).rows.tobytes() == expected


def test_a_value_that_is_set_is_seen_by_the_outputs_at_once(tmp_path: Path) -> None:
    with open_here(exchange(tmp_path, "gain"), "it") as it:
        u, y, updates = np.array([1.0]), np.zeros(1), np.zeros(1)
        it.initialise((), np.zeros(0))
        write, read, count = it.writer(["u"], u), it.reader(["y"], y), it.reader(["updates"], updates)
        it.step(0.0, 0.1)
        write()
        read()
        assert y == [1.0]
        count()
        before = updates.copy()
        write()  # the same value
        count()
        assert updates == before


def test_an_interface_that_is_not_offered_is_refused_by_name(tmp_path: Path) -> None:
    what = r"^components.it.interface = co-simulation: Ball does not offer it; expected model-exchange$"
    with pytest.raises(UsageError, match=what):
        ran(exchange(tmp_path, "ball"), 1.0, 0.1, interface="co-simulation")
    with pytest.raises(UsageError, match=r"solver = cvode: expected none with event-mode: Stair has its own"):
        ran(exchange(tmp_path, "stair", event_mode=True), 1.0, 0.1, interface="event-mode", solver="cvode")


def test_events_without_end_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(SimulatorError, match=r"step: has 10000 events in one step, the last at 0 s; expected fewer"):
        ran(exchange(tmp_path, "busy"), 1.0, 0.1)


def test_an_access_is_what_its_text_says() -> None:
    for access in (Access(), Access(interface="model-exchange", solver="cvode")):
        assert Access.of(str(access)) == access
