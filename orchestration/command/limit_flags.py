"""Flags of the commands that look at foreign files: what the process that does so may take."""

from dataclasses import dataclass
from typing import Annotated

import typer

from orchestration.basics.errors import UsageError
from orchestration.processes.confined import Limits


@dataclass(frozen=True, kw_only=True)
class LimitFlags:
    """What was given on the command line; raises `UsageError` for what is not positive."""

    time_limit: Annotated[
        float, typer.Option("--time-limit", help="For all that is done with an FMU.", metavar="SECONDS")
    ] = Limits.time
    memory_limit: Annotated[
        float, typer.Option("--memory-limit", help="Of the FMU's process and what it starts (Linux).", metavar="MB")
    ] = Limits.memory
    size_limit: Annotated[
        float, typer.Option("--size-limit", help="That an FMU may unpack to, and a file that it writes.", metavar="MB")
    ] = Limits.size
    output_limit: Annotated[float, typer.Option("--output-limit", help="That an FMU may print.", metavar="MB")] = (
        Limits.output
    )

    def __post_init__(self) -> None:
        for name in ("time", "memory", "size", "output"):
            value, unit = getattr(self, f"{name}_limit"), "seconds" if name == "time" else "MB"
            if not value > 0.0:
                raise UsageError(f"--{name}-limit {value:g}: expected a positive number of {unit}")

    @property
    def limits(self) -> Limits:
        """The same for the process."""
        return Limits(time=self.time_limit, memory=self.memory_limit, size=self.size_limit, output=self.output_limit)
