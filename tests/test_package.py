import fnmatch

from orchestration.foundation.basics.documents import read_toml
from tests.places import ROOT

SETTINGS = read_toml(ROOT / "pyproject.toml", "settings")["tool"]["setuptools"]
PACKAGES = [pattern.removesuffix("*") for pattern in SETTINGS["packages"]["find"]["include"]]
FILES = [
    path.relative_to(ROOT)
    for package in PACKAGES
    for path in (ROOT / package).rglob("*")
    if path.is_file() and path.suffix not in (".py", ".fmu") and path.parent.name != "__pycache__"
]


def test_packages_have_files_beside_their_modules():
    assert {file.name for file in FILES} >= {"loop.c", "instance.h", "system.toml", "UnifiedController.html"}


def test_files_beside_modules_are_in_the_wheel():
    assert [file for file in FILES if not (ROOT / file.parent / "__init__.py").is_file()] == [], "expected packages"
    patterns = SETTINGS["package-data"]["*"]
    assert [file for file in FILES if not any(fnmatch.fnmatch(file.name, pattern) for pattern in patterns)] == []
