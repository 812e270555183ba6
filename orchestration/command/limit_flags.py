"""Flags for the resource limits of processes: of checks of FMUs, and of runs."""

from dataclasses import dataclass
from typing import Annotated

import typer

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.processes.limits import Limits


@dataclass(frozen=True, kw_only=True)
class LimitFlags:
    """The limits of checks; raises `UsageError` for values that are not positive."""

    time_limit: Annotated[
        float,
        typer.Option("--time-limit", help="Time limit for all checks of an FMU.", metavar="SECONDS"),
    ] = Limits.time
    memory_limit: Annotated[
        float,
        typer.Option("--memory-limit", help="Memory of the FMU's process and its children (Linux).", metavar="MB"),
    ] = Limits.memory
    size_limit: Annotated[
        float, typer.Option("--size-limit", help="Size of an unpacked FMU, and of a file that it writes.", metavar="MB")
    ] = Limits.size
    output_limit: Annotated[
        float, typer.Option("--output-limit", help="Output that an FMU may print.", metavar="MB")
    ] = Limits.output

    def __post_init__(self) -> None:
        for name in ("time", "memory", "size", "output"):
            expect_positive(f"--{name}-limit", getattr(self, f"{name}_limit"), "seconds" if name == "time" else "MB")

    @property
    def limits(self) -> Limits:
        """The limits for the process."""
        return Limits(time=self.time_limit, memory=self.memory_limit, size=self.size_limit, output=self.output_limit)


TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        help="Limit on the processor time of a run, idle waiting included; default: none.",
        metavar="SECONDS",
        show_default=False,
    ),
]


@dataclass(frozen=True, kw_only=True)
class ProcessFlags:
    """The limits of a run; raises `UsageError` for values that are not positive."""

    in_process: Annotated[
        bool,
        typer.Option(
            "--in-process",
            help="Load foreign FMUs into this process: if one crashes, everything ends.",
            show_default=False,
        ),
    ] = False
    time_limit: TimeLimit = None
    memory_limit: Annotated[
        float, typer.Option("--memory-limit", help="Memory of a run's process and its children (Linux).", metavar="MB")
    ] = Limits.memory

    def __post_init__(self) -> None:
        expect_positive("--time-limit", self.time_limit, "seconds")
        expect_positive("--memory-limit", self.memory_limit, "MB")


def expect_positive(flag: str, value: float | None, unit: str) -> None:
    """Raise `UsageError` for a limit that is not positive."""
    if value is not None and not value > 0.0:
        raise UsageError(f"{flag} {value:g}: expected a positive number of {unit}")
