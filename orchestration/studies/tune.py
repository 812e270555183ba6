"""Searches for every period and seed of a tuning, and nothing twice."""

import dataclasses
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from orchestration.studies.files import Files
from orchestration.studies.identity import versions
from orchestration.studies.tuning import Fly, Found, Tuning, best_by_period, search
from orchestration.studies.tuning_file import gains_text


def tune(
    tuning: Tuning,
    files: Files,
    folder: Path,
    out: Path,
    fly: Fly,
    judge: Fly,
    *,
    command: str,
    progress: Callable[[float], None],
    announce: Callable[[str], None],
) -> list[Path]:
    """The files of tuned parameters, one for each period, in `out`; what each search found is kept in `folder`.

    A search that is done, of the same tuning with the same software, is not done again.
    """
    record = folder / f"{_key(tuning, files)[:16]}.json"
    done = [_found(each) for each in json.loads(record.read_text())] if record.is_file() else []
    searches = [(period, seed) for period in tuning.periods for seed in tuning.seeds]
    for i, (period, seed) in enumerate(searches):
        if any((one.period, one.seed) == (period, seed) for one in done):
            continue
        one = search(tuning, period, seed, fly, judge, _part(progress, i, len(searches)))
        done.append(one)
        announce(
            f"period {period:g} s, seed {seed}: cost {one.cost:.5g}, on other starts {one.judged_cost:.5g}, "
            f"{one.flown} of {one.judged} fly"
        )
        folder.mkdir(parents=True, exist_ok=True)
        record.write_text(json.dumps([dataclasses.asdict(each) for each in done], indent=2))
    out.mkdir(parents=True, exist_ok=True)
    return [_write(tuning, best, done, out, command) for best in best_by_period(done)]


def _part(progress: Callable[[float], None], index: int, count: int) -> Callable[[float], None]:
    """The progress of one of several searches."""
    return lambda share: progress((index + share) / count)


def _write(tuning: Tuning, best: Found, done: list[Found], out: Path, command: str) -> Path:
    path = out / f"{tuning.name}_{1000.0 * best.period:g}ms.toml"
    path.write_text(gains_text(tuning, best, done, command))
    return path


def _key(tuning: Tuning, files: Files) -> str:
    """Of all that a search depends on."""
    content = [repr(tuning), sorted(files.hashes.items()), sorted(versions().items())]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def _found(kept: dict[str, Any]) -> Found:
    low, high = kept.pop("share")
    return Found(**kept, share=(low, high))
