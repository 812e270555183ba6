"""What is added has all its parts, as `docs/architecture.md` lists them under Where to add."""

import importlib
import inspect
import re
from collections import Counter
from typing import Any

import pytest
import typer.main

from fmu_kit.bundle import Target
from orchestration.command import cli
from orchestration.components.building.models import MODELS
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.simulation.engines.batch.folds import LANES
from orchestration.simulation.figures.views import VIEWS
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.reductions import REDUCTIONS
from orchestration.systems.signals.motions import MOTIONS
from tests.examples.common import NAMES
from tests.places import EXAMPLES, ROOT
from tests.slaves import get, put

PAGES = {path: path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md"))}
TESTS = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
OF_METRICS = ROOT / "tests/orchestration/quadrotor/scenarios/test_metrics.py"
DRAWN = "".join(
    path.read_text(encoding="utf-8")
    for name in ("figures", "schedule")
    for path in (ROOT / "tests").rglob(f"test_{name}.py")
)
COMMANDS = sorted(typer.main.get_command_name(place.split(".")[1]) for of in cli.COMMANDS.values() for place in of)
LISTS_OF_MOTIONS = (
    "command/flags.py",
    "components/scaffold/controller_system.toml.tmpl",
    "quadrotor/scenarios/translation.py",
    "systems/system/connection.py",
)
FIGURES = sorted({name for view in VIEWS.values() for name in view.names})


def words(*cells: str) -> set[str]:
    """The names in cells of a table, without their arguments."""
    return set(" ".join(re.sub(r"\(.*?\)", "", text) for cell in cells for text in re.findall("`(.*?)`", cell)).split())


def outputs_at_first(slave: Any, names: list[str], values: dict[str, float]) -> list[float]:
    """When initialisation ends, with these values."""
    made = slave(instance_name="one")
    put(made, values)
    made.setup_experiment(0.0)
    made.enter_initialization_mode()
    made.exit_initialization_mode()
    return get(made, *names)


@pytest.mark.parametrize("model", MODELS)
def test_no_output_moves_at_first_with_what_it_is_not_declared_to_depend_on(model: str) -> None:
    module, _, name = MODELS[model].partition(":")
    slave = getattr(importlib.import_module(module), name)
    outputs = [v.name for v in slave.variables if v.causality == "output" and v.type == "Real"]
    given = {v.name: v.start for v in slave.variables if v.is_settable and v.type == "Real"}
    start = {name: 0.01 * k for k, (name, value) in enumerate(given.items(), start=1) if value == 0.0}
    start = {name: value for name, value in start.items() if not name.startswith(("motor.", "payload.drop", "sample_"))}
    before = outputs_at_first(slave, outputs, start)
    known = {output: slave.initial_dependencies(output) for output in outputs}
    where = inspect.getsourcefile(slave.initial_dependencies), inspect.getsourcelines(slave.initial_dependencies)[1]
    for each, value in given.items():
        after = outputs_at_first(slave, outputs, {**start, each: 0.99 * start.get(each, value)})
        for output in (output for output, a, b in zip(outputs, before, after) if a != b):
            depends = known[output]
            assert depends is None or each in depends, (
                f"{model}.{output} moves with {each} when initialisation ends: expected {each} in what "
                f"initial_dependencies, line {where[1]} of {where[0]}, has for {output}; or None there, for any"
            )


@pytest.mark.parametrize("model", MODELS)
def test_every_variable_says_what_it_is(model: str) -> None:
    module, _, name = MODELS[model].partition(":")
    slave = getattr(importlib.import_module(module), name)
    for variable in slave.variables:
        assert variable.description, (
            f"{model}.{variable.name}: expected a description, as the first argument of its declaration in "
            f"{module.partition('.')[0]}/"
        )


@pytest.mark.parametrize("model", MODELS)
def test_a_page_and_an_icon_lie_beside_every_slave(model: str) -> None:
    target = Target.parse(MODELS[model])
    missing = [str(path.relative_to(ROOT)) for path in (target.fragment, target.icon) if not path.is_file()]
    assert missing == [], (
        f"{missing}: expected a page with equations and departures (.html), and an icon (.png) that docs/make_icons.py "
        f"draws"
    )


def test_every_reduction_has_its_form_in_lanes() -> None:
    assert set(REDUCTIONS) == set(LANES), (
        f"{set(REDUCTIONS) ^ set(LANES)}: expected each reduction of orchestration/systems/expressions/reductions.py "
        f"in LANES of orchestration/simulation/engines/batch/folds.py, and no other"
    )


def test_the_page_of_systems_has_every_function_of_the_language() -> None:
    row = re.search(
        r"^\| at one instant \| over a run \|\n\|.*\n\|(.*)\|(.*)\|$", PAGES[ROOT / "docs/systems.md"], re.M
    )
    assert row is not None, "docs/systems.md: expected the table | at one instant | over a run |"
    for cell, known in ((row[1], {n for n, made in OPERATORS.items() if made.tree is None}), (row[2], {*REDUCTIONS})):
        assert words(cell) == known, f"{words(cell) ^ known}: expected the same in the table of docs/systems.md"


def test_the_page_of_figures_has_every_figure_of_a_run() -> None:
    of_runs = PAGES[ROOT / "docs/figures.md"].partition("## Of a run")[2].partition("\n## ")[0]
    rows = words(*re.findall(r"^\| (`.*?`) \|", of_runs, re.M)) - {"--figure"}
    assert rows == {*FIGURES}, f"{rows ^ {*FIGURES}}: expected the same in the table of docs/figures.md, Of a run"


def test_the_page_of_references_has_every_motion() -> None:
    of_motions = PAGES[ROOT / "docs/references.md"].partition("## Motions by name")[2].partition("\n## ")[0]
    rows = words(*re.findall(r"^\| (`.*?`) \|", of_motions, re.M))
    assert rows == {*MOTIONS}, f"{rows ^ {*MOTIONS}}: expected the same in the table of docs/references.md"


@pytest.mark.parametrize("name", NAMES)
def test_an_example_has_its_row_and_its_figure(name: str) -> None:
    row = f"\n| [{name}]({name}/README.md) | "
    assert row in (EXAMPLES / "README.md").read_text(encoding="utf-8"), f"examples/README.md: expected a row of {name}"
    drawn = (EXAMPLES / name / "figure.png").is_file()
    assert drawn, f"examples/{name}: expected a figure.png, which examples/make_figures.py draws"


@pytest.mark.parametrize("file", LISTS_OF_MOTIONS)
def test_every_list_of_motions_has_all(file: str) -> None:
    text = " ".join((ROOT / "orchestration" / file).read_text(encoding="utf-8").replace(" or ", ", ").split())
    assert ", ".join(MOTIONS) in text, f"orchestration/{file}: expected its list of motions to be {', '.join(MOTIONS)}"


@pytest.mark.parametrize("kind", VIEWS)
def test_every_figure_has_its_maker(kind: str) -> None:
    makers, names = {*VIEWS[kind].load().makers}, {*VIEWS[kind].names}
    assert makers == names, f"{makers ^ names}: expected a maker in figures.py of orchestration/quadrotor/flight"


@pytest.mark.parametrize("name", COMMANDS)
def test_a_page_and_a_test_have_every_command(name: str) -> None:
    shown = any(re.search(rf"\bquadcosim {name}\b", text) for text in PAGES.values())
    assert shown, f"quadcosim {name}: expected a line with it in a page of docs/"
    is_called = f'"{name}"' in TESTS
    assert is_called, f'"{name}": expected a test of tests/orchestration/command that calls it'


@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_has_a_flag_twice(name: str) -> None:
    expected = "expected a name that no other flag of it has, in orchestration/command"
    try:
        command = cli.command_line(name).commands[name]
    except ValueError as error:
        pytest.fail(f"quadcosim {name}: {error}: {expected}")
    known = Counter(flag for one in command.params for flag in {*one.opts, *one.secondary_opts})
    twice = [flag for flag, times in known.items() if times > 1]
    assert twice == [], f"quadcosim {name}: {twice}: {expected}"


@pytest.mark.parametrize("name", quadrotor().objectives)
def test_a_test_has_every_metric(name: str) -> None:
    assert f'"{name}"' in OF_METRICS.read_text(encoding="utf-8"), (
        f'"{name}": expected a test with a signal for which it is known, in {OF_METRICS.relative_to(ROOT)}'
    )


@pytest.mark.parametrize("name", FIGURES)
def test_a_test_has_every_figure(name: str) -> None:
    is_drawn = f'"{name}"' in DRAWN
    assert is_drawn, f'"{name}": expected a test of what it draws, in a test_figures.py of tests/orchestration'
