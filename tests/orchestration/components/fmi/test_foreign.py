"""What is computed by FMUs of others is computed in another process: however that ends, this one goes on."""

import os
from pathlib import Path

import pytest

from orchestration.components.fmi.foreign_calls import LostError, isolated_call
from orchestration.experiments.limits.limit import limit
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import Criterion, System
from tests.orchestration.components.fmi.small import needs_compiler, small

pytestmark = needs_compiler


def refused() -> None:
    raise UsageError("not so")


class PickyError(Exception):
    """It cannot be rebuilt from its text alone."""

    def __init__(self, name: str, value: int) -> None:
        super().__init__(f"{name} = {value}")


def picky() -> None:
    raise PickyError("x", 1)


def unnameable() -> object:
    return lambda: None


def test_only_what_fmus_of_this_kit_compute_is_computed_in_this_process(built: dict[str, Path], tmp_path: Path) -> None:
    ours, other = next(iter(built.values())), small(tmp_path)
    assert isolated_call([ours], os.getpid) == os.getpid()
    assert isolated_call([ours, other], os.getpid) != os.getpid()


def test_what_it_raises_and_how_its_process_ends_is_told(tmp_path: Path) -> None:
    other = small(tmp_path)
    with pytest.raises(UsageError, match=r"^not so$"):
        isolated_call([other], refused)
    with pytest.raises(LostError, match=r"^the process of the FMUs ended by SIGABRT$"):
        isolated_call([other], os.abort)
    with pytest.raises(RuntimeError, match=r"^PickyError: x = 1$"):
        isolated_call([other], picky)
    with pytest.raises(QuadcosimError, match=r"^the result of unnameable; it cannot be passed on by its process: "):
        isolated_call([other], unnameable)


def test_a_limit_is_measured_though_an_fmu_ends_the_process_of_the_local_one(tmp_path: Path) -> None:
    path, other = small(tmp_path / "ends", "ENDS_WHEN_SAVED=abort()"), small(tmp_path / "other")
    system = System(
        stop_time=0.1,
        components={
            "it": Component(fmu=str(path), step=0.01, parameters={"gain": 1.0}),
            "other": Component(fmu=str(other), sampling=Sampling(period=0.01)),
        },
        connections=(
            Connection(name="0", start=("it.y",), end=("other.u",)),
            Connection(name="1", start=("other.y",), end=("it.u",)),
        ),
        operating_point={"components.it.parameters.gain": 1.0},
        objectives={"last": "max(it.y)"},
        criterion=Criterion(good="last < 1"),
    )
    found = limit(
        system, "components.other.sampling.period", first=0.01, last=0.02, scan=0.01, progress=None, announce=None
    )
    assert [one.value for one in found.tried] == [0.01, 0.02]
    no_limit, unmoved = found.notes[-2:]
    assert no_limit == "no local limit: the process of the FMUs ended by SIGABRT"
    assert unmoved.startswith("last is 0 at each value tried")
