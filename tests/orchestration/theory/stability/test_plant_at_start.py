"""`quadcosim linearise MODEL.fmu`: one FMU for model exchange about its start."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.commands import Main
from tests.orchestration.components.fmi.exchange import exchange
from tests.orchestration.components.fmi.small import needs_compiler, small

pytestmark = needs_compiler


@pytest.mark.parametrize(("kind", "fmi", "slopes"), [("integrator", 3, True), ("oscillator", 2, False)])
def test_matrices_are_those_of_the_equations_at_the_start(
    main: Main, tmp_path: Path, kind: str, fmi: int, slopes: bool
) -> None:
    p, start = 1.5, 1.2
    given = ("--set", f"p={p}", "--set", "q=-3", "--set", f"start={start}", "--set", "u=2")
    answer = main("linearise", exchange(tmp_path, kind, fmi=fmi, slopes=slopes), *given, "--json").stdout
    found = json.loads(answer)
    damped = kind == "oscillator"
    second = [-1.0, p * (1.0 - start**2)] if damped else [0.0, 0.0]  # by x1 and x2, from (start, 0)
    assert np.array(found["A"]) == pytest.approx(np.array([[0.0, 1.0], second]), abs=1e-9)
    assert np.array(found["B"]) == pytest.approx(np.array([[0.0, 0.0], [0.0 if damped else 1.0, 0.0]]), abs=1e-9)
    assert np.array(found["C"]) == pytest.approx(np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]), abs=1e-9)
    assert np.array(found["D"]) == pytest.approx(np.array([[0.0, 0.0], [0.0, 0.0], [p, -3.0]]), abs=1e-9)
    rate = -start if damped else 2.0
    assert found["rates"] == {"x2": pytest.approx(rate)}
    assert found["verdict"].endswith(f"outputs; it does not rest there: x2 by {rate:g} a second")
    assert found["operating_point"]["y"] == pytest.approx(p * 2.0 + start)


def test_an_fmu_without_derivatives_is_refused_with_the_command_that_makes_its_system(
    main: Main, tmp_path: Path
) -> None:
    fmu = small(tmp_path)
    refused = main("linearise", fmu, code=2).stderr
    assert f"for model exchange, or a system that samples it: quadcosim connect {fmu} CONTROLLER.fmu" in refused
