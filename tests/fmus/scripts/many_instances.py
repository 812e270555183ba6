"""Make, fly and free one instance after another; print whether the import path and the memory stay as they were."""

import gc
import json
import os
import sys
from pathlib import Path

from tests.fmus.instance import Instance


def resident_kilobytes() -> float:
    """The memory of this process that is in RAM."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1024


def slaves_left(model: str) -> int:
    """How many slaves of that class are alive, freed or not."""
    return sum(type(thing).__name__ == model and hasattr(thing, "log_queue") for thing in gc.get_objects())


def references_to_entry_globals() -> int:
    """Held to the globals of the module that pythonfmu runs for each instance, and drops one of each time.

    At none they would be freed under the running module, which seldom shows at once. An FMU of C has no such module.
    """
    entries = [module for name, module in sys.modules.items() if name.endswith("_entry") and "quadcosim" in name]
    assert len(entries) <= 1
    return sum(sys.getrefcount(vars(entry)) for entry in entries)


def main(fmu: Path, count: int, warm_up: int) -> dict[str, object]:
    path_before = list(sys.path)
    path_kept, slaves_seen, memory, references, flights = True, 0, [], [], set()
    for _ in range(count):
        with Instance(fmu, anew=True) as instance:  # as fmpy's own simulate does
            instance.initialise({})
            for k in range(20):
                instance.step(0.01 * k, 0.01)
            flights.add("\n".join(instance.everything()))
            slaves_seen = max(slaves_seen, slaves_left(fmu.stem))
            path_kept &= sys.path == path_before
        gc.collect()
        memory.append(resident_kilobytes())
        references.append(references_to_entry_globals())
    return {
        "path kept": path_kept and sys.path == path_before,
        "slaves seen at most": slaves_seen,
        "slaves left": slaves_left(fmu.stem),
        "references lost": references[0] - min(references),
        "different flights": len(flights),
        "growth per instance in kB": (memory[-1] - memory[warm_up - 1]) / (count - warm_up),
    }


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))))
