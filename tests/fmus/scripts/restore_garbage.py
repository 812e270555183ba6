"""Restore bytes that are no state, then reset and free; print how often that was refused and survived."""

import gc
import json
import sys
from pathlib import Path

from fmpy.fmi1 import FMICallException

from tests.fmus.instance import Instance

GARBAGE = (
    *(b"no state", b"", b"[]", b"{}", b"\xff\x00"),
    *(b"[" * 1000, b'{"a": ' + b"[" * 900 + b"]" * 900 + b"}", b'{"model": "\\ud800"}', b"9" * 5000),
)
REPETITIONS = 10


def refuses(instance: Instance, content: bytes) -> bool:
    """Whether the FMU calls it a failure."""
    try:
        instance.restore(content)
    except FMICallException:
        return True
    return False


def main(fmu: Path) -> dict[str, int]:
    refused = revived = 0
    for k in range(REPETITIONS):
        instance = Instance(fmu)
        instance.initialise({})
        refused += refuses(instance, GARBAGE[k % len(GARBAGE)])
        refused += refuses(instance, GARBAGE[k % len(GARBAGE)])  # a call after a failure
        gc.collect()
        instance.fmu.reset()
        instance.initialise({})
        instance.step(0.0, 0.01)
        revived += 1
        instance.free()
        gc.collect()
    return {"refused": refused, "revived": revived}


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
