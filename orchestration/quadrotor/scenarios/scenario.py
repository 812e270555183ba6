"""A flight of the quadrotor as one frozen value."""

import dataclasses
import os
from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, ClassVar

from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD, USE_REFERENCE_INPUTS
from orchestration.foundation.basics.bisection import Range
from orchestration.foundation.basics.errors import UsageError, no_such_key, shown
from orchestration.foundation.basics.fitting import Before
from orchestration.foundation.basics.records import record
from orchestration.quadrotor.scenarios import translation, wiring
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice, Record
from orchestration.quadrotor.scenarios.initial_conditions import initial_conditions
from orchestration.quadrotor.scenarios.nominal_model import axis_mismatch, model_mismatch
from orchestration.quadrotor.scenarios.scenario_text import text_of
from orchestration.quadrotor.scenarios.timing import LOSSES, Timing, loss_as_written, range_of
from orchestration.quadrotor.scenarios.vehicle import load_vehicle
from orchestration.simulation.results.objectives import with_own_objectives
from orchestration.simulation.results.quantities import setting
from orchestration.systems.system.component import Parameter
from orchestration.systems.system.description import describe_varying
from orchestration.systems.system.distribution import Distribution, parsed_fields
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.requirements import require_positive
from orchestration.systems.system.starts import InitialConditions, Starts
from orchestration.systems.system.vehicle import Vehicle


def _loaded_vehicle(value: Any) -> Any:
    """The vehicle of a name or of the path of a vehicle file; any other value as it is."""
    return load_vehicle(os.fspath(value), Path()) if isinstance(value, (str, os.PathLike)) else value


