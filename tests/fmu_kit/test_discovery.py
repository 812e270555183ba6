"""Slaves are found in the sources of a folder, without running any of them."""

from pathlib import Path

import pytest

from fmu_kit.bundle import PackagingError, Target
from fmu_kit.discovery import slave_beside, slaves_in
from fmu_kit.packaging import slave_class
from tests.places import ROOT

TANK = """
from fmu_kit.slave import Slave


class Tank(Slave):
    def step(self, t, h): ...
"""
OTHERS = '''
from base import Base as Ancestor
from fmu_kit import slave

raise SystemExit("imported")


class Pump(Ancestor):
    """By a base class of another module, whose method it defines."""

    def law(self): ...


class Unfinished(Ancestor):
    pass


class Law:
    def step(self, t, h): ...


class Law2(Law):
    def law(self): ...
'''
BASE = """
from abc import abstractmethod
from fmu_kit.slave import Slave

class Base(Slave):
    def step(self, t, h): ...

    @abstractmethod
    def law(self): ...
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "plants"
    folder.mkdir()
    for name, text in (("tank", TANK), ("others", OTHERS), ("base", BASE)):
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return folder


def test_classes_made_from_slave_that_leave_no_method_open_are_found(folder: Path) -> None:
    assert slaves_in(folder) == [Target("others", "Pump", folder), Target("tank", "Tank", folder)]


def test_modules_of_a_package_are_named_from_where_its_outermost_package_lies(folder: Path) -> None:
    inner = folder / "inner"
    inner.mkdir()
    for package in (folder, inner):
        (package / "__init__.py").touch()
    (inner / "tank.py").write_text("from ..base import Base\nclass Tank(Base):\n    def law(self): ...\n")
    assert slaves_in(inner) == [Target("plants.inner.tank", "Tank", folder.parent)]


SHARED = """
from abc import abstractmethod
from fmu_kit.slave import Slave
class Laws(Slave):
    @abstractmethod
    def law(self): ...
class Gains(Laws):
    def read(self): ...
class Stepped(Laws):
    def step(self, t, h): ...
    def law(self): ...
class Whole(Gains, Stepped): ...
class Other(Stepped, Gains): ...
class Open(Gains, Laws): ...
class Again(Stepped):
    @abstractmethod
    def law(self): ...
class Nothing(Laws, Gains): ...
"""


def test_what_one_base_leaves_open_another_may_define_as_python_looks_for_it(tmp_path: Path) -> None:
    (tmp_path / "shared.py").write_text(SHARED, encoding="utf-8")
    assert [target.model for target in slaves_in(tmp_path)] == ["Stepped", "Whole", "Other"]


def test_the_projects_own_slaves_are_found() -> None:
    assert slaves_in(ROOT / "controller_fmu" / "sliding_mode") == [
        Target("controller_fmu.sliding_mode.slave", "UnifiedController", ROOT)
    ]


def test_an_fmu_goes_with_the_class_of_its_name_in_its_folder(folder: Path) -> None:
    assert slave_beside(folder / "Tank.fmu") == Target("tank", "Tank", folder)
    for name in ("Unfinished", "Law", "Tan", "Missing"):
        assert slave_beside(folder / f"{name}.fmu") is None
    assert slave_beside(folder / "nowhere" / "Tank.fmu") is None


def test_a_source_that_is_no_python_is_named_with_its_line(folder: Path) -> None:
    (folder / "bad.py").write_text("x = 1\ndef f(:\n", encoding="utf-8")
    with pytest.raises(PackagingError, match=r"bad\.py:2: invalid syntax; expected Python$"):
        slaves_in(folder)


def test_a_law_whose_init_takes_nothing_is_refused_in_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "begun.py").write_text(
        'from fmu_kit.slave import Slave\n\n\nclass Begun(Slave):\n    """A law."""\n\n'
        "    def __init__(self):\n        super().__init__()\n\n    def step(self, t, h):\n        pass\n"
    )
    with pytest.raises(PackagingError, match=r"begun:Begun\.__init__: .*: expected none, .* is a Local"):
        slave_class(Target.parse("begun:Begun"))
