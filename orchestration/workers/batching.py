"""What of a sweep is flown in lanes: runs in chunks for the workers, and a sample of them by FMUs, to compare."""

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import islice
from typing import Any

from orchestration.basics.errors import QuadcosimError
from orchestration.engines.batch.kernels import preferred_lanes
from orchestration.engines.batch.shape import outline
from orchestration.schedule.schedule_cache import timing
from orchestration.workers.task import Chunk, RunTask

SAMPLE = 8
"""Runs that are flown by FMUs too"""
TOLERATED = 1e-9
"""relative difference of a metric"""
CHUNK, SORTED = 256, 4096
"""Runs of a chunk, at most, and runs that are put in order so that those of a chunk are alike"""
ON_GPU = 2**15
"""Runs of a chunk that are flown on a GPU, at most: it wants as many at once as it has threads"""


def chunks(tasks: Iterable[RunTask], total: int, workers: int, on_gpu: bool = False) -> Iterator[RunTask | Chunk]:
    """Tasks in chunks, of which each of so many workers gets a few; those whose signals are kept by themselves."""
    size = max(preferred_lanes(), min(CHUNK, total // (4 * workers) // preferred_lanes() * preferred_lanes()))
    size, order = (ON_GPU, ON_GPU) if on_gpu else (size, SORTED)
    waiting = iter(tasks)
    while some := list(islice(waiting, order)):
        yield from (task for task in some if task.keep_signals)
        places: dict[Any, int] = {}
        rest = [(task, (outline(task.system), timing(task.system))) for task in some if not task.keep_signals]
        for _, key in rest:
            places.setdefault(key, len(places))
        ordered = [task for task, _ in sorted(rest, key=lambda pair: places[pair[1]])]
        for first in range(0, len(ordered), size):
            yield Chunk(tasks=tuple(ordered[first : first + size]), on_gpu=on_gpu)


def sample(keys: Iterable[str]) -> set[str]:
    """Which of some runs are flown by FMUs too: chosen by their content alone."""
    return set(sorted(keys, key=lambda key: hashlib.sha256(f"sample {key}".encode()).digest())[:SAMPLE])


Pair = tuple[int, Mapping[str, Any], Mapping[str, Any]]
"""The index of a run, and its metrics flown in two ways, that in lanes first"""


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How a sample of runs that were flown in lanes compares with the same runs flown by FMUs."""

    runs: int
    difference: float
    """the largest one of any metric, relative"""
    metric: str | None
    index: int | None
    """where it is; None if there is none"""
    python: "Agreement | None" = None
    """the same of how they begin, by FMUs in Python, chaotic runs left aside; None: there are no such FMUs"""

    def __str__(self) -> str:
        text = f"{self.runs} runs flown by FMUs too: largest relative difference {self._largest}"
        if self.python is None:
            return text
        return f"{text}; the beginning of {self.python.runs} by FMUs in Python too: {self.python._largest}"

    @property
    def _largest(self) -> str:
        at = "" if self.metric is None else f" ({self.metric} of run {self.index})"
        return f"{self.difference:.1g}{at}"

    def as_text(self) -> str:
        """As a store keeps it."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> "Agreement":
        """As a store has kept it."""
        kept = json.loads(text)
        python = kept.pop("python", None)
        return cls(**kept, python=None if python is None else cls(**python))

    @classmethod
    def of(cls, pairs: Iterable[Pair]) -> "Agreement":
        """Of runs flown in two ways."""
        found = [
            (_difference(lanes.get(name), value), name, index)
            for index, lanes, alone in pairs
            for name, value in alone.items()
        ]
        largest, name, index = max(found, key=lambda each: each[0], default=(0.0, "", 0))
        runs = len({index for _, _, index in found})
        if largest == 0.0:
            return cls(runs=runs, difference=0.0, metric=None, index=None)
        return cls(runs=runs, difference=largest, metric=name, index=index)

    def expect(self, by: str = "its FMUs") -> None:
        """Raise `QuadcosimError` naming run and metric if they differ by more than is tolerated."""
        if self.difference > TOLERATED:
            raise QuadcosimError(
                f"run {self.index}: {self.metric} in lanes differs by {self.difference:.3g} "
                f"from that by {by}; expected at most {TOLERATED:g}"
            )
        if self.python is not None:
            self.python.expect("its FMUs in Python, at the beginning of the run")


def _difference(one: Any, other: Any) -> float:
    if one == other:
        return 0.0
    numbers = [value for value in (one, other) if isinstance(value, (int, float)) and not isinstance(value, bool)]
    if len(numbers) < 2:
        return math.inf
    return abs(one - other) / max(abs(one), abs(other))  # type: ignore[no-any-return]
