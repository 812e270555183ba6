"""FMUs for model exchange and in event mode, in runs: their known answers, by each version of FMI and each engine."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.components.fmi.access import Access
from orchestration.components.fmi.isolated_instance import IsolatedInstance
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
from orchestration.simulation.engines.resolved import resolve
from orchestration.simulation.requests.request import request_of
from orchestration.simulation.requests.ssp.export import export_of
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.simulation.runs.prepared import prepared
from orchestration.systems.system.paths import changed
from orchestration.theory.stability.period_map import growth_of_loop
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
    result = ran(exchange(tmp_path, "ball", fmi=fmi), 4.0, 0.1, "python")
    assert [(x.kind, x.what, x.sample) for x in result.events] == [("event", "it", k) for k in range(11)]
    assert [x.time * 1e-9 for x in result.events[:4]] == pytest.approx(BOUNCES, abs=1e-9)
    rows = result.signals
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
    assert [x.time for x in result.events] == [k * 10**9 for k in range(1, 8)]


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_oscillator_is_as_accurate_as_is_asked(fmi: int, tmp_path: Path) -> None:
    fmu, known = exchange(tmp_path, "oscillator", fmi=fmi), [2.008149762, -0.04250887527]
    for tolerance in (1e-6, 1e-10):
        rows = ran(fmu, 20.0, 0.1, tolerance=tolerance).signals
        assert [rows["it.x1"][-1], rows["it.x2"][-1]] == pytest.approx(known, abs=20 * tolerance)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_stiff_oscillator_is_solved_by_cvode(fmi: int, tmp_path: Path) -> None:
    fmu, known = exchange(tmp_path, "oscillator", fmi=fmi), [2.008149762, -0.04250887527]
    result = ran(fmu, 20.0, 5.0, None, tolerance=1e-8, solver="cvode")
    assert [result.signals[f"it.{x}"][-1] for x in ("x1", "x2")] == pytest.approx(known, abs=1e-5)
    assert result.provenance["engine"] == "python"
    with pytest.raises(QuadcosimError, match=r"components.it is solved by CVODE, which is called from Python"):
        ran(fmu, 1.0, 0.1, "compiled", solver="cvode")
    ball = ran(exchange(tmp_path, "ball", fmi=fmi), 1.4, 0.1, None, tolerance=1e-8, solver="cvode")
    assert [event.time * 1e-9 for event in ball.events] == pytest.approx(BOUNCES[:2], abs=1e-6)


def test_both_engines_and_a_process_give_the_same_rows(tmp_path: Path) -> None:
    fmu = exchange(tmp_path, "ball")
    expected, compiled = (ran(fmu, 2.0, 0.1, engine) for engine in ("python", "compiled"))
    system = {"stop_time": 2.0, "components": {"it": {"fmu": str(fmu), "step": 0.1}}}
    with prepared(request_of(system), load=IsolatedInstance) as simulation:
        simulation.master.initialise()
        simulation.master.run()
        isolated = simulation.result()
    for each in (compiled, quadcosim.run(system), isolated):
        assert each.rows.tobytes() == expected.rows.tobytes()
        assert list(each.events) == list(expected.events)


@pytest.mark.parametrize(("kind", "at"), [("ball", 1.3), ("oscillator", 0.77)])
def test_a_run_that_was_paused_has_the_same_bits_and_events(kind: str, at: float, tmp_path: Path) -> None:
    request = {"stop_time": 2.0, "components": {"it": {"fmu": str(exchange(tmp_path, kind)), "step": 0.11}}}
    whole = quadcosim.run(request, in_process=True)
    assert fly_until(request, at, tmp_path / "paused", in_process=True) is None
    resumed = resume(tmp_path / "paused", in_process=True)
    assert resumed.rows.tobytes() == whole.rows.tobytes()
    assert list(resumed.events) == list(whole.events)


def loop(folder: Path, period: float, delay: float = 0.0, fmi: int = 3) -> dict[str, Any]:
    """The double integrator from (1, 0) under u = -x - v, sampled."""
    plant, law = exchange(folder, "integrator", fmi=fmi), exchange(folder, "gain", fmi=fmi)
    return {
        "stop_time": 20.0,
        "components": {
            "plant": {"fmu": str(plant), "step": 0.1},
            "law": {"fmu": str(law), "sampling": {"period": period}, "parameters": {"p": -1.0, "q": -1.0}},
        },
        "connections": [
            {"name": "state", "from": ["plant.x1", "plant.x2"], "to": ["law.u", "law.w"]},
            {"name": "command", "from": ["law.y"], "to": ["plant.u"], "delay": delay},
        ],
    }


def test_a_sampled_loop_is_that_of_the_exact_hold(tmp_path: Path) -> None:
    for fmi in (2, 3):
        result = quadcosim.run(loop(tmp_path, 0.5, fmi=fmi), in_process=True, engine="compiled")
        assert result.signals["plant.x1"][-1] == pytest.approx(1.950051405e-5, abs=1e-12)


@pytest.mark.parametrize(
    ("path", "others", "below", "above"),
    [
        ("components.law.sampling.period", {}, 1.999, 2.001),
        ("connections.command.delay", {"components.law.sampling.period": 0.05}, 0.68612, 0.68616),
        ("connections.command.delay", {"components.law.sampling.period": 0.5}, 0.46957, 0.46958),
    ],
)
def test_the_state_that_is_saved_is_whole_so_that_limits_are_right(
    path: str, others: dict[str, float], below: float, above: float, tmp_path: Path
) -> None:
    rest = changed(request_of(loop(tmp_path, 1.0)).as_system(), {"components.plant.parameters.start": 0.0, **others})
    instances = Instances()
    assert growth_of_loop(changed(rest, {path: below}), instances) < 0.0
    assert growth_of_loop(changed(rest, {path: above}), instances) > 0.0


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


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_slopes_of_an_output_are_those_that_the_fmu_offers(fmi: int, tmp_path: Path) -> None:
    for load in (open_here, IsolatedInstance):
        with load(exchange(tmp_path, "curve", fmi=fmi, slopes=True), "it") as it:
            it.set("p", 0.5)
            it.set("q", 3.0)
            it.initialise(("u", "w"), np.array([2.0, -1.0]))
            assert np.asarray(it.slopes(("y",), ("u", "w"))).tolist() == [[6.0, -6.0]]
        with load(exchange(tmp_path, "curve", fmi=fmi), "it") as without:
            assert without.slopes(("y",), ("u",)) is None


def test_an_interface_that_is_not_offered_is_refused_by_name(tmp_path: Path) -> None:
    what = r"^components.it.interface = co-simulation: Ball does not offer it; expected model-exchange$"
    with pytest.raises(UsageError, match=what):
        ran(exchange(tmp_path, "ball"), 1.0, 0.1, interface="co-simulation")
    with pytest.raises(UsageError, match=r"solver = cvode: expected none with event-mode: Stair has its own"):
        ran(exchange(tmp_path, "stair", event_mode=True), 1.0, 0.1, interface="event-mode", solver="cvode")


def test_who_handles_events_is_said(tmp_path: Path) -> None:
    fmu = exchange(tmp_path, "stair", event_mode=True)
    checked = resolve(request_of({"stop_time": 1.0, "components": {"it": {"fmu": str(fmu), "step": 0.1}}}))
    assert [text.partition(",")[0] for text in checked.events] == ["it: the FMU handles its events itself"]


def test_an_ssp_is_not_written_of_other_interfaces(tmp_path: Path) -> None:
    system = request_of({"stop_time": 1.0, "components": {"it": {"fmu": str(exchange(tmp_path, "ball")), "step": 0.1}}})
    expected = "components.it.interface = model-exchange: an SSP is written of co-simulation alone; expected that"
    assert export_of(system, None).unsupported == (expected,)


def test_events_without_end_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(SimulatorError, match=r"step: has 10000 events in one step, the last at 0 s; expected fewer"):
        ran(exchange(tmp_path, "busy"), 1.0, 0.1)


def test_an_access_is_what_its_text_says() -> None:
    for access in (Access(), Access(interface="model-exchange", solver="cvode")):
        assert Access.of(str(access)) == access
