"""What straight lines take of a GPU's processor, by the compiler that makes them for it: no GPU is needed."""

import pytest

from orchestration.basics.errors import QuadcosimError
from orchestration.engines.batch.batch import Batch
from orchestration.engines.cuda import compiler
from orchestration.engines.cuda.compiler import image
from orchestration.engines.cuda.program import Code, line
from orchestration.quadrotor.scenario import Scenario
from orchestration.schedule.schedule_cache import ScheduleCache
from tests.orchestration.engines.batch.lanes import group_of, located, shape_of
from tests.orchestration.fmi.small import needs_compiler

MOST = {"plant": 168, "controller": 255}
"""Registers of a thread: three blocks of 128 threads in the 65,536 of a processor, and as many as a thread may have"""
ARCHITECTURE = "sm_90"


@needs_compiler
@pytest.mark.parametrize("component", MOST)
def test_a_line_with_the_numbers_of_a_study_spills_nothing(component: str) -> None:
    pytest.importorskip("nvidia.cuda_nvrtc", reason="no NVRTC: pip install 'quadcosim[cuda]'")
    flight = located(Scenario(stop_time=0.1).as_system())
    shape = shape_of(flight)
    batch = Batch(shape, ScheduleCache())
    next(batch.going(group_of([flight])))
    code = Code.of(component, shape.models[component])
    memory = batch.memories[shape.names.index(component)]
    known = {name: float(memory[place, 0]) for name, place in code.constant.items()}
    taken = image(line(code, known, shape.lanes), ARCHITECTURE).taken
    assert sum(each.spilled for each in taken.values()) == 0
    assert taken["line"].registers is not None
    assert taken["line"].registers <= MOST[component]


def test_what_is_wrong_with_a_text_is_said_in_a_line() -> None:
    pytest.importorskip("nvidia.cuda_nvrtc", reason="no NVRTC: pip install 'quadcosim[cuda]'")
    with pytest.raises(QuadcosimError, match=r"^CUDA for sm_90: .*identifier \"x\" is undefined$"):
        image("static double y = x;", ARCHITECTURE)


def test_without_a_compiler_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    compiler._library.cache_clear()
    try:
        with pytest.raises(
            QuadcosimError, match=r"^NVRTC is not installed; this needs: pip install 'quadcosim\[cuda\]'$"
        ):
            compiler.expect_compiler()
    finally:
        compiler._library.cache_clear()
