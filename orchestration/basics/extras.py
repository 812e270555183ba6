"""Packages that the base install does without, and what is said where one of them is needed and not there."""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from orchestration.basics.errors import QuadcosimError

EXTRAS = {
    "studies": ("cma", "dask", "distributed", "filelock", "pandas", "SALib", "scipy", "xarray"),
    "interop": ("libcosimpy", "ecospy", "tbb", "fmu-manipulation-toolbox"),
    "report": ("plotly",),
    "gym": ("gymnasium",),
    "control": ("control",),
}
"""By the extra that brings them."""

Asked = ParamSpec("Asked")
Given = TypeVar("Given")


def extra_of(package: str | None) -> str | None:
    """The extra that brings a package; None if none does."""
    top = (package or "").partition(".")[0]
    return next((extra for extra, packages in EXTRAS.items() if top in packages), None)


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
