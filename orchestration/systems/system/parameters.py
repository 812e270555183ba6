"""Parameters of an FMU from nested tables of files."""

from collections.abc import Iterator, Mapping
from typing import Any

from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.systems.system.component import Parameter

Values = Mapping[str, Parameter]
"""Parameters by target, as axes of studies name them"""


def parameters_in(table: Mapping[str, Any], place: str) -> dict[str, Parameter]:
    """The values of a table by dotted names; raises `UsageError`, naming the `place`, for an invalid value."""
    found = dict(flattened(table))
    for name, value in found.items():
        if not isinstance(value, (int, float, str)):
            raise UsageError(f"{place}.{name} = {shown(repr(value))}: expected a number, true, false or a text")
    return found


def flattened(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested tables by dotted names: `gain.eta = 15` and `"gain.eta" = 15` mean the same.

    An empty table is kept as a value, which the caller rejects.
    """
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from flattened(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
