"""Flags of the commands that look at foreign files: what the process that does so may take."""

from typing import Annotated, TypeAlias

import typer

from orchestration.checks.confined import Limits
from orchestration.errors import UsageError

TimeLimit: TypeAlias = Annotated[
    float, typer.Option("--time-limit", help="For all that is done with an FMU.", metavar="SECONDS")
]
MemoryLimit: TypeAlias = Annotated[
    float, typer.Option("--memory-limit", help="Of the FMU's process and what it starts (Linux).", metavar="MB")
]
SizeLimit: TypeAlias = Annotated[
    float, typer.Option("--size-limit", help="That an FMU may unpack to, and a file that it writes.", metavar="MB")
]
OutputLimit: TypeAlias = Annotated[float, typer.Option("--output-limit", help="That an FMU may print.", metavar="MB")]


def limits_from(time: float, memory: float, size: float, output: float) -> Limits:
    """The limits that the flags ask for; raises `UsageError` for one that is not positive."""
    for flag, value, unit in (
        ("time", time, "seconds"), ("memory", memory, "MB"), ("size", size, "MB"), ("output", output, "MB"),
    ):  # fmt: skip
        if not value > 0.0:
            raise UsageError(f"--{flag}-limit {value:g}: expected a positive number of {unit}")
    return Limits(time=time, memory=memory, size=size, output=output)
