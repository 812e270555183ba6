"""Libraries of the engines, as `fmu_kit.libraries` keeps them; what stands in the way is this package's error."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fmu_kit import libraries
from fmu_kit.bundle import PackagingError
from orchestration.basics.errors import QuadcosimError


def kept(folder: str, sources: Mapping[str, bytes], how: Any, compiled: Callable[[], bytes]) -> Path:
    """The library that `compiled` makes of `sources`, in the cache's `folder`; `how` is what else decides its content.

    Raises `QuadcosimError` that says what stands in the way.
    """
    try:
        return libraries.kept(folder, sources, how, compiled)
    except (PackagingError, OSError) as error:
        raise QuadcosimError(str(error)) from error
