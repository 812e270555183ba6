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
from orchestration.experiments.studies.study import Study, names_fmu, product
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


@dataclass(frozen=True, kw_only=True)
class Block:
    """Some runs by column."""

    indices: Integers
    settings: Sequence[str]
    """the value of each axis, as JSON"""
    kinds: Mapping[Kind, Sequence[int]]
    """the places of the runs of each kind"""
    parameters: Mapping[str, Floats]
    """those that kinds leave open, as COMPONENT.NAME"""
    seeds: Sequence[int] | None
    """None: those of their kinds"""


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
        self._factors = {axis.name: self._open(axis) for axis in study.axes}
        self._fixed = [name for name, factors in self._factors.items() if factors is None]
        """axes that make kinds"""
        self._kinds: dict[Kind, _Made] = {}

    def blocks(self) -> Iterator[Block]:
        """All runs."""
        count = len(self.study.points)
        for first in range(0, count, TOGETHER):
            yield self.block(np.arange(first, min(first + TOGETHER, count)))

    def block(self, indices: Integers) -> Block:
        """Some runs."""
        columns = self.study.points.columns(indices)
        texts = {name: [*map(_json, values)] for name, values in columns.items()}
        kinds: dict[Kind, list[int]] = {}
        fixed = [texts[name] for name in self._fixed]
        for place, kind in enumerate(zip(*fixed) if fixed else [()] * len(indices)):
            kinds.setdefault(kind, []).append(place)
        parameters: dict[str, Floats] = {}
        seeds = self._own_seeds(texts) if self.study.vary_seed and _SEED not in columns else None
        for axis, factors in self._factors.items():
            for path, factor in (factors or {}).items():
                name, numbers = parameter_name(path), columns[axis]
                if name is None:
                    seeds = [int(seed) for seed in numbers]
                else:
                    parameters[name] = np.array(numbers, dtype=np.float64) * (1.0 if factor is None else factor)
        if _SEED in self._paths_of_fixed:
            seeds = None
        rows = zip(*([f"{json.dumps(name)}: {text}" for text in column] for name, column in texts.items()))
        settings = [f"{{{', '.join(row)}}}" for row in rows]
        return Block(indices=indices, settings=settings, kinds=kinds, parameters=parameters, seeds=seeds)

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
            system = self.study.system(index, self.starts)
            paths = (path for factors in self._factors.values() for path in factors or ())
            names = [name for path in paths if (name := parameter_name(path)) is not None]
            self._kinds[kind] = _Made(system=system, key=KeyText(system, self.files, self.study.metrics, names))
        return self._kinds[kind]

    # -- which axes leave values open ------------------------------------------------------------------------------

    @cached_property
    def _paths_of_fixed(self) -> set[str]:
        axes = [axis for axis in self.study.axes if self._factors[axis.name] is None]
        return {path for axis in axes for path in self.study.paths_of(axis.targets)}

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
            if not self._is_open(path) or any(type(value) is not kind for value in axis.values or (kind(),)):
                return None
            try:
                factors[path] = product(1.0, path, {}, study.origin, self.starts) if axis.multiplies else None
            except UsageError:  # every run is invalid
                return None
        if any(path == _SEED for path in own) and not all(0 <= int(seed) < 2**63 for seed in axis.values or ()):
            return None
        return factors

    def _is_open(self, path: str) -> bool:
        return path == _SEED or parameter_name(path) in self.starts

    def _own_seeds(self, texts: Mapping[str, Sequence[str]]) -> list[int]:
        """Seeds as a study has them for single runs."""
        columns = ([f"{json.dumps(name)}: {text}" for text in texts[name]] for name in sorted(texts))
        begin = f"[{self.study.origin.seed}, {{"
        contents = (f"{begin}{', '.join(row)}}}]" for row in zip(*columns))
        return [int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "big") for text in contents]


def _json(value: Value) -> str:
    return repr(value) if type(value) is float and math.isfinite(value) else json.dumps(value)
