"""The sampled loop through saved states: against theory, against twin runs, and what it refuses."""

import dataclasses
import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.components.building import fmus
from orchestration.components.fmi.instance import NO_STATE
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.bisection import Range
from orchestration.quadrotor.flight.hover import at_hover
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection, Source
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.stability import local_limit as local
from orchestration.theory.stability.identification import SampledRest
from orchestration.theory.stability.local_limit import LOOP, TWINS, local_limits
from orchestration.theory.stability.loop_at_rest import AnyTangent, AtRest, KnownTangents
from orchestration.theory.stability.period_map import growth_of_loop
from orchestration.theory.stability.perturbed_runs import Growth, growth_of
from quadcosim import Scenario, Timing, UsageError
from tests.examples.common import native_example as example
from tests.native import native
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.experiments.studies.common import one_line
from tests.orchestration.experiments.studies.test_systems import DELAY, PERIOD, theory

FMU = "components.{}.fmu"


@pytest.fixture(scope="module")
def system() -> System:
    return dataclasses.replace(example("double_integrator"), stop_time=20.0)


def with_description_changed(path: Path, folder: Path, old: str, new: str) -> str:
    """A copy of an FMU with another text in its model description."""
    copy = folder / path.name
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(copy, "w") as other:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                assert old.encode() in content
                content = content.replace(old.encode(), new.encode())
            other.writestr(name, content)
    return str(copy)


def without_states(system: System, component: str, folder: Path) -> System:
    path = fmus.locate(system.components[component].fmu)
    other = with_description_changed(path, folder, 'canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"')
    return changed(system, {FMU.format(component): other})


@pytest.mark.parametrize(
    ("period", "delay"), [(1.5, 0.0), (2.01, 0.0), (0.5, 0.3), (0.5, 0.7), (0.05, 0.68), (0.05, 0.69)]
)
def test_the_growth_is_that_of_the_eigenvalues_of_theory(
    system: System, instances: Instances, period: float, delay: float
) -> None:
    varied = changed(system, {PERIOD: period, DELAY: delay})
    assert growth_of_loop(varied, instances) == pytest.approx(theory(period, delay), abs=1e-10)


def test_a_plant_that_takes_short_steps_of_one_length_only_makes_the_same_loop(
    system: System, instances: Instances, tmp_path: Path
) -> None:
    path = fmus.locate(system.components["plant"].fmu)
    variable = "canHandleVariableCommunicationStepSize"
    fixed = with_description_changed(path, tmp_path, f'{variable}="true"', f'{variable}="false"')
    varied = changed(system, {PERIOD: 0.5, DELAY: 0.3, FMU.format("plant"): fixed})
    assert growth_of_loop(varied, instances) == pytest.approx(theory(0.5, 0.3), abs=1e-10)


def test_the_servo_has_the_spectral_radius_of_theory(instances: Instances) -> None:
    """0.9324 at a delay of 2 ms, to its four digits."""
    servo = changed(example("dc_servo"), {"connections.command.delay": 0.002})
    assert math.exp(0.006 * growth_of_loop(servo, instances)) == pytest.approx(0.9324, abs=5e-5)


@needs_compiler
@pytest.mark.parametrize(("fmi", "pairs"), [(2, [""]), (3, ["[1]", "[2]"])])
def test_fmus_of_others_make_the_loop_that_they_are(
    instances: Instances, tmp_path: Path, fmi: int, pairs: list[str]
) -> None:
    """Two integrators, one of them sampled with the gain -1: y is (1 - T²) y + T u a period later, and u is u - T y."""
    path, period = str(small(tmp_path, fmi=fmi)), 2.1

    def wire(start: str, end: str) -> Connection:
        return Connection(
            name=start, start=tuple(f"{start}.y{i}" for i in pairs), end=tuple(f"{end}.u{i}" for i in pairs)
        )

    loop = System(
        stop_time=10.0,
        components={
            "plant": Component(fmu=path, step=0.7),
            "law": Component(fmu=path, sampling=Sampling(period=period), parameters={"gain": -1.0}),
        },
        connections=(wire("plant", "law"), wire("law", "plant")),
    )
    radius = np.abs(np.linalg.eigvals([[1.0 - period**2, period], [-period, 1.0]])).max()
    assert growth_of_loop(loop, instances) == pytest.approx(math.log(radius) / period, abs=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"connections.command.hold": "first", DELAY: 0.1},
        {"connections.measurement.delay": 0.13},
        {"connections.command.order": "jacobi"},
        {"components.controller.sampling.offset": 0.2, "components.controller.sampling.clock_ratio": 1.25},
        {"connections.measurement.scale": 0.5, "connections.measurement.noise": 0.1, "connections.command.loss": 0.3},
    ],
)
def test_the_growth_is_that_of_twin_runs_under_any_timing(
    system: System, instances: Instances, changes: dict[str, Any]
) -> None:
    varied = changed(system, {PERIOD: 0.4, **changes})
    assert growth_of_loop(varied, instances) == pytest.approx(growth_of(varied, instances).rate, abs=1e-7)


