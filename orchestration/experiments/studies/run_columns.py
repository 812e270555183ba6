"""The runs of a study by column: values, seeds and keys of many runs, and a system for each kind of run.

Runs are of one kind if they differ only in their seeds and in Real parameters of FMUs that single axes set. A system is
built for the first run of each kind, as `Study.system` builds it for any; the others have the same bits and keys.
"""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orchestration.experiments.studies.axes import Axis, Value
from orchestration.experiments.studies.run_key import KeyText
from orchestration.experiments.studies.study import Study, names_fmu
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.simulation.workers.task import TaskBatch
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import parameter_name

TOGETHER = 4096
"""Runs whose columns are computed together: memory does not grow with the number of runs"""
MOST_KINDS = 4096
"""Kinds that are kept"""
_SEED = "seed"
Kind = tuple[str, ...]
"""The values, as JSON, of the axes that make a kind of run"""


class Block:
    """Some runs by column; what is not asked for is not computed."""

    def __init__(self, columns: "RunColumns", indices: Integers) -> None:
        self._columns, self.indices = columns, indices
        self._values = columns.study.points.columns(indices)

    @cached_property
    def settings(self) -> Sequence[str]:
        """The value of each axis, as JSON."""
        return [f"{{{', '.join(row)}}}" for row in zip(*(self._named(name) for name in self._values))]

    @cached_property
    def kinds(self) -> Mapping[Kind, Sequence[int]]:
        """The places of the runs of each kind."""
        fixed = [self._texts[name] for name in self._columns.fixed]
        if not fixed:
            return {(): range(len(self.indices))}
        kinds: dict[Kind, list[int]] = {}
        for place, kind in enumerate(zip(*fixed)):
            kinds.setdefault(kind, []).append(place)
        return kinds

    @cached_property
    def parameters(self) -> Mapping[str, Floats]:
        """Those that kinds leave open, as COMPONENT.NAME."""
        return {
            name: np.array(self._values[axis], dtype=np.float64) * (1.0 if factor is None else factor)
            for axis, path, factor in self._columns.open
            if (name := parameter_name(path)) is not None
        }

    @cached_property
    def seeds(self) -> Sequence[int] | None:
        """None: those of their kinds."""
        study = self._columns.study
        axes = [axis for axis, path, _ in self._columns.open if path == _SEED]
        if axes:
            return [int(seed) for seed in self._values[axes[0]]]
        if not study.vary_seed or self._columns.seed_is_fixed or _SEED in self._values:
            return None
        begin, rows = f"[{study.origin.seed}, {{", zip(*(self._named(name) for name in sorted(self._values)))
        contents = (f"{begin}{', '.join(row)}}}]".encode() for row in rows)  # as a study has them for single runs
        return [int.from_bytes(hashlib.sha256(content).digest()[:6], "big") for content in contents]

    @cached_property
    def _texts(self) -> Mapping[str, Sequence[str]]:
        return {name: [*map(_json, values)] for name, values in self._values.items()}

    def _named(self, name: str) -> Sequence[str]:
        begin = f"{json.dumps(name)}: "
        return [begin + text for text in self._texts[name]]


@dataclass(frozen=True, kw_only=True)
class _Made:
    """What the runs of a kind have in common."""

    system: System
    key: KeyText


