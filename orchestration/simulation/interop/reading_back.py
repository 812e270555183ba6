"""Whether installed third-party masters read a written SSP: each runs its first steps."""

import importlib.metadata
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fmu_kit.new_files import write_atomically
from fmu_kit.scratch import temporary_folder
from orchestration.foundation.processes.child import Child
from orchestration.simulation.interop.catalogue import TOOLS
from orchestration.simulation.interop.job import Job
from orchestration.simulation.requests.ssp.export import Export

READERS = tuple(name for name in TOOLS if name.endswith(", SSP"))
STEPS = 2
"""Steps that each runs: by then parameters are set and values exchanged"""
TIME_LIMIT = 60.0
"""Time limit of a master [s]"""


@dataclass(frozen=True, kw_only=True)
class Reading:
    """The result of one master."""

    master: str
    """its name and version"""
    refusal: str | None
    """why it does not run the file; None if it does"""


def readings(ssp: Path, export: Export) -> Iterator[Reading]:
    """The result of each installed master that reads SSPs, one after the other, in separate processes."""
    with temporary_folder() as temporary:
        job = Job(
            fmus={part.name: part.fmu for part in export.parts},
            ssp=ssp.absolute(),
            step=export.step,
            stop=STEPS * export.step,
            parameters={part.name: part.parameters for part in export.parts},
            connections=(),
            signals=tuple(f"{part.name}.{name}" for part in export.parts for name in part.outputs),
            recorded=temporary,
            folder=temporary,
        )
        write_atomically(job.folder / "job.json", job.to_json())
        for name in READERS:
            tool = TOOLS[name]
            try:
                versions = tool.versions()
            except importlib.metadata.PackageNotFoundError:
                continue
            command = tool.command(job.folder / "job.json", job.folder / "rows.npy")
            ending = Child(command, folder=job.folder, communicates=False).ending(TIME_LIMIT)
            refusal = None if ending.code == 0 else ending.last_line or ending.description
            yield Reading(master=f"{name.removesuffix(', SSP')} {versions[tool.packages[0]]}", refusal=refusal)
