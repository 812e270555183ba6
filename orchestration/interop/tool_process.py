"""`python -m orchestration.interop.tool_process TOOL JOB ROWS`: one flight of a tool.

Tools bring native libraries that need not get along, and log what they like.
"""

import os
import sys
from pathlib import Path

import numpy as np

from orchestration.interop.catalogue import TOOLS
from orchestration.interop.job import Job


def main(tool: str, job: str, rows: str) -> None:
    """Fly the job in a JSON file, write the rows to an .npy file."""
    np.save(rows, np.array(TOOLS[tool].function()(Job.from_json(Path(job).read_text(encoding="utf-8")))))
    os._exit(0)  # what pythonfmu's library does wrong as a process ends is not this flight's


if __name__ == "__main__":
    main(*sys.argv[1:])