@record()
class Scenario:
    """One run; the defaults are the paper's scenario (section V) at a 10 ms period.

    Raises `UsageError` for invalid values.
    """

    stop_time: float = 30.0
    """The end of the flight [s]."""
    seed: int = 0
    """The seed of all random numbers of the flight."""
    model_mismatch: bool = False
    """Whether it is intended if the controller's nominal mass or inertia is not the plant's; it only silences a
    warning."""
    vehicle: Annotated[Vehicle | None, Before(_loaded_vehicle)] = None
    """The vehicle, of `load_vehicle`, by name or by the path of its file; its parameters hold unless `controller` or
    `plant` sets them."""
    controller: FmuChoice = field(default_factory=lambda: FmuChoice(fmu=wiring.DEFAULT_CONTROLLER))
    """The FMU of the controller and its parameters: in a file `fmu`, its name or path, and parameters by their names in
    the FMU."""
    plant: FmuChoice = field(default_factory=lambda: FmuChoice(fmu=wiring.DEFAULT_PLANT))
    """Likewise of the plant."""
    timing: Timing = field(default_factory=Timing)
    """The digital clock between them; in a file `loss` sets both losses, `preset` the rate and latency of a real
    flight stack."""
    reference: translation.ReferenceChoice = field(default_factory=translation.ReferenceChoice)
    """The reference: in a file `name` of a motion or `file` of way-points, and its parameters; default: the trajectory
    built into the controller."""
    disturbance: translation.DisturbanceChoice = field(default_factory=translation.DisturbanceChoice)
    """Forces beside the built-in wind: in a file `name` of gusts or `file`, `drag`, `interpolation`, and parameters of
    the gusts."""
    record: Record = field(default_factory=Record)
    """The variables to record beside those that the two FMUs exchange."""
    objectives: Mapping[str, str] = field(default_factory=dict)
    """Metrics of your own beside those of every flight: expressions by name."""
    ELSEWHERE: ClassVar[Mapping[str, str]] = {
        "metrics": "metrics of your own are expressions under [objectives]",
        "controllers": '[controllers.NAME] is a table of a vehicle file, vehicle = "FILE.toml"; '
        "parameters of the one controller of this file stand under [controller]",
    }
    """Hints where the content of these keys belongs"""

    def __post_init__(self) -> None:
        require_positive(self, "stop_time")
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or not 0 <= self.seed < 2**63:
            raise UsageError(f"seed = {shown(self.seed)}: expected a whole number from 0 to 2^63 - 1")
        for name, flag in ((SAMPLE_PERIOD, "--period and --clock"), (SAMPLE_OFFSET, "--offset")):
            if name in self.controller.parameters:
                raise UsageError(
                    f"controller.{name}: expected {flag} instead; the master sets it, to 0 with clock master "
                    "(the master decides when to sample) and to the timing's value with clock fmu"
                )

    def with_changes(
        self,
        *,
        timing: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Parameter] | None = None,
        **fields: Any,
    ) -> "Scenario":
        """This scenario with other timing keys, parameters (`controller.NAME`, `plant.NAME` and so on) or fields.

        A random value may be given as the table that a file has, or its text. A dictionary for `plant`, `controller`,
        `reference` or `disturbance` has the keys of its table in a file: `controller={"fmu": "GeometricController"}`,
        `plant={"mass": 1.2}`.

        Raises `UsageError` for a key that does not exist.
        """
        _expect_keys("", fields, Scenario)
        _expect_keys("timing.", timing or {}, Timing)
        tables = {side: fields.pop(side) for side in SIDES if isinstance(fields.get(side), Mapping)}
        of_tables = {f"{side}.{name}": value for side, table in tables.items() for name, value in table.items()}
        parameters = {**of_tables, **(parameters or {})}
        changed = dataclasses.replace(self, **fields)
        if timing:
            values = parsed_fields(self.timing, "timing.", timing)
            changed = dataclasses.replace(changed, timing=dataclasses.replace(self.timing, **values))
        for name, value in parameters.items():
            side, _, parameter = name.partition(".")
            if side not in SIDES or not parameter:
                raise UsageError(
                    f"{name}: expected {', '.join(f'{each}.NAME' for each in SIDES[:-1])} or {SIDES[-1]}.NAME"
                )
            choice: Any = getattr(changed, side)
            if parameter in OWN_KEYS.get(side, ()):
                choice = dataclasses.replace(choice, **{parameter: value})
            else:
                choice = dataclasses.replace(choice, parameters={**choice.parameters, parameter: value})
            replaced: dict[str, Any] = {side: choice}
            changed = dataclasses.replace(changed, **replaced)
        return changed

    def with_fmus(self, *, plant: str | Path, controller: str | Path) -> "Scenario":
        """This scenario with its FMUs at these paths."""
        return dataclasses.replace(
            self,
            plant=dataclasses.replace(self.plant, fmu=str(plant)),
            controller=dataclasses.replace(self.controller, fmu=str(controller)),
        )

    def with_twins(self, twin: Callable[[str], str]) -> "Scenario":
        """The same with each FMU replaced by `twin` of it."""
        return self.with_fmus(plant=twin(self.plant.fmu), controller=twin(self.controller.fmu))

    def resolved(self) -> "Scenario":
        """The same flight without a vehicle, the parameters of the vehicle among its own."""
        if self.vehicle is None:
            return self
        of_vehicle = {"plant": self.vehicle.plant, "controller": self.vehicle.for_controller(self.controller.fmu)}
        sides: dict[str, Any] = {
            side: dataclasses.replace(choice, parameters={**of_vehicle[side], **choice.parameters})
            for side, choice in (("plant", self.plant), ("controller", self.controller))
        }
        return dataclasses.replace(self, vehicle=None, **sides)

    # The protocols Request and ControlLoop of `system/request.py`.

    kind: ClassVar[str] = "flight"
    title: ClassVar[str | None] = "QuadrotorLoop"
    description: ClassVar[str] = "Quadrotor and its controller in closed loop"

    def as_system(self) -> System:
        """The system: the quadrotor with the values of this scenario; raises `UsageError` with paths of the system."""
        this = self.resolved()
        sides = {"plant": this.plant, "controller": this.controller}
        changes: dict[str, Any] = {"stop_time": this.stop_time, "seed": this.seed}
        for key, paths in translation.TIMING.items():
            changes |= {path: getattr(this.timing, key) for path in paths}
        for kind in translation.BY_MEASUREMENT:
            changes |= {f"connections.measurement.{kind}.{name}": v for name, v in getattr(this.timing, kind).items()}
        for side, choice in sides.items():
            changes[f"components.{side}.fmu"] = choice.fmu
            changes |= {f"components.{side}.parameters.{name}": value for name, value in choice.parameters.items()}
            changes[f"components.{side}.record"] = getattr(this.record, side)
        reference = translation.reference_source(this.reference)
        changes |= {f"sources.reference.{key}": value for key, value in reference.items()}
        if not reference and this.controller.parameters.get(USE_REFERENCE_INPUTS) is True:
            raise UsageError(f"controller.{USE_REFERENCE_INPUTS}: expected [reference] name or file = … to feed them")
        system = translation.disturbed(changed(translation.quadrotor(), changes), this.disturbance)
        return with_own_objectives(system, this.objectives, "objectives")

    def in_own_terms(self, text: str) -> str:
        """`text` with the paths of the system replaced by the names of a scenario."""
        return translation.in_scenario_terms(text)

    def paths_of(self, target: str) -> tuple[str, ...]:
        """The paths of `timing.KEY`, `controller.NAME`, `plant.NAME` and so on; raises `UsageError` for others."""
        return translation.paths_of(target)

    def range_of(self, quantity: str) -> Range | None:
        """The search range of `period`, `delay`, `jitter` or `loss`; None for another name."""
        return range_of(self.timing, quantity)

    def near_continuous(self, period: float) -> "Scenario":
        """The same with a `period` [s] near continuous time, no delay, loss or noise, and no records or metrics."""
        timing = Timing(period=period, plant_interval=self.timing.plant_interval)
        return dataclasses.replace(self, timing=timing, record=Record(plant=(), controller=()), objectives={})

    def mismatches(self, parameters: Mapping[str, float]) -> tuple[str, ...]:
        """A nominal model or axes of the controller that are not the plant's."""
        of_axes = axis_mismatch(parameters)
        texts = [] if of_axes is None else [of_axes]
        if not self.model_mismatch:
            sides = [
                {name: parameters[f"{side}.{name}"] for name in wiring.RIGID_BODY if f"{side}.{name}" in parameters}
                for side in ("plant", "controller")
            ]
            of_model = model_mismatch(*sides)
            texts += [] if of_model is None else [of_model]
        return tuple(texts)

    def headline(self) -> str:
        """The controller and its timing."""
        timing = self.timing
        parts = [self.controller.fmu]
        for key in ("period", "delay"):
            if value := getattr(timing, key):
                named = setting(f"timing.{key}", [value])
                text = describe_varying(value) if isinstance(value, Distribution) else named.text_of(value)
                parts.append(f"{named.name} {text}")
        if timing.order != "gauss-seidel":
            parts.append("Jacobi")
        return ", ".join(parts)

    def with_values(self, values: Mapping[str, Any]) -> "Scenario":
        """The same with values by target, as axes of studies name them; raises `UsageError` for an unknown target."""
        timing: dict[str, Any] = {}
        parameters: dict[str, Any] = {}
        fields: dict[str, Any] = {}
        fmus = {"plant": self.plant.fmu, "controller": self.controller.fmu}
        for target, value in values.items():
            table, _, key = target.partition(".")
            if table == "timing":
                kind, _, name = key.partition(".")
                keys = LOSSES if key == "loss" else (kind,)
                new = {**getattr(self.timing, kind), **timing.get(kind, {}), name: value} if name else value
                timing |= dict.fromkeys(keys, new)
            elif table in fmus and key == "fmu":
                fmus[table] = value
            elif key:
                parameters[target] = value
            else:
                fields[target] = value
        with loss_as_written([name.removeprefix("timing.") for name in values]):
            return self.with_changes(timing=timing, parameters=parameters, **fields).with_fmus(**fmus)

    def without_vehicle(self) -> "Scenario":
        """The same without a vehicle, for a caller that sets the parameters itself."""
        return dataclasses.replace(self, vehicle=None)

    def vehicle_of(
        self, name: str | None, folder: Path, *, plant: Mapping[str, Parameter], controller: Mapping[str, Parameter]
    ) -> Vehicle:
        """A vehicle by name, or by a path relative to `folder`, with these parameters on top; None: those alone."""
        vehicle = Vehicle(name="base") if name is None else load_vehicle(name, folder)
        return vehicle.with_parameters(plant=plant, controller=controller)

    def initial_conditions(self, starts: Starts) -> tuple[InitialConditions, ...]:
        """The initial conditions about the start of its reference, in the order of their indices."""
        return initial_conditions(starts, self.as_system())

    def to_toml(self) -> str:
        """The scenario file that loads as this scenario, with the parameters of its vehicle written out."""
        return text_of(self)


SIDES = ("controller", "plant", "reference", "disturbance")
"""Tables of a scenario that have parameters"""
OWN_KEYS = {
    "controller": ("fmu",),
    "plant": ("fmu",),
    "reference": ("name",),
    "disturbance": ("name", "interpolation", "drag"),
}
"""Keys in them that are not parameters"""


def _expect_keys(prefix: str, given: Mapping[str, Any], table: type) -> None:
    known = [f.name for f in dataclasses.fields(table)]
    for key in given:
        if key not in known:
            raise UsageError(no_such_key(prefix, key, known))
