"""`python -m orchestration.simulation.interop.tool_process TOOL JOB ROWS`: one run of a tool.

Tools load native libraries that may conflict, and log freely; so each runs in a separate process.
"""

import os
import sys
from pathlib import Path

import fmpy  # noqa: F401 - once, before the processes of the tools are forked: half of them use it
import numpy as np

from orchestration.simulation.interop.catalogue import TOOLS
from orchestration.simulation.interop.job import Job


def main(tool: str, job: str, rows: str) -> None:
    """Run the job in a JSON file, write the rows to an .npy file."""
    np.save(rows, np.array(TOOLS[tool].function()(Job.from_json(Path(job).read_text(encoding="utf-8")))))
    os._exit(0)  # at once: pythonfmu's library may crash as a process ends


if __name__ == "__main__":
    main(*sys.argv[1:])
