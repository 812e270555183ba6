"""The design of a comparison, and its study: every controller on every vehicle from the same initial conditions."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from orchestration.components.building import fmus
from orchestration.experiments.studies.axes import Axis, Key, LinkedSettings, Value
from orchestration.experiments.studies.study import StartValues, Study, placed
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import record
from orchestration.simulation.results.quantities import is_in_seconds
from orchestration.systems.system.component import Values
from orchestration.systems.system.paths import value_at
from orchestration.systems.system.request import ControlLoop
from orchestration.systems.system.requirements import is_number
from orchestration.systems.system.starts import InitialConditions, Starts
from orchestration.systems.system.vehicle import Vehicle

VEHICLE, CONDITION, CONTROLLER, START = "vehicle", "condition", "controller", "start"
FMU = "controller.fmu"


@record()
class Controller:
    """A controller that is compared: an FMU with parameters."""

    name: str
    sets: Values = field(default_factory=dict)
    tuned: Mapping[Key, Values] = field(default_factory=dict)
    """further values by vehicle and value of the axis"""
    bandwidth: float | None = None
    """Bandwidth of its attitude loop [rad/s]; None: that of the FMU about hover"""


@record()
class VehicleEntry:
    """A vehicle on which controllers are compared."""

    name: str
    vehicle: Vehicle | None = None
    """its parameters; None: the plant of the base"""


@record()
class Condition:
    """A deviation from the controllers' model, or a fault: mass, lag, wind, losses."""

    name: str
    """Its name in tables and pictures."""
    sets: Values = field(default_factory=dict)
    """Values by path."""
    multiplies: Mapping[str, float] = field(default_factory=dict)
    """Factors by path, applied to the value after all other settings."""


@record()
class OnSecondAxis:
    """A condition of a file at one value of a second axis."""

    condition: str
    """The name of the condition in the file."""
    value: Value
    """The value of the second axis."""


@record("front.")
class Front:
    """Two objectives with a trade-off, both to be minimised."""

    error: str = "position_rmse"
    """The objective that measures the error of a run."""
    effort: str = "total_variation.torque"
    """The objective that measures its effort."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A controller on a vehicle under a condition, by their names."""

    vehicle: str
    condition: str
    controller: str


@dataclass(frozen=True, kw_only=True)
class Cell(Case):
    """One controller on one vehicle under one condition at one value of the axis: a run from each initial condition."""

    index: int
    value: Value
    values: Mapping[str, Value]
    """values by axis"""


