"""The package: its names, their documentation, and that programs which use it are typed."""

import ast
import dataclasses
import inspect
import pydoc
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import orchestration
import quadcosim
from tests.places import ROOT

CLASSES = [name for name in quadcosim.__all__ if inspect.isclass(getattr(quadcosim, name))]
DATACLASSES = [name for name in CLASSES if dataclasses.is_dataclass(getattr(quadcosim, name))]


def test_completion_finds_all_names_and_nothing_else() -> None:
    assert dir(quadcosim) == sorted(quadcosim.__all__)
    assert all(getattr(quadcosim, name) is not None for name in quadcosim.__all__)


def test_a_name_that_there_is_not_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module quadcosim has no attribute runn"):
        getattr(quadcosim, "runn")  # noqa: B009


def test_the_old_package_gives_the_same_objects() -> None:
    names = [name for name in quadcosim.__all__ if not isinstance(getattr(orchestration, name), ModuleType)]
    assert {*quadcosim.__all__} - {*names} <= {"report", "schedule"}
    assert all(getattr(orchestration, name) is getattr(quadcosim, name) for name in names)


def test_help_begins_with_a_way_in_and_has_every_class() -> None:
    text = pydoc.plain(pydoc.render_doc(quadcosim))
    assert "quadcosim.run(Scenario(timing=Timing(period=0.02)))" in text
    for name in CLASSES:
        assert f"class {name}(" in text


@pytest.mark.parametrize("name", quadcosim.__all__)
def test_everything_has_a_docstring_that_begins_with_a_sentence(name: str) -> None:
    first = inspect.getdoc(getattr(quadcosim, name)).partition("\n\n")[0]  # type: ignore[union-attr]
    assert first.endswith((".", ":"))
    assert first[0].isupper()


@pytest.mark.parametrize("name", DATACLASSES)
def test_every_field_has_a_sentence_of_its_own(name: str) -> None:
    cls = getattr(quadcosim, name)
    declared = [base for base in reversed(cls.__mro__) if "__dataclass_fields__" in vars(base)]
    documented_fields = {name: text for base in declared for name, text in documented(base).items()}
    for field in dataclasses.fields(cls):
        text = documented_fields.get(field.name, "")
        assert text.endswith(".") and text[0].isupper(), f"{name}.{field.name}: {text!r}"  # noqa: PT018


def documented(cls: type) -> dict[str, str]:
    """The text after each field, as documentation is made of it."""
    (tree,) = ast.parse(inspect.getsource(cls).strip()).body
    assert isinstance(tree, ast.ClassDef)
    found = {}
    for field, text in zip(tree.body, tree.body[1:]):
        match field, text:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(docstring))):
                found[name] = docstring
    return found


def test_the_packages_that_its_types_are_of_say_that_they_are_typed() -> None:
    homes = {inspect.getmodule(getattr(quadcosim, name)).__name__.partition(".")[0] for name in CLASSES}  # type: ignore[union-attr]
    for package in {"quadcosim", "fmu_kit", *homes}:  # else type checkers take what is installed for Any
        assert (ROOT / package / "py.typed").is_file()


def test_a_program_that_uses_the_api_is_typed(tmp_path: Path) -> None:
    """Read with what mypy already knows of the packages, if they have been looked at as `make lint` does."""
    (tmp_path / "program.py").write_text(PROGRAM)
    command = [sys.executable, "-m", "mypy", str(tmp_path / "program.py")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    messages = [line.partition(": ")[2] for line in done.stdout.splitlines() if "program.py" in line]
    assert messages == ERRORS, done.stderr


PROGRAM = """
import numpy as np
import numpy.typing as npt
from typing_extensions import assert_type

import quadcosim
from quadcosim import Scenario, Timing

result = quadcosim.run(Scenario(timing=Timing(period=0.02)))
assert_type(result, quadcosim.Result)
assert_type(result.metrics["ultimate_bound"], float | int | bool | str | None)
assert_type(result.signals["time"], npt.NDArray[np.float64])
assert_type(result.provenance["wall_time"], float)
assert_type(quadcosim.limit(Scenario(), "period"), quadcosim.Limit)
assert_type(quadcosim.limit(Scenario(), "period").large_signal_limit, float | None)
quadcosim.runn()
Timing(period="x")
"""
ERRORS = [
    'error: Module has no attribute "runn"; maybe "run"?  [attr-defined]',
    'error: Argument "period" to "Timing" has incompatible type "str"; expected "float"  [arg-type]',
]
