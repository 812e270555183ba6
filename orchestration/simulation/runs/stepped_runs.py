"""Many runs in SIMD lanes that are stepped together, with the caller's code in place of one component."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.records import replaced
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.simulation.engines.batch.batch import Group
from orchestration.simulation.engines.batch.batches import groups
from orchestration.simulation.engines.batch.kernels import preferred_lanes
from orchestration.simulation.engines.batch.shape import Shape, expect_lanes, outline
from orchestration.simulation.engines.batch.stepped_batch import SteppedBatch
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.runs.columns import Columns, columns
from orchestration.simulation.runs.replacement import names_of, replace_component
from orchestration.systems.schedule.schedule_cache import ScheduleCache, schedule_key
from orchestration.systems.system.check import connect_references
from orchestration.systems.system.files import located
from orchestration.systems.system.request import errors_in_own_terms


@dataclass(kw_only=True)
class _Lanes:
    """The runs of a batch that have not left it."""

    batch: SteppedBatch
    key: Any
    """Outline of their systems, by which batches are reused"""
    lanes: Integers
    """Indices of their lanes"""
    places: Integers
    """Place of the run in each of these"""
    over: bool = False
    """Whether all of its runs are"""


class SteppedRuns:
    """Runs by place, from 0 to `count` - 1, each of which is begun again when the caller asks for it.

    Each step computes the outputs of the replaced component in all of them; all else is as in `Simulation`. Objectives
    are not computed.
    """

    def __init__(
        self, request: RequestLike, component: str | None, count: int, *, initial: Any, in_process: bool
    ) -> None:
        """`component`, `initial` and `in_process` are those of `Simulation`.

        Raises `UsageError` as `Simulation`, and for FMUs that cannot run in lanes of this process, in a line.
        """
        self._request = request_of(request)
        with errors_in_own_terms(self._request):
            of_located = replace_component(located(self._request.as_system()), component, initial)
            self._replacement = found = replace(of_located, request=self._request)
            bare = replace(
                found.system, objectives={}, optional=(), criterion=replace(found.system.criterion, good=None)
            )
            foreign = [] if in_process else [name for name, model in found.models.items() if not model.is_own]
            if alone := [name for name in foreign if name != found.component]:
                raise UsageError(
                    f"components.{alone[0]}.fmu: not built here from quadcosim's own sources: expected in_process=True "
                    "to run it in lanes of this process, which it can end"
                )
            fits = check_against_fmus(connect_references(bare, found.models), found.models)
            self._system, self._parameters = fits.system, fits.parameters
            expect_lanes(self._system, found.models, found.component)
        self._models = found.models
        self.measured, self.commanded = found.measured, found.commanded
        self.names = names_of(self._system, self._models)
        """The names that have a value"""
        self.count = count
        self._lanes, self._schedules = preferred_lanes(), ScheduleCache()
        self._shapes: dict[Any, Shape] = {}
        self._free: dict[Any, list[SteppedBatch]] = {}
        self._groups: list[_Lanes] = []
        self._order: Integers = np.zeros(count, dtype=np.int64)
        """The lane of each run, counted over all groups"""
        self.measurement: Floats = np.zeros((count, len(self.measured)))
        """Measurement of each run; of one that is over, the true values then, neither late, lost nor noisy"""
        self.diverged: Booleans = np.zeros(count, dtype=np.bool_)
        self.over: Booleans = np.zeros(count, dtype=np.bool_)
        """Whether each run is over: diverged, or at its end"""

    def begin(self, places: Integers, seeds: Sequence[int], values: Mapping[str, Any]) -> None:
        """Begin runs at some places, ending those there; `seeds` and arrays of `values` have one for each.

        Raises `UsageError` for invalid values.
        """
        self._leave(places)
        with errors_in_own_terms(self._request):
            own = columns(self._request, self._system, self._models, {**values, "seed": seeds})
            _expect_one_each(own, len(seeds))
            several = {id(system): system for system in own.systems}
            known = {key: (outline(each), schedule_key(each)) for key, each in several.items()}
            connected = {key: connect_references(each, self._models) for key, each in several.items()}
            initial = self._initial(own)
        by_outline: dict[Any, list[int]] = {}
        for i, system in enumerate(own.systems):
            by_outline.setdefault(known[id(system)][0], []).append(i)
        for key, some in by_outline.items():
            timings = {i: known[id(own.systems[i])][1].with_seed(seeds[i]) for i in some}
            for group in groups(some, timings, self._lanes):
                batch = self._batch(key, connected[id(own.systems[group[0]])])
                batch.begin(
                    Group(
                        systems=[replaced(connected[id(own.systems[i])], seed=seeds[i]) for i in group],
                        timings=[timings[i] for i in group],
                        parameters={name: column[group] for name, column in own.parameters.items()},
                    ),
                    initial[:, group],
                )
                begun = _Lanes(batch=batch, key=key, lanes=np.arange(len(group)), places=places[group])
                self._groups.append(begun)
                self._collect(begun)
        for i, each in enumerate(self._groups):
            self._order[each.places] = i * self._lanes + each.lanes

    def step(self, commands: Floats) -> None:
        """Go on with a command for each run, shape (count, outputs), to the next measurement."""
        width = self._lanes
        by_lane = np.zeros((commands.shape[1], len(self._groups) * width))
        by_lane[:, self._order] = commands.T
        for i, group in enumerate(self._groups):
            if group.over:
                continue
            group.batch.command(by_lane[:, i * width : (i + 1) * width])
            group.batch.proceed()
            self._collect(group)

    def value(self, name: str) -> Floats:
        """The value of a column, of a source, or of `time` [s] in each run now.

        Raises `UsageError`, naming those that there are, for no such name.
        """
        return np.concatenate([group.batch.value(name) for group in self._groups])[self._order]

    def _initial(self, own: Columns) -> Floats:
        """What the replaced component commands before its first step, shape (outputs, runs)."""
        initial, parameters = np.zeros((len(self.commanded), own.count)), {**self._parameters, **own.parameters}
        systems = np.array([id(system) for system in own.systems])
        for system in {id(system): system for system in own.systems}.values():
            runs = systems == id(system)
            for values, value in zip(initial, self._replacement.initial_command(system, parameters)):
                values[runs] = np.broadcast_to(value, own.count)[runs]
        return initial

    def _collect(self, group: _Lanes) -> None:
        batch, places, lanes = group.batch, group.places, group.lanes
        if batch.all_wait:
            self.measurement[places] = batch.measurement[lanes]
            self.over[places] = False
            return
        waiting = batch.waiting
        values = np.where(waiting[:, None], batch.measurement, batch.measurement_at_end())
        self.measurement[places], self.over[places] = values[lanes], ~waiting[lanes]
        self.diverged[places] = batch.diverged(lanes, places)
        group.over = not waiting.any()

    def _leave(self, places: Integers) -> None:
        """Forget the runs at some places; a batch without any is free for others."""
        leaving = np.zeros(self.count, dtype=np.bool_)
        leaving[places] = True
        self.diverged[places] = False
        stay = []
        for group in self._groups:
            gone = leaving[group.places]
            if gone.all():
                self._free[group.key].append(group.batch)
                continue
            if gone.any():
                group.batch.leave(group.lanes[gone].tolist())
                group.lanes, group.places = group.lanes[~gone], group.places[~gone]
            stay.append(group)
        self._groups = stay

    def _batch(self, key: Any, system: Any) -> SteppedBatch:
        if key not in self._shapes:
            self._shapes[key] = Shape(
                system=system, models=self._models, lanes=self._lanes, replaced=self._replacement.component
            )
            self._free[key] = []
        if self._free[key]:
            return self._free[key].pop()
        return SteppedBatch(self._shapes[key], self._schedules, self.measured, self.commanded)


def _expect_one_each(own: Columns, count: int) -> None:
    """Raise `UsageError` for values of which there is neither one for all runs nor one for each."""
    for target, array in own.given.items():
        if array.shape not in ((), (1,), (count,)):
            value = array[0] if array.ndim > 1 else array
            raise UsageError(f"{target} = {shown(repr(value))}: expected a number, true, false or a text")
