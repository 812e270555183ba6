"""The package: its names, their documentation, and that it says that it is typed (`typed_program.py`)."""

import ast
import dataclasses
import inspect
import pydoc
import sys
from types import ModuleType

import pytest

import orchestration
import quadcosim
from tests.places import ROOT

NAMES: list[str] = vars(quadcosim)["__all__"]
CLASSES = [name for name in NAMES if inspect.isclass(getattr(quadcosim, name))]
DATACLASSES = [name for name in CLASSES if dataclasses.is_dataclass(getattr(quadcosim, name))]


def test_completion_finds_all_names_and_nothing_else() -> None:
    assert dir(quadcosim) == sorted(NAMES)
    assert all(getattr(quadcosim, name) is not None for name in NAMES)


def test_a_name_that_there_is_not_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module quadcosim has no attribute runn"):
        getattr(quadcosim, "runn")  # noqa: B009


def test_a_name_that_needs_an_extra_says_which(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "flint", None)
    monkeypatch.delitem(sys.modules, "orchestration.theory.certificates.basin", raising=False)
    with pytest.raises(quadcosim.QuadcosimError, match=r"flint is not installed.*quadcosim\[certificates\]"):
        getattr(quadcosim, "basin")  # noqa: B009


def test_the_old_package_gives_the_same_objects() -> None:
    names = [name for name in NAMES if not isinstance(getattr(orchestration, name), ModuleType)]
    assert {*NAMES} - {*names} <= {"report", "schedule"}
    assert all(getattr(orchestration, name) is getattr(quadcosim, name) for name in names)


def test_help_begins_with_a_way_in_and_has_every_class() -> None:
    text = pydoc.plain(pydoc.render_doc(quadcosim))
    assert "quadcosim.run(Scenario(timing=Timing(period=0.02)))" in text
    for name in CLASSES:
        assert f"class {name}(" in text


@pytest.mark.parametrize("name", NAMES)
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
        home = inspect.getsourcefile(next(base for base in reversed(declared) if field.name in base.__annotations__))
        assert text.endswith(".") and text[0].isupper(), (  # noqa: PT018
            f"{name}.{field.name}: {text!r}: expected a sentence in three quotes below it in {home}"
        )


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
