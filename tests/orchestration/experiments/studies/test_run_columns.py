"""Runs of a study by column are the runs that it has one by one: settings, seeds, systems, keys, errors, and rows."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.experiments.studies.axes import Axis, LinkedSettings
from orchestration.experiments.studies.checks import check_design, describe_run
from orchestration.experiments.studies.run_columns import RunColumns
from orchestration.experiments.studies.run_key import run_key
from orchestration.experiments.studies.study import Study
from orchestration.simulation.workers.row import Results
from orchestration.simulation.workers.task import Runner, TaskBatch
from orchestration.systems.system.check import check
from orchestration.systems.system.files import Files
from orchestration.systems.system.request import errors_in_own_terms
from quadcosim import UsageError
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.experiments.studies.common import axis, files_in, short, study

SAMPLED = [
    Axis(name="x", targets=("plant.initial.position.x",), low=-0.5, high=1.0),
    Axis(name="gain", targets=("controller.coupling",), multiplies=True, low=0.1, high=9.0, scale="logarithmic"),
    Axis(name="late", targets=("timing.delay",), low=0.0, high=0.01),
    Axis(name="two", targets=("plant.initial.position.y", "plant.initial.position.z"), low=0.0, high=1.0),
]
LISTED = [
    axis("plant.mass", 1.0, 1.1, 1.2),
    axis("timing.order", "gauss-seidel", "jacobi"),
    axis("seed", 3, 4, 2**62),
    axis("controller.coupling", 1, 2.5, 0.0, -0.0),
    axis("timing.jitter", 0.0, 0.001),
    axis("controller.literal_reference", False, True),
    Axis(name="kind", targets=(), values=("light", "heavy")),
]
KINDS = LinkedSettings(
    axes=("kind",), sets={("heavy",): {"plant.mass": 2.0}}, multiplies={("light",): {"plant.mass": 0.5}}
)


@pytest.fixture(scope="module")
def files() -> Files:
    return files_in()


@st.composite
def studies(draw: st.DrawFn) -> Study:
    axes = draw(st.lists(st.sampled_from([*SAMPLED, *LISTED]), min_size=1, max_size=4, unique_by=lambda one: one.name))
    is_sampled = any(one.values is None for one in axes)
    method = draw(st.sampled_from(["random", "latin-hypercube", "sobol", "morris", "saltelli"]))
    return study(
        *axes, vary_seed=draw(st.booleans()), base=short(stop_time=0.05, jitter=0.001),
        together=(KINDS,) if any(one.name == "kind" for one in axes) else (),
        **({"method": method, "samples": 4, "design_seed": draw(st.integers(0, 9))} if is_sampled else {}),
    )  # fmt: skip


@given(chosen=studies())
def test_settings_seeds_systems_and_keys_are_those_of_single_runs(chosen: Study, files: Files) -> None:
    columns = RunColumns(chosen, files)
    indices = np.arange(len(chosen.points))[::-1][:40]
    block = columns.block(indices)
    keys = columns.keys(block)
    batch = columns.batch(block, keys, None)
    for place, index in enumerate(indices.tolist()):
        system = chosen.system(index, columns.files.start_values)
        assert block.settings[place] == json.dumps(chosen.points[index])
        assert keys[place] == run_key(system, files)
        assert repr(dataclasses.asdict(batch.alone(place).system)) == repr(dataclasses.asdict(system))
        assert (batch.index[place], batch.seed[place]) == (index, system.seed)


def test_runs_that_differ_in_seeds_and_real_parameters_share_a_system(files: Files) -> None:
    def kinds(*axes: Axis, **fields: Any) -> int:
        return len(RunColumns(study(*axes, method="random", samples=16, **fields), files).block(np.arange(16)).kinds)

    position, gain, delay, two = SAMPLED
    assert kinds(position, two, vary_seed=True) == 1
    assert kinds(position, dataclasses.replace(gain, low=0.5)) == 1
    assert kinds(position, delay) == 16
    again = Axis(name="again", targets=position.targets, low=0.0, high=1.0)
    assert kinds(position, again) == 16


WRONG = [
    (axis("plant.mass", 1.0, -1.0, 2.0, -3.0), axis("timing.period", 0.01, 0.02)),
    (axis("plant.mass", -1.0, 1.0), axis("timing.period", -0.01, 0.02)),
    (axis("timing.jitter", 0.0, 0.5), Axis(name="x", targets=("plant.initial.position.x",), low=0.0, high=1.0)),
    (
        axis("plant.mass", 1.0, 1e308),
        Axis(name="m", targets=("plant.drag.x",), multiplies=True, low=-1e308, high=1e308),
    ),
    (axis("controller.coupling", "much", "more"),),
    (Axis(name="m", targets=("timing.order",), multiplies=True, low=1.0, high=2.0),),
]


@pytest.mark.parametrize("axes", WRONG)
def test_a_wrong_design_is_refused_for_its_first_wrong_run_in_the_words_of_that_run(
    axes: tuple[Axis, ...], files: Files
) -> None:
    sampling: dict[str, Any] = {"method": "random", "samples": 5}
    chosen = study(*axes, **(sampling if any(one.values is None for one in axes) else {}))
    starts, errors = files.start_values, []
    for index, point in enumerate(chosen.points):
        try:
            with errors_in_own_terms(chosen.base):
                system = chosen.system(index, starts)
                check(system, files.models_of(system))
        except UsageError as error:
            errors.append(f"{describe_run(index, point)}: {error}")
    with pytest.raises(UsageError) as caught:
        check_design(RunColumns(chosen, files))
    more = f" ({len(errors) - 1} more runs are invalid)" if len(errors) > 1 else ""
    assert str(caught.value) == errors[0] + more


def test_a_study_of_another_plant_than_the_controller_believes_is_warned_of_once(
    files: Files, capsys: pytest.CaptureFixture[str]
) -> None:
    own = (axis("plant.mass", 1.0, 1.1), axis("plant.frame", "ned", "enu"), axis("controller.mass", 1.0))
    for axes, count in ((own[:1], 1), (own[1:2], 1), (own[2:], 0)):
        check_design(RunColumns(study(*axes), files))
        warned = capsys.readouterr().err
        assert (warned.count("\n"), "plant.mass = 1.1" in warned) == (count, axes == own[:1])


@needs_compiler
def test_rows_of_runs_by_column_have_the_bits_of_runs_with_a_system_each(tmp_path: Path) -> None:
    chosen = study(
        SAMPLED[0], SAMPLED[1], axis("timing.period", 0.01, 0.02), axis("plant.mass", 0.0, 1.0), vary_seed=True,
        base=short(jitter=0.004, noise={"position": 0.01}), method="random", samples=3, native=True,
    )  # fmt: skip
    columns = RunColumns(chosen, chosen.files())
    block = columns.block(np.arange(len(chosen.points)))
    batch = columns.batch(block, columns.keys(block), None).at(columns.files.fmus)
    together = Runner().run(batch)
    each = TaskBatch.of([batch.alone(place) for place in range(len(batch))])
    assert bits(together) == bits(Runner().run(each))
    assert sorted(set(together.failed.tolist())) == [False, True]


def bits(results: Results) -> tuple[Any, ...]:
    numbers = {name: values.tobytes() for name, values in results.numbers.items()}
    return numbers, results.texts, results.failed.tolist(), results.messages, results.engines


def test_a_loss_that_is_wrong_is_named_as_its_axis_sets_it(files: Files) -> None:
    both, one = axis("timing.loss", 0.0, 1.4), axis("timing.measurement_loss", 1.4)
    for axes, name in (((both,), "loss"), ((one,), "measurement_loss"), ((both, one), "measurement_loss")):
        with pytest.raises(UsageError, match=rf": timing\.{name} = 1\.4: expected a probability"):
            check_design(RunColumns(study(*axes), files))