@record()
class Comparison:
    """Controllers on vehicles under conditions over an axis, from the same initial conditions; raises `UsageError`."""

    name: str
    """The name of the comparison, and of the folder of its store in `results`."""
    base: ControlLoop
    """The scenario that all runs modify."""
    controllers: tuple[Controller, ...]
    """The controllers that are compared."""
    vehicles: tuple[VehicleEntry, ...]
    """The vehicles on which they are compared."""
    conditions: tuple[Condition, ...]
    """Deviations from the controllers' model, and faults."""
    axis: Axis
    """The quantity that is varied, with increasing values."""
    starts: Starts
    """The initial conditions, the same for every controller."""
    front: Front = field(default_factory=Front)
    """The two objectives of the trade-off."""
    second: Axis | None = None
    """A second axis, whose values are among the conditions, as by `over_second_axis`."""
    on_second: Mapping[str, OnSecondAxis] = field(default_factory=dict)
    """The value of the second axis by the name of a condition."""
    native: bool = False
    """Whether it is run with the native twins of its FMUs."""
    folder: Path | None = None
    """The folder at which paths of files in settings start; None: the current one."""

    def __post_init__(self) -> None:
        for kind in ("controllers", "vehicles", "conditions"):
            names = [one.name for one in getattr(self, kind)]
            if not names or len(set(names)) != len(names):
                raise UsageError(
                    f"{kind} = {', '.join(names) or 'none'}: expected at least one, each with its own name"
                )
        if self.axis.values is None or any(isinstance(v, str) for v in self.axis.values):
            raise UsageError(f"axis {self.axis.name}: expected values, or start, stop and number")
        if sorted(self.axis.values) != [*self.axis.values]:
            raise UsageError(
                f"axis {self.axis.name}: expected increasing values; limits are values up to which runs survive"
            )
        for axis in filter(None, (self.axis, self.second)):
            if axis.name in (VEHICLE, CONDITION, CONTROLLER, START):
                raise UsageError(f"axis {axis.name}: expected another name")
        objectives = self.study.origin.objectives
        for key in ("error", "effort"):
            if getattr(self.front, key) not in objectives:
                raise UsageError(f"front.{key} = {getattr(self.front, key)}: expected one of {', '.join(objectives)}")

    @property
    def values(self) -> tuple[Value, ...]:
        """The values of the axis."""
        return self.axis.values or ()

    @property
    def is_in_seconds(self) -> bool:
        """Whether the axis sets times [s]."""
        axis = self.axis
        return not axis.multiplies and bool(axis.targets) and all(map(is_in_seconds, axis.targets))

    @cached_property
    def initial_conditions(self) -> tuple[InitialConditions, ...]:
        """The initial conditions, about the start of the base's reference."""
        return tuple(self.base.initial_conditions(self.starts))

    @property
    def start_settings(self) -> list[dict[str, Value]]:
        """The values that the runs from each initial condition begin with, by path, with their seed."""
        first = self.base.seed + self.starts.first
        return [{**start.values, "seed": first + i} for i, start in enumerate(self.initial_conditions)]

    @cached_property
    def study(self) -> Study:
        """The study of all runs, cell by cell. Each initial condition has its own seed, the same in every cell."""
        on_vehicles: dict[Key, Values] = {
            (v.name, one.name): self.parameters_for(v, one) for v in self.vehicles for one in self.controllers
        }
        tuned: dict[Key, Values] = {
            (one.name, *key): changes for one in self.controllers for key, changes in one.tuned.items()
        }
        return Study(
            name=self.name,
            base=self.base,
            native=self.native,
            folder=self.folder,
            axes=(
                _named(VEHICLE, self.vehicles),
                _named(CONDITION, self.conditions),
                _named(CONTROLLER, self.controllers),
                self.axis,
                Axis(name=START, targets=(), values=tuple(range(len(self.initial_conditions)))),
            ),
            together=(
                LinkedSettings(axes=(VEHICLE, CONTROLLER), sets=on_vehicles),
                LinkedSettings(axes=(CONTROLLER,), sets={(one.name,): one.sets for one in self.controllers}),
                LinkedSettings(axes=(CONTROLLER, VEHICLE, self.axis.name), sets=tuned),
                LinkedSettings(
                    axes=(CONDITION,),
                    sets={(one.name,): one.sets for one in self.conditions},
                    multiplies={(one.name,): one.multiplies for one in self.conditions},
                ),
                LinkedSettings(
                    axes=(START,),
                    sets={(i,): settings for i, settings in enumerate(self.start_settings)},
                ),
            ),
        )

    def fmu_of(self, controller: Controller) -> str:
        """The FMU of a controller, by name or path."""
        fmu = self.base.as_system().fmus["controller"]
        if FMU in controller.sets:
            fmu = str(placed("components.controller.fmu", controller.sets[FMU], self.folder))
        return fmus.native_twin(fmu) if self.native else fmu

    def parameters_for(self, entry: VehicleEntry, controller: Controller) -> dict[str, Value]:
        """The parameters of the plant of a vehicle and of a controller on it, by target."""
        return {} if entry.vehicle is None else dict(entry.vehicle.parameters_for(self.fmu_of(controller)))

    def values_of(self, condition: str, value: Value) -> dict[str, Value]:
        """The values by axis at a condition and a value of the first axis."""
        second = {} if self.second is None else {self.second.name: self.on_second[condition].value}
        return {self.axis.name: value, **second}

    def cells(self) -> Iterator[Cell]:
        """All cells in the order of their indices."""
        grid = (
            (vehicle, condition, controller, value)
            for vehicle in self.vehicles
            for condition in self.conditions
            for controller in self.controllers
            for value in self.values
        )
        for index, (vehicle, condition, controller, value) in enumerate(grid):
            yield Cell(
                index=index,
                vehicle=vehicle.name,
                condition=condition.name,
                controller=controller.name,
                value=value,
                values=self.values_of(condition.name, value),
            )

    def cell(self, index: int) -> Cell:
        """The cell of an index; raises `UsageError` if there is none."""
        cells = [*self.cells()]
        if not 0 <= index < len(cells):
            raise UsageError(f"--cell {index}: expected a number from 0 to {len(cells) - 1}")
        return cells[index]

    def runs_of(self, cell: Cell) -> range:
        """The indices in the study of the runs of a cell."""
        return range(cell.index * len(self.initial_conditions), (cell.index + 1) * len(self.initial_conditions))

    def request(self, index: int, starts: StartValues) -> ControlLoop:
        """A single run of the study as a request of the kind of the base."""
        system = self.study.system(index, starts)
        targets = [*self.axis.targets, *(target for each in self.study.together for target in each.targets)]
        values = {target: value_at(system, path) for target in targets for path in self.base.paths_of(target)[:1]}
        fmus = {f"{name}.fmu": fmu for name, fmu in system.fmus.items()}
        return self.base.with_values({**{target: v for target, v in values.items() if v is not None}, **fmus})


def over_second_axis(
    conditions: Sequence[Condition], axis: Axis
) -> tuple[tuple[Condition, ...], dict[str, OnSecondAxis]]:
    """Each condition at each value of a second axis, and what each of them stands for, by name.

    Raises `UsageError` for an axis without values.
    """
    if axis.values is None:
        raise UsageError(f"axis {axis.name}: expected values, or start, stop and number")
    expanded: list[Condition] = []
    stands_for: dict[str, OnSecondAxis] = {}
    for condition in conditions:
        for value in axis.values:
            here = f"{axis.name} {value:g}" if is_number(value) else f"{axis.name} {value}"
            name = here if len(conditions) == 1 else f"{condition.name}, {here}"
            changes: dict[str, Any] = dict.fromkeys(axis.targets, value)
            if axis.multiplies:
                factors = {target: factor * condition.multiplies.get(target, 1.0) for target, factor in changes.items()}
                one = Condition(name=name, sets=condition.sets, multiplies={**condition.multiplies, **factors})
            else:
                one = Condition(name=name, sets={**condition.sets, **changes}, multiplies=condition.multiplies)
            expanded.append(one)
            stands_for[name] = OnSecondAxis(condition=condition.name, value=value)
    return tuple(expanded), stands_for


def _named(name: str, ones: Sequence[Controller] | Sequence[VehicleEntry] | Sequence[Condition]) -> Axis:
    return Axis(name=name, targets=(), values=tuple(one.name for one in ones))
