"""Agreements of lanes with FMUs that earlier sweeps have found, kept in the user's cache.

They vouch for machine code: that of the same FMUs in systems of the same outline, made by this compiler for this
processor, and run by this version of the software. Numbers that vary within a study do not select other code.
"""

import contextlib
import dataclasses
import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fmu_kit.libraries import compiler, processor
from fmu_kit.new_files import write_atomically
from orchestration.components.building.fmus import python_twin
from orchestration.simulation.engines.batch.shape import outline
from orchestration.simulation.workers.batching import SAMPLE, LaneAgreement
from orchestration.simulation.workers.provenance import machine, versions
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System


def place_of(systems: Iterable[System], files: Files) -> Path:
    """The place of the agreement of a sample of runs: a hash of what it vouches for."""
    import platformdirs

    sampled = list(systems)
    fmus = {fmu for system in sampled for fmu in system.fmus.values()}
    twins = {python_twin(fmu) for fmu in fmus} & files.fmus.keys()
    code = [machine(), versions(), compiler(), processor(), {fmu: files.hashes[fmu] for fmu in fmus | twins}]
    content = _text([sorted({_text([outline(system), _choices(system)]) for system in sampled}), code])
    key = hashlib.sha256(content.encode()).hexdigest()
    return Path(platformdirs.user_cache_dir("quadcosim")) / "agreement" / f"{key}.json"


def is_kept(place: Path) -> bool:
    """Whether a whole sample has agreed."""
    try:
        return _vouches(LaneAgreement.from_text(place.read_text(encoding="utf-8")))
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return False


def keep(place: Path, found: LaneAgreement) -> None:
    """Keep the agreement of a whole sample; a difference ends what is kept."""
    if _vouches(found) or not found.agrees:
        with contextlib.suppress(OSError):  # where nothing can be written, each sweep repeats the whole sample
            write_atomically(place, found.as_text())


def _vouches(found: LaneAgreement) -> bool:
    return found.runs == SAMPLE and found.agrees


def _choices(system: System) -> dict[str, dict[str, Any]]:
    """The parameters that may select other code: all but real numbers."""
    return {
        name: {key: value for key, value in component.parameters.items() if not isinstance(value, float)}
        for name, component in system.components.items()
    }


def _text(content: Any) -> str:
    return json.dumps(content, sort_keys=True, default=_plain)


def _plain(part: Any) -> Any:
    return sorted(part) if isinstance(part, frozenset) else dataclasses.asdict(part)
