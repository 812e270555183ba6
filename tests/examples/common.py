"""What the tests of the examples share: their systems as a user has them, and the largest value that is good."""

from collections.abc import Mapping
from typing import Any

from orchestration.components.building import fmus
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from tests.places import EXAMPLES

NAMES = sorted(path.parent.name for path in EXAMPLES.glob("*/system.toml"))


def example(name: str, changes: Mapping[str, Any] | None = None) -> System:
    """The system of an example, changed by path; its FMUs are built when it is run."""
    return changed(load_system(EXAMPLES / name / "system.toml"), changes or {})


def native_example(name: str, changes: Mapping[str, Any] | None = None) -> System:
    """The same by native FMUs, which `test_native` shows to make the runs that those with Python inside make."""
    return fmus.native_twins(example(name, changes))
