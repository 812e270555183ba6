"""The resources that the CUDA text uses of a GPU's processor, by its compiler: no GPU is needed."""

from collections.abc import Mapping

import pytest

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.engines.batch.batch import Batch
from orchestration.simulation.engines.cuda.compiler import KernelResources, image
from orchestration.simulation.engines.cuda.program import Code, line, program
from orchestration.systems.schedule.schedule_cache import ScheduleCache
from orchestration.systems.system.file import load_system
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.engines.batch.lanes import group_of, located, shape_of
from tests.places import EXAMPLES

MOST = {"plant": 168, "controller": 255}
"""Registers of a thread: of 65,536 in a processor, for 384 threads, and for 256, with the largest possible number"""
LOOP = 128
"""The same of the loop without the steps of components, for 512 threads"""
ARCHITECTURE = "sm_90"
EXAMPLE = EXAMPLES / "double_integrator" / "system.toml"


@pytest.fixture(autouse=True)
def _nvrtc() -> None:
    pytest.importorskip("nvidia.cuda_nvrtc", reason="no NVRTC: pip install 'quadcosim[cuda]'")


def assert_it_spills_nothing(resources: Mapping[str, KernelResources], kernel: str, most: int) -> None:
    assert sum(each.spilled for each in resources.values()) == 0
    registers = resources[kernel].registers
    assert registers is not None
    assert registers <= most


@needs_compiler
@pytest.mark.parametrize("component", MOST)
def test_a_line_with_the_numbers_of_a_study_spills_nothing(component: str) -> None:
    flight = located(Scenario(stop_time=0.1).as_system())
    shape = shape_of(flight)
    batch = Batch(shape, ScheduleCache())
    next(batch.stepwise(group_of([flight])))
    code = Code.of(component, shape.models[component])
    memory = batch.memories[shape.names.index(component)]
    known = {name: float(memory[place, 0]) for name, place in code.constant.items()}
    compiled = image(line(code, known, shape.lanes), ARCHITECTURE)
    assert_it_spills_nothing(compiled.resources, "line", MOST[component])


@needs_compiler
def test_the_loop_around_small_components_spills_nothing() -> None:
    shape = shape_of(located(load_system(EXAMPLE)))
    codes = {name: Code.of(name, model) for name, model in shape.models.items()}
    compiled = image(program(shape, codes, {name: {} for name in codes}), ARCHITECTURE)
    assert_it_spills_nothing(compiled.resources, "fly", LOOP)


def test_an_error_in_a_text_is_reported_in_a_line() -> None:
    with pytest.raises(QuadcosimError, match=r"^CUDA for sm_90: .*identifier \"x\" is undefined$"):
        image("static double y = x;", ARCHITECTURE)