class RunColumns:
    """The runs of a study by column."""

    def __init__(self, study: Study, files: Files) -> None:
        self.study, self.files = study, files
        self.starts = files.start_values_of(study.origin)
        factors = {axis.name: self._open(axis) for axis in study.axes}
        self.fixed = [name for name, paths in factors.items() if paths is None]
        """axes that make kinds"""
        self.open = [(axis, path, factor) for axis, paths in factors.items() for path, factor in (paths or {}).items()]
        """other axes, what they set, and the factors of those that multiply"""
        targets = (target for axis in study.axes if axis.name in self.fixed for target in axis.targets)
        self.seed_is_fixed = _SEED in study.paths_of(targets)
        self._kinds: dict[Kind, _Made] = {}

    def blocks(self) -> Iterator[Block]:
        """All runs."""
        count = len(self.study.points)
        for first in range(0, count, TOGETHER):
            yield self.block(np.arange(first, min(first + TOGETHER, count)))

    def block(self, indices: Integers) -> Block:
        """Some runs."""
        return Block(self, indices)

    def refused(self, block: Block) -> Booleans:
        """The runs of which an open parameter is one that its FMU does not allow."""
        refused = np.zeros(len(block.indices), dtype=np.bool_)
        models = self.files.models_of(self.study.origin) if block.parameters else {}
        for name, values in block.parameters.items():
            component, _, own = name.partition(".")
            variable = models[component].variables[own]
            refused |= ~np.isfinite(values)
            if variable.minimum is not None:
                refused |= values < variable.minimum
            if variable.maximum is not None:
                refused |= values > variable.maximum
        return refused

    def keys(self, block: Block) -> list[str]:
        """The keys of valid runs, as `run_key`."""
        keys = [""] * len(block.indices)
        for kind, places in block.kinds.items():
            made = self._made(kind, int(block.indices[places[0]]))
            values = {name: column[places].tolist() for name, column in block.parameters.items()}
            seeds = [made.system.seed] * len(places) if block.seeds is None else [block.seeds[i] for i in places]
            for place, key in zip(places, made.key.keys(seeds, values)):
                keys[place] = key
        return keys

    def batch(self, block: Block, keys: Sequence[str], limit: float | None) -> TaskBatch:
        """Valid runs as a task."""
        systems, of = [], [0] * len(block.indices)
        for number, (kind, places) in enumerate(block.kinds.items()):
            systems.append(self._made(kind, int(block.indices[places[0]])).system)
            for place in places:
                of[place] = number
        seeds = [systems[number].seed for number in of] if block.seeds is None else block.seeds
        return TaskBatch(
            index=block.indices.tolist(), key=keys, seed=seeds, systems=systems, places=of,
            parameters=block.parameters, limit=limit,
        )  # fmt: skip

    def _made(self, kind: Kind, index: int) -> _Made:
        """What is common to the runs of a kind, one of which is at `index`."""
        if kind not in self._kinds:
            if len(self._kinds) == MOST_KINDS:
                self._kinds.clear()
            system = self.study.system(index, self.files.start_values)
            names = [name for _, path, _ in self.open if (name := parameter_name(path)) is not None]
            self._kinds[kind] = _Made(system=system, key=KeyText(system, self.files, self.study.metrics, names))
        return self._kinds[kind]

    # -- which axes leave values open ------------------------------------------------------------------------------

    def _open(self, axis: Axis) -> Mapping[str, float | None] | None:
        """The paths that an axis sets in runs of one kind, with factors if it multiplies; None: it makes kinds."""
        study = self.study
        others = [target for other in study.axes if other is not axis for target in other.targets]
        linked = [target for each in study.together for target in each.targets]
        taken, own = {*study.paths_of([*others, *linked])}, [*study.paths_of(axis.targets)]
        if any(axis.name in each.axes for each in study.together) or taken & {*own} or len({*own}) < len(own):
            return None
        if own and any(names_fmu(path) for path in (*taken, *own)):
            return None
        factors: dict[str, float | None] = {}
        for path in own:
            kind: type = int if path == _SEED and not axis.multiplies else float
            is_open = path == _SEED or parameter_name(path) in self.starts
            if not is_open or any(type(value) is not kind for value in axis.values or (kind(),)):
                return None
            try:
                factors[path] = study.product(1.0, path, {}, self.files.start_values) if axis.multiplies else None
            except UsageError:  # every run is invalid
                return None
        if any(path == _SEED for path in own) and not all(0 <= int(seed) < 2**63 for seed in axis.values or ()):
            return None
        return factors


def _json(value: Value) -> str:
    return repr(value) if type(value) is float and math.isfinite(value) else json.dumps(value)
