"""`quadcosim linearise MODEL.fmu`: one FMU about its start, by model exchange or from sample to sample."""

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


def test_at_a_period_its_response_is_that_of_the_equations_between_held_inputs(main: Main, tmp_path: Path) -> None:
    h, steps = 0.25, 6
    answer = main("linearise", exchange(tmp_path, "integrator"), "--set", "p=1.5", "--period", str(h), "--json").stdout
    found = json.loads(answer)
    A, B, C = (np.array(found[name]) for name in "ABC")
    response = np.array([np.zeros((3, 2)), *(C @ np.linalg.matrix_power(A, k) @ B for k in range(steps))])
    since = h * np.arange(steps)  # from the end of the pulse of the first input on
    x1 = [0.0, *(0.5 * h**2 + h * since)]
    y = [0.0, x1[1] + 1.5, *x1[2:]]  # read before the pulse has gone
    assert np.abs(response[:, :, 0].T - [x1, [0.0, *[h] * steps], y]).max() < 1e-8
    assert found["dt"] == h
    assert not np.array(found["D"]).any()
    assert found["verdict"].startswith("Integrator about its start, sampled every 250 ms")


def test_what_moves_at_its_start_is_not_linearised_between_samples(main: Main, tmp_path: Path) -> None:
    moving = ("linearise", exchange(tmp_path, "integrator"), "--set", "u=2", "--period", "0.1")
    assert "does not rest at its start: x2 moves by 0.2 in 100 ms" in main(*moving, code=2).stderr


def test_an_fmu_without_derivatives_is_refused_with_what_it_needs(main: Main, tmp_path: Path) -> None:
    fmu = small(tmp_path)
    refused = main("linearise", fmu, code=2).stderr
    assert "expected an FMU for model exchange, or --period SECONDS, at which a controller samples it" in refused


def test_what_is_no_loop_is_refused_in_words(main: Main, tmp_path: Path) -> None:
    fmu = small(tmp_path)
    assert "nothing is sampled" in main("bode", fmu, code=2).stderr
    alone = tmp_path / "alone.toml"
    alone.write_text(f'stop_time = 1.0\n[components.one]\nfmu = "{fmu}"\nsampling = {{ period = 0.1 }}\n')
    assert "as no component is connected: expected [[connections]]" in main("linearise", alone, code=2).stderr
