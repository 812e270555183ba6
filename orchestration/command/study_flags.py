"""Flags that the commands of runs, studies, comparisons and tunings share."""

from pathlib import Path
from typing import Annotated

import typer

from orchestration.command import completion

Out = Annotated[Path | None, typer.Option("--out", help="Folder of the store; default: results/NAME.", metavar="DIR")]

Workers = Annotated[int, typer.Option("--workers", help="Processes on this machine.", metavar="N")]

StudyEngineFlag = Annotated[
    str,
    typer.Option(
        "--engine",
        help="Simulation loop; batch: native FMUs, several runs at once in a SIMD batch; "
        "auto: the fastest available one.",
        metavar="auto|python|compiled|batch",
        autocompletion=completion.among("auto", "python", "compiled", "batch"),
    ),
]

TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        help="Limit on the processor time of a run, idle waiting included; default: none.",
        metavar="SECONDS",
        show_default=False,
    ),
]
