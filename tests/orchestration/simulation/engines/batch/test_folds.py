"""Functions over a run have the same values in SIMD lanes as in a run alone, for random signals of every kind.

Sums to 1e-12, all else to the last bit.
"""

from dataclasses import replace
from pathlib import Path

import pytest

from orchestration.simulation.engines.batch.batches import Batches
from orchestration.systems.expressions.reductions import REDUCTIONS
from orchestration.systems.system.connection import Source
from orchestration.systems.system.model import Criterion
from orchestration.systems.system.paths import changed
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.engines.batch.lanes import LOOP, assert_the_same_numbers
from tests.orchestration.simulation.engines.test_compiled import Kept, every_source, of, ran

pytestmark = needs_compiler

X = {
    "continuous": "plant.y", "held": "controller.y", "on_a_line": "plant.u1y", "applied": "plant.u2y",
    "mixed": "plant.z * controller.z + 0.3", "vector": "norm(plant.y, controller.z, 2)",
    "measured": "sampled(measured, plant.y - controller.y)", "commanded": "sampled(commanded, controller.y ** 2)",
    "with_ties": "(noise.u5y > 0) - (noise.u5z > 0)",
}  # fmt: skip


def of_signal(function: str, x: str) -> str:
    """A reduction of a signal, with a number for each further argument that it must have."""
    if function == "share":
        x = f"{x[:-1]} > 0.2)" if x.startswith("sampled") else f"{x} > 0.2"
    return f"{function}({x}{', 0.3' * (REDUCTIONS[function].arguments[0] - 1)})"


MORE = {
    "near_functions": "max(sqrt(abs(plant.y)) + exp(plant.y) * log(2 + plant.z) - sin(plant.y) / cos(plant.z))",
    "near_more_functions": "max(tan(plant.y) + asin(plant.y / 2) - acos(plant.z / 2) + atan2(plant.y, 2))",
    "near_tanh": "max(tanh(plant.z))",
    "near_logic": "share(plant.y > 0 and not (controller.y < 0.1 or time >= stop_time / 2))",
    "choice": "max(min(plant.y, controller.y, 0.4) ** 3)",
    "near_power": "max((plant.y + 3) ** 1.5)",
    "parameters": "last(plant.y) + plant.place * controller.place",
    "never": "settling_time(plant.y, 1e-9)",
    "near_two_passes": "settling_time(plant.y - last(plant.y), 0.5 * max(abs(plant.y)))",
    "near_three_passes": "max(plant.y - mean(abs(plant.y - mean(plant.y))))",
    "near_driven": "rms(plant.y - table.u4y) + integral(noise.u5y ** 2) + max(one.u6y)",
    "combination": "last(plant.y) / max(plant.y) - peak_time(plant.z)",
}


EVERY = {
    f"{name}_{kind}": of_signal(name, x)
    for kind, x in X.items() for name in REDUCTIONS if name != "integral" or not x.startswith("sampled")
} | MORE  # fmt: skip


def test_every_function_over_every_kind_of_signal(fmu: Path, kept: Kept, tmp_path: Path) -> None:
    first = replace(
        of(LOOP, fmu), sources=every_source(tmp_path), objectives=EVERY, criterion=Criterion(good="max_held > 0")
    )
    crowd = [replace(first, seed=seed) for seed in range(3)] + [
        changed(first, {"components.controller.sampling.period": 0.03, "stop_time": 0.7}),
        changed(first, {"components.plant.parameters.place": 2.0, "sources.one.constant": 0.7}),
    ]
    batches = Batches()
    for what, found in zip(crowd, batches.run(crowd)):
        assert found is not None
        assert batches.run([what]) == [found]
        alone = ran(what, "compiled", load=kept.load).metrics
        assert_the_same_numbers(what, found.metrics, alone)


def test_held_signals_are_not_reduced_again_where_nothing_but_a_step_happens(fmu: Path, kept: Kept) -> None:
    values = ("controller.y", "plant.u2y", "noise.u4z", "controller.z * noise.u4z - plant.u2y")
    connections = tuple(replace(x, hold="zero") for x in LOOP.connections)
    for to in ("controller.u4z", "plant.u4z"):
        first = replace(
            of(replace(LOOP, connections=connections, stop_time=0.5), fmu),
            sources={"noise": Source(noise=0.01, period=0.007, to=(to,))},
            objectives={f"{name}_{i}": of_signal(name, x) for i, x in enumerate(values) for name in REDUCTIONS},
        )
        crowd = [replace(first, seed=seed) for seed in range(3)]
        for what, found in zip(crowd, Batches().run(crowd)):
            assert found is not None
            assert_the_same_numbers(what, found.metrics, ran(what, "compiled", load=kept.load).metrics)


REFUSED = {"max", "min", "peak_time", "growth_share"}
"""Reductions that leave a run to be made alone where a value is NaN; the floor of `growth_share` is by `max`"""


@pytest.mark.parametrize("functions", [REFUSED, {*REDUCTIONS} - REFUSED], ids=["refused", "computed"])
def test_of_a_signal_without_a_value_at_times_lanes_say_the_same_or_leave_the_run(
    functions: set[str], fmu: Path, kept: Kept
) -> None:
    first = replace(
        of(replace(LOOP, stop_time=0.3), fmu),
        sources={"noise": Source(noise=0.01, period=0.007, to=("plant.u5y",))},
        objectives={name: of_signal(name, "log(plant.y - 0.2 * controller.z)") for name in sorted(functions)},
    )
    crowd = [replace(first, seed=seed) for seed in range(3)]
    for what, found in zip(crowd, Batches().run(crowd)):
        if functions == REFUSED:
            assert found is None
        else:
            assert found is not None, f"a new reduction that leaves runs with NaN is one of REFUSED in {__file__}"
            assert_the_same_numbers(what, found.metrics, ran(what, "compiled", load=kept.load).metrics)
