"""What hypothesis draws from: systems of any components and connections, with times that meet each other.

Strategies are created once: that takes longer than drawing from them.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

from hypothesis import strategies as st

from orchestration.systems.system.choices import Spread, TraceOrder
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System

OUTPUTS = ("y", "z")
TIMES = (0.01, 0.02, 0.025, 0.03, 0.05, 0.1)
BOOLEANS = st.booleans()
chosen, whole, number = functools.cache(st.sampled_from), functools.cache(st.integers), functools.cache(st.floats)


@functools.cache
def some(*values: Any) -> st.SearchStrategy[float]:
    """0 in half of the cases, else a round decimal, which meets others, or any float, which hardly does."""
    return st.just(0.0) | chosen(values or TIMES) | number(0.001, 0.1)


SHARES = st.just(0.0) | st.floats(0.0, 0.99)
TIMES_OR_NONE = st.just(0.0) | some()
ORDERS: tuple[TraceOrder, ...] = ("drawn", "as recorded")
TRACE = Path(__file__).with_name("trace.csv")


@functools.cache
@st.composite
def distributions(draw: st.DrawFn, most: float = 0.1) -> Distribution:
    """Of every kind, up to a largest value."""
    low, high = sorted((draw(number(0.0, most)), draw(number(0.0, most))))
    kind = draw(chosen(("uniform", "normal", "values", "probabilities", *(("file",) if most >= 0.1 else ()))))
    if kind == "uniform":
        return Distribution(uniform=(low, high))
    if kind == "normal":
        mean = draw(number(-0.1 * most, high))
        return Distribution(normal=(mean, 0.1 * most + high), range=(0.0, high + 1e-4 * most))
    if kind == "file":
        return Distribution(file=TRACE, column="delay", order=draw(chosen(ORDERS)))
    values = (low, high, 0.5 * high)
    shares = draw(chosen(((0.25, 0.75, 0.0), (0.1, 0.2, 0.7)))) if kind == "probabilities" else None
    return Distribution(values=values, probabilities=shares)


@functools.cache
def losses() -> st.SearchStrategy[Distribution]:
    """That are no probability."""
    return st.builds(Distribution, file=st.just(TRACE), column=st.just("lost"), order=chosen(ORDERS))


@functools.cache
@st.composite
def samplings(draw: st.DrawFn) -> Sampling:
    """Of a task."""
    period, ratio = draw(chosen(TIMES)), draw(chosen((1.0, 1.0, 0.5, 1.001, 1.7)))
    if draw(whole(0, 9)) == 0:
        return Sampling(period=period, offset=draw(chosen((0.0, 0.01))), clock="fmu")
    return Sampling(
        period=period, clock_ratio=ratio, offset=draw(some()),
        **draw(jitters("jitter", SHARES, 0.7 * period / ratio, lambda share: share * period / ratio)),
    )  # fmt: skip


@st.composite
def jitters(
    draw: st.DrawFn,
    key: str,
    values: st.SearchStrategy[float],
    most: float,
    largest: Callable[[float], float] = float,
) -> dict[str, Any]:
    """A jitter by what its largest value is of one of `values`, or as it is distributed up to `most`."""
    if draw(whole(0, 3)) == 0:
        return {key: draw(distributions(most))}
    return {key: largest(draw(values)), "jitter_distribution": draw(chosen(get_args(Spread)))}


@functools.cache
@st.composite
def lost(draw: st.DrawFn) -> dict[str, Any]:
    """Losses, by a probability or by a trace."""
    if draw(whole(0, 3)) == 0:
        return {"loss": draw(losses())}
    return {"loss": draw(some(0.3, 0.5)), "burst_length": draw(BURSTS)}


@functools.cache
@st.composite
def components(draw: st.DrawFn) -> Component:
    """In continuous time, or a task."""
    if draw(BOOLEANS):
        return Component(fmu="stub", step=draw(STEPS))
    return Component(fmu="stub", sampling=draw(samplings()))


DELAYS = some(*TIMES, 0.2) | distributions()
BURSTS = st.none() | st.floats(1.0, 5.0)
STEPS = st.sampled_from(TIMES) | st.floats(0.01, 0.1)
ENDS = st.sampled_from((0.1, 0.2, 0.3)) | st.floats(0.01, 0.3)
BY_NAME = {
    count: st.dictionaries(st.sampled_from(OUTPUTS[:count]), st.just(0.0) | st.floats(0.01, 1.0)) for count in (1, 2)
}
orders = functools.cache(st.permutations)


@st.composite
def connections(draw: st.DrawFn, index: int, names: Sequence[str]) -> Connection:
    """From any component to any other, to inputs of its own."""
    sender, receiver = draw(orders(tuple(names)))[:2]
    outputs = OUTPUTS[: draw(whole(1, len(OUTPUTS)))]
    by_name = BY_NAME[len(outputs)]
    is_dull = draw(BOOLEANS)
    disturbed: dict[str, Any] = {} if is_dull else {
        "delay": draw(DELAYS), **draw(jitters("delay_jitter", TIMES_OR_NONE, 0.1)),
        **draw(lost()), "noise": draw(by_name),
    }  # fmt: skip
    return Connection(
        name=f"c{index}",
        start=tuple(f"{sender}.{output}" for output in outputs),
        end=tuple(f"{receiver}.u{index}{output}" for output in outputs),
        order=draw(chosen(("gauss-seidel", "gauss-seidel", "jacobi"))),
        hold=draw(chosen(("zero", "first"))),
        quantisation=draw(by_name),
        scale=draw(chosen((1.0, 2.0, -0.3))),
        offset=draw(chosen((0.0, 0.7))),
        **disturbed,
    )


@functools.cache
@st.composite
def systems(draw: st.DrawFn, most: int = 6) -> System:
    """Of two components and more."""
    names = [f"k{i}" for i in range(draw(whole(2, most)))]
    parts = {name: draw(components()) for name in names}
    wires = [draw(connections(i, names)) for i in range(draw(whole(1, 2 * len(names))))]
    stop_time = draw(ENDS)
    return System(stop_time=stop_time, seed=draw(whole(0, 2**32)), components=parts, connections=tuple(wires))


@functools.cache
@st.composite
def systems_of_fixed_steps(draw: st.DrawFn) -> tuple[System, list[str]]:
    """Systems in which some components take steps of one length only, and which."""
    system = draw(systems(most=4))
    names = [name for name, component in system.components.items() if component.sampling is None]
    fixed = [name for name in names if draw(BOOLEANS)]
    steps = {name: Component(fmu="stub", step=draw(chosen(TIMES)), align="next") for name in fixed}
    return replace(system, stop_time=0.3, components={**system.components, **steps}), fixed


@st.composite
def systems_with_more(draw: st.DrawFn) -> tuple[System, System]:
    """A system, and the same with a component and lossy connections more, some of them into what was there."""
    system = draw(systems(most=4))
    # a line would be read where more communication points are
    plain = tuple(replace(x, hold="zero") for x in system.connections)
    parts = {"more": draw(components()), **system.components}
    added = [draw(connections(100 + i, list(parts))) for i in range(draw(whole(1, 4)))]
    lossy = tuple(replace(x, loss=0.4, burst_length=None) for x in added)
    return replace(system, connections=plain), replace(system, components=parts, connections=(*lossy, *plain))
