"""Whether other masters read an SSP that was written for them: those that are installed begin to fly it."""

import importlib.metadata
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from orchestration.interop.catalogue import TOOLS
from orchestration.interop.job import Job
from orchestration.processes.child import Child
from orchestration.requests.ssp.export import Export

READERS = tuple(name for name in TOOLS if name.endswith(", SSP"))
STEPS = 2
"""That each flies: parameters are set, and values exchanged, by then."""
PATIENCE = 60.0
"""[s] with a master"""


@dataclass(frozen=True, kw_only=True)
class Reading:
    """What came of one master."""

    master: str
    """its name and version"""
    refusal: str | None
    """why it does not fly the file; None if it does"""


def readings(ssp: Path, given: Export) -> Iterator[Reading]:
    """What came of each master that is installed and reads SSPs, one after the other, in processes of their own."""
    with tempfile.TemporaryDirectory() as temporary:
        job = Job(
            fmus={part.name: part.fmu for part in given.parts},
            ssp=ssp.absolute(),
            step=given.step,
            stop=STEPS * given.step,
            parameters={part.name: part.parameters for part in given.parts},
            connections=(),
            signals=tuple(f"{part.name}.{name}" for part in given.parts for name in part.outputs),
            recorded=Path(temporary),
            folder=Path(temporary),
        )
        (job.folder / "job.json").write_text(job.to_json(), encoding="utf-8")
        for name in READERS:
            tool = TOOLS[name]
            try:
                versions = tool.versions()
            except importlib.metadata.PackageNotFoundError:
                continue
            command = tool.command(job.folder / "job.json", job.folder / "rows.npy")
            ending = Child(command, folder=job.folder, communicates=False).ending(PATIENCE)
            refusal = None if ending.code == 0 else ending.last_line or ending.description
            yield Reading(master=f"{name.removesuffix(', SSP')} {versions[tool.packages[0]]}", refusal=refusal)
