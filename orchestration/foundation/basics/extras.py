"""Optional packages by extra, and the error where a missing one is needed."""

import functools
import importlib.util
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from orchestration.foundation.basics.errors import QuadcosimError

EXTRAS = {
    "studies": ("cma", "dask", "distributed", "filelock", "pandas", "SALib", "scipy", "xarray"),
    "interop": ("libcosimpy", "ecospy", "tbb", "fmu-manipulation-toolbox"),
    "gym": ("gymnasium",),
    "control": ("control",),
    "certificates": ("clarabel", "flint", "python-flint"),
    "can": ("cantools",),
    "live": ("ziglang",),
}
"""Packages by the extra that installs them"""

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def lack_of(package: str | None) -> str | None:
    """That a package is missing, with the extra that installs it; None if none does."""
    top = (package or "").partition(".")[0]
    extra = next((extra for extra, packages in EXTRAS.items() if top in packages), None)
    return None if extra is None else f"{package} is not installed; this needs: pip install 'quadcosim[{extra}]'"


def needs(*packages: str) -> Callable[[Callable[Parameters, Result]], Callable[Parameters, Result]]:
    """Decorate a function as `explains_missing`, and check for these packages before it does anything."""

    def with_packages(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
        @explains_missing
        @functools.wraps(function)
        def call(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
            for name in packages:
                if importlib.util.find_spec(name) is None:
                    raise ModuleNotFoundError(f"No module named {name!r}", name=name)
            return function(*args, **kwargs)

        return call

    return with_packages


def explains_missing(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Decorate a function to raise `QuadcosimError` naming the extra where an optional package is missing."""

    @functools.wraps(function)
    def call(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        try:
            return function(*args, **kwargs)
        except ModuleNotFoundError as error:
            lack = lack_of(error.name)
            if lack is None:
                raise
            raise QuadcosimError(lack) from None

    return call
