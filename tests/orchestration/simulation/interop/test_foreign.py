"""FMUs that this project did not make, in other people's masters: compiled here, from C."""

from pathlib import Path

import pytest

from orchestration.simulation.interop import trace
from orchestration.simulation.interop.catalogue import chosen
from orchestration.simulation.interop.compare import TOLERANCE, agreements
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from quadcosim import UsageError
from tests.examples.common import example
from tests.extent import in_test_all, sample
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.systems.system.described import described

# A cart of this project's, pushed by what an integrator in C makes of its place; and two of these, wired by a Boolean.
CART = """
stop_time = 2.0
[components.plant]
fmu = "Plant.fmu"
step = 0.05
[components.c]
fmu = "small.fmu"
sampling = { period = 0.05 }
parameters = { gain = -0.7 }
[[connections]]
from = ["plant.x"]
to = ["c.u"]
[[connections]]
from = ["c.y"]
to = ["plant.u"]
"""
PAIR = """
stop_time = 2.0
[components.a]
fmu = "small.fmu"
step = 0.05
[components.b]
fmu = "small.fmu"
step = 0.05
[[connections]]
from = ["a.high"]
to = ["b.on"]
[[connections]]
from = ["a.y"]
to = ["b.u"]
[sources.push]
to = ["a.u"]
constant = 0.3
"""
# A quadrotor whose motors begin at the thrust of initialisation, 0, which the first step jumps from.
LIFTED = """
stop_time = 0.1
[components.plant]
fmu = "QuadrotorPlant"
step = 0.05
parameters = { actuator_time_constant = 0.1 }
[components.c]
fmu = "small.fmu"
sampling = { period = 0.05 }
[[connections]]
from = ["c.y"]
to = ["plant.thrust"]
[[connections]]
from = ["plant.quaternion.w"]
to = ["c.u"]
[criterion]
diverged = "abs(plant.velocity.z) > 1e9"
"""


def written(folder: Path, text: str) -> System:
    plant = Path(example("double_integrator").components["plant"].fmu)
    (folder / "system.toml").write_text(text.replace("Plant.fmu", str(plant)))
    return load_system(folder / "system.toml")


@needs_compiler
@pytest.mark.parametrize(
    ("text", "orders"),
    sample(
        [
            (CART, {"libcosim": "jacobi", "ecos": "jacobi", "fmucontainer -sequential": "gauss-seidel"}),
            (PAIR, {"fmucontainer": "jacobi", "fmucontainer -sequential": "gauss-seidel"}),
        ],
        1,
    ),
    ids=lambda value: f"{len(value)} masters" if isinstance(value, dict) else "",
)
def test_fmus_of_anybody_fly_as_in_other_masters(text: str, orders: dict[str, str], tmp_path: Path) -> None:
    small(tmp_path)
    system = written(tmp_path, text)
    found = agreements(system, chosen(list(orders), system.components))
    assert {agreement.tool.name: agreement.trace.order for agreement in found} == orders
    for agreement in found:
        assert max(agreement.same_first_inputs.values()) <= TOLERANCE, agreement.tool.name
        assert agreement.trace.steps >= 39


@needs_compiler
def test_a_plant_alone_is_initialised_with_what_was_exchanged_then_and_not_with_the_first_command(
    tmp_path: Path,
) -> None:
    small(tmp_path)
    system = written(tmp_path, LIFTED)
    (found,) = agreements(system, chosen(["fmpy, plant alone"], system.components))
    assert found.trace.initial_inputs["plant"] != found.trace.first_inputs["plant"]
    assert max(found.as_it_comes.values()) <= TOLERANCE


@in_test_all
@needs_compiler
def test_two_copies_of_one_fmu_are_told_apart_by_a_host_that_goes_by_the_guid(tmp_path: Path) -> None:
    small(tmp_path)
    system = written(tmp_path, PAIR.replace('from = ["a.high"]\nto = ["b.on"]\n[[connections]]\n', ""))
    (found,) = agreements(system, chosen(["libcosim, SSP"], system.components))
    assert found.trace.order == "jacobi"
    assert max(found.as_it_comes.values()) <= TOLERANCE


@needs_compiler
def test_what_stands_in_the_way_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(fmu: Path) -> str:
        with pytest.raises(UsageError) as refusal:
            trace.expect_traceable(fmu)
        return str(refusal.value).removeprefix(f"{fmu}: ")

    assert refused(small(tmp_path / "3", fmi=3)).startswith("FMI 3.0; expected FMI 2.0 to trace it in other masters; ")
    empty = described(tmp_path, "Empty", outputs={"y": "Real"})
    assert refused(empty) == "has no binaries/linux64/Empty.so; expected one to run it here"
    monkeypatch.setattr(trace, "compiler", lambda: None)
    assert refused(empty).startswith("expected a C compiler called cc, on Linux (x86_64), to trace it in other masters")
