from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.orchestration.simulation.engines.moving import moving
from tests.orchestration.simulation.engines.test_compiled import Kept


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return moving(tmp_path_factory.mktemp("moving"))


@pytest.fixture(scope="module")
def kept() -> Iterator[Kept]:
    instances = Kept()
    yield instances
    instances.close()
