"""What FMUs log reaches the instance that logged it, with its arguments put in."""

from pathlib import Path

import pytest

from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.opening import open_instance
from orchestration.foundation.basics.errors import SimulatorError
from tests.fmus.foreign import lag, needs_compiler
from tests.orchestration.components.fmi.small import small


@needs_compiler
def test_what_an_fmu_prints_like_c_is_formatted_and_told_apart_by_instance(tmp_path: Path) -> None:
    path = lag(tmp_path / "lag.fmu", "REFUSES")
    with Fmi2Instance(path, "first") as first, Fmi2Instance(path, "second") as second:
        for one in (first, second):
            one.enter_initialization(0.0, 1.0)
            one.exit_initialization()
        for one, time in ((first, 0.5), (second, 0.25)):
            with pytest.raises(SimulatorError) as error:
                one.step(time, 0.01)
            assert str(error.value) == f"{one.name} (Lag): fmi2DoStep: {one.name}: 7 of {time:g} at 100%"


@needs_compiler
@pytest.mark.parametrize(
    ("fmi", "logged", "text"), [(2, "50 %%n, 7 %%s", "50 %n, 7 %s"), (3, "50 %n, 7 %s", "50 %n, 7 %s")]
)
def test_a_text_with_percent_signs_arrives_as_its_version_of_fmi_means_it(
    fmi: int, logged: str, text: str, tmp_path: Path
) -> None:
    with open_instance(small(tmp_path, f'SAYS="{logged}"', fmi=fmi), "it") as one:
        one.enter_initialization(0.0, 1.0)
        one.exit_initialization()
        with pytest.raises(SimulatorError) as error:
            one.step(0.0, 0.01)
    assert str(error.value) == f"it (Small): fmi{fmi}DoStep: {text}"