def test_the_quadrotor_s_loop_is_that_of_its_own_linearisation(instances: Instances) -> None:
    scenario = native(timing=Timing(period=0.04, delay=0.013, plant_interval=0.02))
    scenario = scenario.with_changes(parameters={"plant.actuator_time_constant": 0.05})
    expected = math.log(HoverLoop.of(scenario).spectral_radius(0.04, 0.013)) / 0.04
    assert growth_of_loop(at_hover(scenario), instances) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [(1.0, r"the operating point is not at rest: \S+ goes from"), (1e9, "the run leaves the operating point: ")],
)
def test_a_point_that_is_not_at_rest_is_refused_naming_what_moves(
    system: System, instances: Instances, velocity: float, expected: str
) -> None:
    moving = {**system.operating_point, "components.plant.parameters.initial.v": velocity}
    with pytest.raises(UsageError, match=expected) as caught:
        growth_of_loop(dataclasses.replace(system, operating_point=moving), instances)
    one_line(caught.value)


def test_a_source_that_changes_before_the_loop_rests_is_named(instances: Instances, tmp_path: Path) -> None:
    (tmp_path / "load.csv").write_text("time,w\n0,0\n3,1\n1000000,1\n")
    load = Source(file=tmp_path / "load.csv", interpolation="previous", to=("plant.w",))
    with pytest.raises(UsageError, match=r"not at rest: source load\.w changes after 3 s, while the loop .* 7 s: exp"):
        growth_of_loop(dataclasses.replace(example("minimum_variance"), sources={"load": load}), instances)


def test_sampled_components_without_a_common_hyperperiod_are_refused(system: System, instances: Instances) -> None:
    other = changed(system, {PERIOD: 0.0512341}).components["controller"]
    chosen = dataclasses.replace(system, components={**system.components, "other": other})
    with pytest.raises(UsageError, match="have no hyperperiod of at most twenty times the longest period"):
        growth_of_loop(chosen, instances)


def test_a_component_that_rests_as_for_another_value_is_identified_once(
    system: System, instances: Instances, monkeypatch: pytest.MonkeyPatch
) -> None:
    identified: list[str] = []

    def measured(loop: AtRest, name: str) -> AnyTangent | SampledRest:
        identified.append(name)
        return usual(loop, name)

    usual = AtRest._measured
    monkeypatch.setattr(AtRest, "_measured", measured)
    known = KnownTangents()
    values = [(0.5, 0.3), (0.5, 0.4), (0.4, 0.3), (0.6, 0.3), (0.1, 0.05)]
    for period, delay in values:
        varied = changed(system, {PERIOD: period, DELAY: delay})
        assert growth_of_loop(varied, instances, known=known) == pytest.approx(theory(period, delay), abs=1e-10)
    assert identified == ["controller", "plant", "controller", "controller", "plant", "controller", "plant"]


# -- which method is used ---------------------------------------------------------------------------------


def test_the_local_limit_is_through_saved_states_and_as_accurate_as_it_says(system: System) -> None:
    found = local_limits(Varied(request=system, of=DELAY), Range(first=0.66, step=0.02, last=0.72, tolerance=0.01))
    assert found.method == LOOP
    assert found.limit is not None
    assert found.accuracy is not None
    assert found.accuracy < 2e-4
    low, high = (theory(0.05, found.limit + sign * found.accuracy) for sign in (-1, 1))
    assert low < 0.0 < high


def by_rule(limit: float) -> Callable[..., Growth]:
    """In place of runs: what is small grows above a period."""
    return lambda system, *arguments: Growth(rate=system.components["controller"].sampling.period - limit, horizon=1.0)


def test_where_an_fmu_saves_no_state_twin_runs_are_used_and_it_is_said(
    system: System, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(local, "growth_of", by_rule(2.0))
    varied = Varied(request=without_states(system, "controller", tmp_path), of=PERIOD)
    found = local_limits(varied, Range(first=1.9, step=0.1, last=2.1, tolerance=0.1))
    assert found.limit == pytest.approx(2.0, abs=0.02)
    assert found.accuracy == pytest.approx(0.02)
    assert found.limit == round(found.limit or 0.0, 2)
    assert found.method == f"{TWINS} (no spectral radius: the FMU of controller {NO_STATE})"


SPAN = Range(first=0.05, step=0.01, last=0.09, tolerance=0.001)


def test_the_quadrotor_with_a_hold_that_the_hover_loop_has_not_is_linearised_as_any_other_system(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(local, "growth_of_loop", lambda *arguments, known=None: by_rule(0.072)(*arguments).rate)
    found = local_limits(Varied(request=Scenario(timing=Timing(hold="first")), of="period"), SPAN)
    assert found.limit == pytest.approx(0.072, abs=1e-5)
    assert found.method == f"{LOOP} (the loop about hover is for zero-order hold only)"


def test_the_quadrotor_with_a_controller_that_saves_no_state_goes_by_twin_runs_and_it_is_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    plant = with_description_changed(
        fmus.locate("QuadrotorPlant"), tmp_path, 'canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"'
    )
    monkeypatch.setattr(local, "growth_of", by_rule(0.072))
    scenario = Scenario().with_fmus(plant=Path(plant), controller=fmus.locate("UnifiedController"))
    found = local_limits(Varied(request=scenario, of="period"), SPAN)
    assert found.limit == pytest.approx(0.072, abs=2e-4)
    assert found.method is not None
    assert found.method.startswith(f"{TWINS} (no spectral radius: the FMU of plant {NO_STATE}) (")
