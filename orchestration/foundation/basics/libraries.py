"""Compiled libraries of the engines from the cache of `fmu_kit.libraries`, with errors as `QuadcosimError`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fmu_kit import libraries
from fmu_kit.bundle import PackagingError
from orchestration.foundation.basics.errors import QuadcosimError


def cached_library(folder: str, sources: Mapping[str, bytes], how: Any, compiled: Callable[[], bytes]) -> Path:
    """The library that `compiled` makes of `sources`, in the cache's `folder`; `how`: what else decides its content.

    Raises `QuadcosimError` if it cannot be compiled or stored.
    """
    try:
        return libraries.cached_library(folder, sources, how, compiled)
    except (PackagingError, OSError) as error:
        raise QuadcosimError(str(error)) from error
