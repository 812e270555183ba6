"""Periodic input clocks of FMI 3.0: they tick at the samples of a component, and nothing is accessed without them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.components.fmi.read_description import read_model
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.requests.request import request_of
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.systems.system.paths import changed
from orchestration.systems.system.proposal import propose
from orchestration.theory.stability.period_map import growth_of_loop
from tests.orchestration.components.fmi.exchange import clock, exchange, law
from tests.orchestration.components.fmi.small import needs_compiler

pytestmark = needs_compiler

FAST = clock("fast", "tunable")


def loop(folder: Path, *clocks: str, delay: float = 0.0, start: float = 1.0, **sampling: Any) -> dict[str, Any]:
    """The double integrator for model exchange, from (1, 0), under the clocked law."""
    return {
        "stop_time": 20.0,
        "components": {
            "plant": {"fmu": str(exchange(folder, "integrator")), "step": 0.1, "parameters": {"start": start}},
            "law": {"fmu": str(law(folder, *clocks)), "sampling": {"fmu_clock": "fast", **sampling}},
        },
        "connections": [
            {"name": "state", "from": ["plant.x1", "plant.x2"], "to": ["law.u", "law.w"]},
            {"name": "command", "from": ["law.y"], "to": ["plant.u"], "delay": delay},
        ],
    }


@pytest.mark.parametrize(
    ("period", "delay", "known"),
    [(0.5, 0.0, 1.950051405e-5), (0.5, 0.1, -3.555489713e-4), (0.05, 0.03, 9.465140849e-6)],
)
def test_a_clocked_law_holds_exactly(period: float, delay: float, known: float, tmp_path: Path) -> None:
    system = loop(tmp_path, FAST, delay=delay, period=period)
    one, other = (quadcosim.run(system, engine=engine, in_process=True) for engine in ("python", "compiled"))
    assert one.rows.tobytes() == other.rows.tobytes()
    assert one.signals["plant.x1"][-1] == pytest.approx(known, abs=2e-13)
    assert one.signals["law.misused"][-1] == 0
    assert one.signals["law.ticks"][-1] == round(20.0 / period)
    assert one.signals["law.period"][-1] == period


def test_with_jitter_and_delay_each_row_is_that_of_the_exact_hold(tmp_path: Path) -> None:
    system = loop(tmp_path, FAST, delay=0.07, period=0.3, jitter=0.1)
    one, other = (quadcosim.run(system, engine=engine, in_process=True) for engine in ("python", "compiled"))
    assert one.rows.tobytes() == other.rows.tobytes()
    happened = [(event.time, event.kind, event.sample) for event in one.events if event.kind in ("sampled", "arrived")]
    rows = [(round(t * 1e9), "row", i) for i, t in enumerate(one.signals["time"].tolist())]
    x, v, u, now, sent = 1.0, 0.0, 0.0, 0, dict[int, float]()
    expected = np.zeros((len(rows), 2))
    for time, kind, number in sorted([*happened, *rows], key=lambda each: each[0]):
        h = (time - now) / 1e9
        x, v, now = x + h * v + h * h / 2.0 * u, v + h * u, time
        if kind == "sampled":
            sent[number] = -x - v
        elif kind == "arrived":
            u = sent[number]
        else:
            expected[number] = x, v
    assert len(sent) > 60
    assert len({time % 300_000_000 for time, kind, _ in happened if kind == "sampled"}) > 60
    assert np.abs(np.transpose([one.signals["plant.x1"], one.signals["plant.x2"]]) - expected).max() < 1e-12


def test_to_a_first_order_hold_a_start_value_that_no_tick_computed_is_no_command(tmp_path: Path) -> None:
    system = {**loop(tmp_path, FAST, delay=0.2, period=0.5), "stop_time": 1.0}
    system["connections"][1]["hold"] = "first"
    system["objectives"] = {"effort": "integral(plant.u ** 2)"}
    one, other = (quadcosim.run(system, engine=engine, in_process=True) for engine in ("python", "compiled"))
    assert one.rows.tobytes() == other.rows.tobytes()
    u, t = one.signals["plant.u"], one.signals["time"]
    assert (u[t < 0.2] == 0.0).all()
    assert (u[(t >= 0.2) & (t < 0.7)] == -1.0).all()  # of y = -x - v at 0: (1, 0)
    assert one.metrics["effort"] == pytest.approx(0.5 + _square_of_line(one.signals["law.y"][t == 0.5][0]))
    assert fly_until(system, 0.45, tmp_path / "paused", in_process=True) is None
    assert resume(tmp_path / "paused", in_process=True).rows.tobytes() == one.rows.tobytes()


def _square_of_line(second: float) -> float:
    """Of the line from -1 at 0.2 s through `second` at 0.7 s, squared, from there to 1 s."""
    end = second + (second + 1.0) / 0.5 * 0.3
    return 0.3 * (second**2 + second * end + end**2) / 3.0


def test_jitter_and_loss_apply_and_a_paused_run_goes_on(tmp_path: Path) -> None:
    system = loop(tmp_path, FAST, clock("slow", "fixed", 'intervalDecimal="1.5" shiftDecimal="1"', 31), jitter=0.2)
    system["connections"][0].update(delay=0.07, loss=0.3)
    one, other = (quadcosim.run(system, engine=engine, in_process=True) for engine in ("python", "compiled"))
    assert one.rows.tobytes() == other.rows.tobytes()
    assert (one.signals["law.misused"][-1], one.signals["law.ticks"][-1]) == (0, 40)
    assert one.signals["law.slow_ticks"][-1] == 13  # at samples 2, 5 … 38
    assert fly_until(system, 7.33, tmp_path / "paused", in_process=True) is None
    assert resume(tmp_path / "paused", in_process=True).rows.tobytes() == one.rows.tobytes()


def test_the_interval_and_the_shift_of_the_clock_are_the_default(tmp_path: Path) -> None:
    third = 'supportsFraction="true" resolution="30" intervalCounter="10" shiftCounter="5"'
    fraction = clock("fast", "constant", third)
    result = quadcosim.run({**loop(tmp_path, fraction), "stop_time": 2.0}, in_process=True)
    sampled = np.array([event.time for event in result.events if event.kind == "sampled"])
    assert sampled.tolist() == [166666667, 500000000, 833333333, 1166666667, 1500000000, 1833333333]
    assert result.signals["law.ticks"].tolist()[-1] == 6


def test_a_clock_is_proposed_as_what_samples(tmp_path: Path) -> None:
    fmus = [("law.fmu", read_model(law(tmp_path, FAST))), ("plant.fmu", read_model(exchange(tmp_path, "integrator")))]
    assert 'sampling = { fmu_clock = "fast" }' in propose(fmus, tmp_path).text


def test_limits_of_a_clocked_loop_are_known(tmp_path: Path) -> None:
    rest = request_of(loop(tmp_path, FAST, start=0.0, period=0.5)).as_system()
    instances = Instances()
    for path, below, above in (
        ("components.law.sampling.period", 1.999, 2.001),
        ("connections.command.delay", 0.46957, 0.46958),
    ):
        assert growth_of_loop(changed(rest, {path: below}), instances) < 0.0
        assert growth_of_loop(changed(rest, {path: above}), instances) > 0.0


@pytest.mark.parametrize(
    ("clocks", "sampling", "expected"),
    [
        (
            [clock("fast")],
            {"period": 0.2},
            r"sampling.period = 0.2: expected 0.5, that of the constant fast",
        ),
        ([FAST], {"fmu_clock": "quick"}, r"components.law.sampling.fmu_clock = quick: expected one of fast"),
        (
            [FAST, clock("now", "triggered", "", 31)],
            {},
            r"now is a clock of causality input and interval triggered",
        ),
        ([FAST, clock("then", "countdown", "", 31)], {}, r"then is a clock of causality input and interval countdown"),
        (
            [FAST, clock("odd", reference=31)],
            {"period": 0.3},
            r"its clock odd ticks every 0.5 s from 0 s; expected",
        ),
    ],
)
def test_clocks_that_cannot_tick_are_refused_by_name(
    clocks: list[str], sampling: dict[str, Any], expected: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=expected):
        quadcosim.run(loop(tmp_path, *clocks, **sampling), in_process=True)
