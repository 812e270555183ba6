"""What is compared, and the study that it is: every controller on every vehicle from the same starts."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from orchestration.basics.errors import UsageError
from orchestration.basics.records import record
from orchestration.building import fmus
from orchestration.studies.axes import Axis, Value
from orchestration.studies.linked_settings import Key, LinkedSettings
from orchestration.studies.study import Study
from orchestration.system.paths import value_at
from orchestration.system.request import ControlLoop, Ensemble, InitialConditions, Values
from orchestration.system.request import Craft as Vehicle

VEHICLE, CONDITION, CONTROLLER, START = "vehicle", "condition", "controller", "start"
FMU = "controller.fmu"


@record()
class Controller:
    """One that is compared: an FMU with parameters."""

    name: str
    sets: Values = field(default_factory=dict)
    tuned: Mapping[Key, Values] = field(default_factory=dict)
    """what it is set to beside, by vehicle and value of the axis"""
    bandwidth: float | None = None
    """of its attitude loop [rad/s]; None: that of the FMU about hover"""


@record()
class Craft:
    """A vehicle that they fly."""

    name: str
    vehicle: Vehicle | None = None
    """what it is; None: the plant of the base"""


@record()
class Condition:
    """What differs from what a controller believes, or goes wrong: mass, lag, wind, losses."""

    name: str
    """What tables and pictures call it."""
    sets: Values = field(default_factory=dict)
    """Values by path."""
    multiplies: Mapping[str, float] = field(default_factory=dict)
    """Factors by path, on the value that is there by then."""


@record("front.")
class Front:
    """What is weighed against each other, both the less the better."""

    error: str = "position_rmse"
    """The objective that says how well a run flew."""
    effort: str = "total_variation.torque"
    """The objective that says what it took."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One controller on one vehicle under one condition at one value of the axis: a run from each start."""

    index: int
    vehicle: str
    condition: str
    controller: str
    value: Value


@record()
class Comparison:
    """Controllers on vehicles under conditions over an axis, each from all starts; raises `UsageError`."""

    name: str
    """The name of the comparison, and of the folder of its store in `results`."""
    base: ControlLoop
    """The scenario that all flights begin from."""
    controllers: tuple[Controller, ...]
    """Who is compared."""
    vehicles: tuple[Craft, ...]
    """The vehicles that they fly."""
    conditions: tuple[Condition, ...]
    """What differs from what a controller believes, or goes wrong."""
    axis: Axis
    """What is varied, over growing values."""
    starts: Ensemble
    """The initial states, the same for all."""
    front: Front = field(default_factory=Front)
    """The two objectives that are weighed against each other."""
    native: bool = False
    """Whether it is flown by the native twins of its FMUs."""

    def __post_init__(self) -> None:
        for kind in ("controllers", "vehicles", "conditions"):
            names = [one.name for one in getattr(self, kind)]
            if not names or len(set(names)) != len(names):
                raise UsageError(f"{kind} = {', '.join(names)}: expected at least one, each with a name of its own")
        if self.axis.values is None or any(isinstance(v, str) for v in self.axis.values):
            raise UsageError(f"axis {self.axis.name}: expected values, or start, stop and number")
        if sorted(self.axis.values) != [*self.axis.values]:
            raise UsageError(f"axis {self.axis.name}: expected values that grow: what flies is told up to a value")
        if self.axis.name in (VEHICLE, CONDITION, CONTROLLER, START):
            raise UsageError(f"axis {self.axis.name}: expected another name")
        objectives = self.study.origin.objectives
        for key in ("error", "effort"):
            if getattr(self.front, key) not in objectives:
                raise UsageError(f"front.{key} = {getattr(self.front, key)}: expected one of {', '.join(objectives)}")

    @property
    def values(self) -> tuple[Value, ...]:
        """Of the axis."""
        return self.axis.values or ()

    @cached_property
    def drawn(self) -> tuple[InitialConditions, ...]:
        """The starts, around the beginning of the base's trajectory."""
        return tuple(self.starts.initial_conditions(self.base))

    @cached_property
    def study(self) -> Study:
        """Its runs, cell after cell; in a cell start after start. A start has a seed of its own, for all alike."""
        return Study(
            name=self.name,
            base=self.base,
            native=self.native,
            axes=(
                _named(VEHICLE, self.vehicles),
                _named(CONDITION, self.conditions),
                _named(CONTROLLER, self.controllers),
                self.axis,
                Axis(name=START, targets=(), values=tuple(range(len(self.drawn)))),
            ),
            together=(
                LinkedSettings(axes=(VEHICLE, CONTROLLER), sets=self._told()),
                LinkedSettings(axes=(CONTROLLER,), sets={(one.name,): one.sets for one in self.controllers}),
                LinkedSettings(axes=(CONTROLLER, VEHICLE, self.axis.name), sets=self._tuned()),
                LinkedSettings(
                    axes=(CONDITION,),
                    sets={(one.name,): one.sets for one in self.conditions},
                    multiplies={(one.name,): one.multiplies for one in self.conditions},
                ),
                LinkedSettings(axes=(START,), sets={(i,): self._begun(i, start) for i, start in enumerate(self.drawn)}),
            ),
        )

    def fmu_of(self, controller: Controller) -> str:
        """The FMU of a controller, by name or path."""
        fmu = str(controller.sets.get(FMU, self.base.as_system().fmus["controller"]))
        return fmus.native_twin(fmu) if self.native else fmu

    def told(self, craft: Craft, controller: Controller) -> dict[str, Value]:
        """What the plant is made of on a vehicle, and what this controller is told of it."""
        return {} if craft.vehicle is None else dict(craft.vehicle.parameters_for(self.fmu_of(controller)))

    def _told(self) -> dict[Key, Values]:
        return {(v.name, one.name): self.told(v, one) for v in self.vehicles for one in self.controllers}

    def _tuned(self) -> dict[Key, Values]:
        return {(one.name, *key): changes for one in self.controllers for key, changes in one.tuned.items()}

    def _begun(self, index: int, start: InitialConditions) -> dict[str, Value]:
        return {**start.values, "seed": self.base.seed + self.starts.first + index}

    def cells(self) -> Iterator[Cell]:
        """All, in the order of their indices."""
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
            )

    def cell(self, index: int) -> Cell:
        """One of them; raises `UsageError` for an index that there is not."""
        cells = [*self.cells()]
        if not 0 <= index < len(cells):
            raise UsageError(f"--cell {index}: expected a number from 0 to {len(cells) - 1}")
        return cells[index]

    def runs_of(self, cell: Cell) -> range:
        """The indices of its runs in the study."""
        return range(cell.index * len(self.drawn), (cell.index + 1) * len(self.drawn))

    def request(self, index: int, starts: Mapping[str, float]) -> ControlLoop:
        """A run of the study by itself, as the base is written; `starts` are the FMUs' own parameters."""
        system = self.study.system(index, starts)
        targets = [*self.axis.targets, *(target for each in self.study.together for target in each.targets)]
        values = {target: value_at(system, path) for target in targets for path in self.base.paths_of(target)[:1]}
        fmus = {f"{name}.fmu": fmu for name, fmu in system.fmus.items()}
        return self.base.with_values({**{target: v for target, v in values.items() if v is not None}, **fmus})


def _named(name: str, ones: Sequence[Controller] | Sequence[Craft] | Sequence[Condition]) -> Axis:
    return Axis(name=name, targets=(), values=tuple(one.name for one in ones))
