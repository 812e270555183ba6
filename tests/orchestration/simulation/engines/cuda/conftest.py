from pathlib import Path

import pytest

from orchestration.simulation.engines.batch import batch
from orchestration.simulation.engines.cuda import driver, fleet
from orchestration.simulation.engines.cuda.driver import Gpu
from tests.orchestration.simulation.engines.cuda import emulation


@pytest.fixture(scope="package")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not emulation.has_cpp():
        pytest.skip("no C++: cc of this machine compiles C alone")
    path = tmp_path_factory.mktemp("processor")
    emulation.make_driver(path)
    return path


@pytest.fixture
def gpu(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Gpu:
    monkeypatch.setattr(driver, "LIBRARY", str(folder / emulation.DRIVER))
    monkeypatch.setattr(fleet, "compiled", lambda text, architecture: emulation.compiled_for_cpu(text, folder))
    monkeypatch.setattr(batch, "MOST_ROWS", 2**10)
    return Gpu()
