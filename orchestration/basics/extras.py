"""Packages that the base install does without, and what is said where one of them is needed and not there."""

import functools
import importlib.util
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from orchestration.basics.errors import QuadcosimError

EXTRAS = {
    "studies": ("cma", "dask", "distributed", "filelock", "pandas", "SALib", "scipy", "xarray"),
    "interop": ("libcosimpy", "ecospy", "tbb", "fmu-manipulation-toolbox"),
    "report": ("plotly",),
    "gym": ("gymnasium",),
    "control": ("control",),
    "certificates": ("clarabel", "flint", "python-flint"),
    "can": ("cantools",),
}
"""By the extra that brings them."""

Asked = ParamSpec("Asked")
Given = TypeVar("Given")


def extra_of(package: str | None) -> str | None:
    """The extra that brings a package; None if none does."""
    top = (package or "").partition(".")[0]
    return next((extra for extra, packages in EXTRAS.items() if top in packages), None)


def needs(*packages: str) -> Callable[[Callable[Asked, Given]], Callable[Asked, Given]]:
    """Makes a function one that is `explained`, and that says so before it does anything where a package is missing."""

    def with_packages(function: Callable[Asked, Given]) -> Callable[Asked, Given]:
        @explained
        @functools.wraps(function)
        def call(*unnamed: Asked.args, **given: Asked.kwargs) -> Given:
            for name in packages:
                if importlib.util.find_spec(name) is None:
                    raise ModuleNotFoundError(f"No module named {name!r}", name=name)
            return function(*unnamed, **given)

        return call

    return with_packages


def explained(function: Callable[Asked, Given]) -> Callable[Asked, Given]:
    """A function that raises `QuadcosimError`, in one line that names the extra, where a package of one is missing."""

    @functools.wraps(function)
    def call(*unnamed: Asked.args, **given: Asked.kwargs) -> Given:
        try:
            return function(*unnamed, **given)
        except ModuleNotFoundError as error:
            extra = extra_of(error.name)
            if extra is None:
                raise
            raise QuadcosimError(
                f"{error.name} is not installed; this needs: pip install 'quadcosim[{extra}]'"
            ) from None

    return call
