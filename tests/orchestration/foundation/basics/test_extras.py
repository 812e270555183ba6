"""The error for a missing optional package, and when it is raised."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.comparison import run as comparing
from orchestration.experiments.tuning import tune as tuning
from orchestration.foundation.basics.extras import needs
from quadcosim import QuadcosimError


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    def hide(package: str) -> None:
        monkeypatch.setitem(sys.modules, package, None)

    return hide


@pytest.mark.parametrize(
    ("package", "extra", "command"),
    [
        ("pandas", "studies", lambda: comparing.compare(None)),  # type: ignore[arg-type]
        ("cma", "studies", lambda: tuning.tune(None, out="out")),  # type: ignore[arg-type]
    ],
)
def test_a_missing_package_is_reported_before_anything_is_done(
    package: str, extra: str, command: Callable[[], Any], without: Callable[[str], None], tmp_path: Path
) -> None:
    without(package)
    with pytest.raises(QuadcosimError, match=rf"^{package} is not installed; .*quadcosim\[{extra}\]'$"):
        command()


def test_with_its_packages_a_function_is_unchanged() -> None:
    @needs("json")
    def doubled(value: int) -> int:
        """Twice a value."""
        return 2 * value

    assert doubled(2) == 4
    assert doubled.__doc__ == "Twice a value."
