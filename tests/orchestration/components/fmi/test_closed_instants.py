"""Instants of FMUs whose outputs follow inputs at once: values are passed on within an instant, also around a loop."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import quadcosim
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
from orchestration.simulation.requests.request import request_of
from orchestration.theory.stability.period_map import growth_of_loop
from tests.commands import Main
from tests.orchestration.components.fmi.exchange import exchange
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.components.fmi.test_adapted import loop

pytestmark = needs_compiler


def gains(
    folder: Path, *connections: tuple[str, str], fmi: int = 3, ramp: Any = None, **factors: float
) -> dict[str, Any]:
    """Components y = p u + w with these factors p; `w` of the first is 1, or follows a table."""
    fmu = str(exchange(folder, "gain", fmi=fmi))
    first = next(iter(factors))
    components = {name: {"fmu": fmu, "step": 0.1, "parameters": {"p": p, "q": 1.0}} for name, p in factors.items()}
    source = {"constant": 1.0, "to": [f"{first}.w"]} if ramp is None else {"file": str(ramp), "to": [f"{first}.w"]}
    wires = [{"from": [start], "to": [end]} for start, end in connections]
    return {"stop_time": 0.3, "components": components, "connections": wires, "sources": {"one": source}}


RING = (("a.y", "b.u"), ("b.y", "a.u"))


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("d1", "d2"), [(0.5, 0.8), (2.0, -3.0)])
def test_a_loop_is_closed_at_each_instant(fmi: int, d1: float, d2: float, tmp_path: Path) -> None:
    ramp = tmp_path / "w.csv"
    ramp.write_text("time,w\n0,1\n0.3,4\n")
    rows = quadcosim.run(gains(tmp_path, *RING, fmi=fmi, ramp=ramp, a=d1, b=d2), in_process=True).signals
    w = 1.0 + 10.0 * rows["time"]
    assert rows["b.y"] == pytest.approx(w * d2 / (1.0 - d1 * d2), rel=1e-11)
    assert rows["a.y"] == pytest.approx(w / (1.0 - d1 * d2), rel=1e-11)


def test_a_loop_that_has_no_values_is_named_with_what_was_found(tmp_path: Path) -> None:
    after = "after 100 exchanges, 50 with secants and Newton's method from 10 values"
    found = rf"loop a.y -> b.u; b.y -> a.u: {after}, b.u = \S+ becomes \S+; a.u"
    with pytest.raises(SimulatorError, match=found):
        quadcosim.run(gains(tmp_path, *RING, a=2.0, b=0.5), in_process=True)


def curves(fmu: Path, *connections: tuple[str, str], **factors: tuple[float, float, float]) -> dict[str, Any]:
    """Components y = p u³ + q w² + s with these p, q, s."""
    components = {
        name: {"fmu": str(fmu), "step": 0.1, "parameters": {"p": p, "q": q, "start": s}}
        for name, (p, q, s) in factors.items()
    }
    wires = [{"from": [start], "to": [end]} for start, end in connections]
    return {"stop_time": 0.2, "components": components, "connections": wires}


@pytest.mark.parametrize(("fmi", "slopes"), [(2, False), (2, True), (3, False), (3, True)])
def test_a_steep_loop_of_two_values_is_closed(fmi: int, slopes: bool, tmp_path: Path) -> None:
    fmu = exchange(tmp_path, "curve", fmi=fmi, slopes=slopes)
    rows = quadcosim.run(
        curves(fmu, *RING, a=(2.0, 0.0, 1.5 + 2.0 * 0.8**3), b=(-1.5, 0.0, 1.5 * 1.5**3 - 0.8)), in_process=not slopes
    ).signals
    assert rows["a.y"] == pytest.approx(1.5, rel=1e-11)
    assert rows["b.y"] == pytest.approx(-0.8, rel=1e-11)
    assert bool(rows["a.count"][-1] > 1) is slopes  # how often it was asked for derivatives


@pytest.mark.parametrize("slopes", [False, True])
def test_a_bent_loop_of_five_values_is_closed(slopes: bool, tmp_path: Path) -> None:
    names, y = "abcde", [1.2, -0.7, 0.5, 1.4, -1.1]
    p, q = [0.9, -1.1, 0.8, 1.3, -0.6], [0.7, -0.4, 0.5, -0.8, 0.6]
    factors = {
        name: (p[i], q[i], y[i] - p[i] * y[i - 1] ** 3 - q[i] * y[(i + 1) % 5] ** 2) for i, name in enumerate(names)
    }
    wires = [(f"{names[i - 1]}.y", f"{name}.u") for i, name in enumerate(names)]
    wires += [(f"{names[(i + 1) % 5]}.y", f"{name}.w") for i, name in enumerate(names)]
    system = curves(exchange(tmp_path, "curve", slopes=slopes), *wires, **factors)
    rows = quadcosim.run(system, in_process=True).signals
    found = [rows[f"{name}.y"][-1] for name in names]
    for i, (of_u, of_w, start) in enumerate(factors.values()):
        assert of_u * found[i - 1] ** 3 + of_w * found[(i + 1) % 5] ** 2 + start == pytest.approx(found[i], rel=1e-10)


@pytest.mark.parametrize("slopes", [False, True])
def test_a_bent_loop_without_values_is_named(slopes: bool, tmp_path: Path) -> None:
    system = curves(
        exchange(tmp_path, "curve", slopes=slopes), ("a.y", "b.w"), ("b.y", "a.w"), a=(0.0, 1.0, 1.0), b=(0.0, 1.0, 1.0)
    )
    with pytest.raises(SimulatorError, match=r"no values found around the loop a.y -> b.w; b.y -> a.w: after 100 exch"):
        quadcosim.run(system, in_process=True)


def test_a_chain_has_no_lag_and_both_engines_give_its_rows(tmp_path: Path) -> None:
    ramp = tmp_path / "w.csv"
    ramp.write_text("time,w\n0,1\n0.3,4\n")
    chain = gains(tmp_path, ("b.y", "c.u"), ("a.y", "b.u"), ramp=ramp, a=1.0, b=2.0, c=3.0)
    rows = {engine: quadcosim.run(chain, engine=engine, in_process=True) for engine in ("python", "compiled")}
    assert rows["python"].signals["c.y"] == pytest.approx(6.0 * (1.0 + 10.0 * rows["python"].signals["time"]))
    assert rows["python"].rows.tobytes() == rows["compiled"].rows.tobytes()
    with pytest.raises(QuadcosimError, match="a loop that is closed at each instant"):
        quadcosim.run(gains(tmp_path, *RING, a=0.5, b=0.5), engine="compiled", in_process=True)


def test_show_and_run_say_how_a_loop_is_closed(main: Main, tmp_path: Path) -> None:
    file, system = tmp_path / "system.toml", gains(tmp_path, *RING, a=0.5, b=0.8)
    file.write_text(tomli_w.dumps(system))
    at_once = "a.y -> b.u; b.y -> a.u: closed at each instant"
    assert at_once in main("show", file).stdout
    assert f"loop {at_once}" in main("run", file, "--in-process").stderr
    for component in system["components"].values():
        component["fmu"] = str(exchange(tmp_path, "gain", event_mode=True))
    file.write_text(tomli_w.dumps(system))
    assert "a.y -> b.u; b.y -> a.u: closed by the lag of a step" in main("show", file).stdout


def test_a_loop_through_what_follows_at_once_is_linearised_rightly_or_refused_by_name(tmp_path: Path) -> None:
    period, p, instances = 0.5, 0.3, Instances()

    def radius(of: dict[str, Any]) -> float:
        return math.exp(period * growth_of_loop(request_of(of).as_system(), instances))

    system = loop(tmp_path, period)  # a double integrator, under u = -x - v or u = -y - v with y = x + p u
    system["components"]["plant"]["parameters"] = {"start": 0.0, "p": p}
    system["components"]["g"] = {"fmu": system["components"]["law"]["fmu"], "step": 0.1, "parameters": {"p": 1.0}}
    rate = {"from": ["plant.x2"], "to": ["law.w"]}
    system["connections"] = [
        rate,
        {"from": ["plant.x1"], "to": ["g.u"]},
        {"from": ["g.y"], "to": ["law.u"]},
        {"from": ["law.y"], "to": ["plant.u"]},
    ]
    step, push = np.array([[1.0, period], [0.0, 1.0]]), np.array([period**2 / 2.0, period])
    closed = step - np.outer(push, [1.0, 1.0])
    assert radius(system) == pytest.approx(np.abs(np.linalg.eigvals(closed)).max(), abs=1e-9)
    direct = {
        **system,
        "components": {name: each for name, each in system["components"].items() if name != "g"},
        "connections": [{"from": ["plant.y"], "to": ["law.u"]}, rate, system["connections"][-1]],
    }
    with_last = np.zeros((3, 3))
    with_last[:2, :2], with_last[2] = step, [-1.0, -1.0, -p]
    with_last[:2] += np.outer(push, with_last[2])
    assert radius(direct) == pytest.approx(np.abs(np.linalg.eigvals(with_last)).max(), abs=1e-9)
    system["components"]["h"] = system["components"]["g"]
    system["connections"][2:3] = [{"from": ["g.y"], "to": ["h.u"]}, {"from": ["h.y"], "to": ["law.u"]}]
    with pytest.raises(UsageError, match=r"follow inputs at once, and are passed on within an instant: g.y -> h.u"):
        radius(system)
