"""Flags that the commands of runs, studies, comparisons and tunings share."""

from pathlib import Path
from typing import Annotated

from orchestration.command.options import option

Out = Annotated[Path | None, option("--out", "Folder of the store; default: results/NAME.", "DIR")]

STORE = option("--store", "Folder of the store; default: --out if it is there, else results/NAME.", "DIR")

Workers = Annotated[int, option("--workers", "Processes on this machine.", "N")]

Dask = Annotated[str | None, option("--dask", "A dask scheduler instead, e.g. tcp://host:8786.", "URL")]

StudyEngineFlag = Annotated[
    str,
    option(
        "--engine",
        "Simulation loop; batch: native FMUs, several runs at once in a SIMD batch; auto: the fastest available one.",
        "auto|python|compiled|batch",
    ),
]

TimeLimit = Annotated[
    float | None,
    option("--time-limit", "Limit on the processor time of a run, idle waiting included; default: none.", "SECONDS"),
]
