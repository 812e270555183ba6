import fnmatch
from pathlib import Path

import pytest

from orchestration.basics.documents import read_toml

ROOT = Path(__file__).parents[1]
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


@pytest.mark.parametrize("file", [str(file) for file in FILES])
def test_a_file_beside_modules_is_in_the_wheel(file):
    path = ROOT / file
    assert (path.parent / "__init__.py").is_file(), "expected a folder that is a package"
    assert any(fnmatch.fnmatch(path.name, pattern) for pattern in SETTINGS["package-data"]["*"])
