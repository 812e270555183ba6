"""What tests of several districts share."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestration.components.fmi.reuse import Instances
from quadcosim import Scenario
from tests.fmus.source_tree import build, copy_sources, replace


@pytest.fixture(scope="session")
def paper(built: dict[str, Path]) -> Scenario:
    """The paper's flight, with the FMUs of the session."""
    return Scenario().with_fmus(plant=built["QuadrotorPlant"], controller=built["UnifiedController"])


@pytest.fixture(scope="session")
def short(paper: Scenario) -> Scenario:
    """Its first moments, on a coarse grid."""
    return paper.with_changes(stop_time=0.2, timing={"plant_interval": 0.01})


@pytest.fixture(scope="session")
def odd_plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plant with a parameter of each type: it is heavier by 0.1 kg for each box of its `cargo` if it is `loaded`."""
    folder = tmp_path_factory.mktemp("odd")
    sources = copy_sources(folder / "sources")
    declared = """    cargo = FixedParameter("number of boxes", None, 0)
    loaded = FixedParameter("whether they are on board", start=False)
    payload_mass = """
    replace(sources / "plant_fmu" / "interface.py", "    payload_mass = ", declared)
    body = "read_fields(self, Body)"
    heavier = f"{body}.with_mass(self.mass + 0.1 * self.cargo * self.loaded)"
    replace(sources / "plant_fmu" / "slave.py", body, heavier)
    return build(sources, folder, "QuadrotorPlant")


@pytest.fixture(scope="module")
def instances() -> Iterator[Instances]:
    """Instances that the loops of a module's tests use again."""
    found = Instances()
    yield found
    found.close()
