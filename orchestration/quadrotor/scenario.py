"""What a run is, as one frozen value."""

import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator

from orchestration.basics.bisection import Range
from orchestration.basics.errors import UsageError, no_such_key, shown
from orchestration.basics.records import record
from orchestration.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD, USE_REFERENCE_INPUTS
from orchestration.quadrotor.initial_conditions import Starts, starts_in
from orchestration.quadrotor.nominal_model import axes_differ, mismatch
from orchestration.quadrotor.quantities import range_of
from orchestration.quadrotor.signals import DisturbanceChoice, ReferenceChoice
from orchestration.quadrotor.timing import Timing
from orchestration.quadrotor.translation import (
    BY_MEASUREMENT,
    TIMING,
    disturbed,
    in_words_of_a_scenario,
    paths_of,
    quadrotor,
    reference_source,
)
from orchestration.quadrotor.vehicle import Vehicle, load_vehicle
from orchestration.quadrotor.wiring import (
    DEFAULT_CONTROLLER,
    DEFAULT_PLANT,
    RIGID_BODY,
)
from orchestration.results.quantities import setting
from orchestration.system.component import Parameter
from orchestration.system.description import varying
from orchestration.system.distribution import Distribution
from orchestration.system.distribution_table import meant_in
from orchestration.system.model import System
from orchestration.system.paths import changed
from orchestration.system.requirements import is_finite
from orchestration.system.written import in_toml


@record()
class FmuChoice:
    """An FMU, by the name of one of this project's or a path, and the parameters to set."""

    fmu: str
    """The name of one of this project's FMUs, as `UnifiedController` or `native/QuadrotorPlant`, or the path of an .fmu
    file."""
    parameters: dict[str, Parameter] = field(default_factory=dict)
    """The parameters to set, by their names in the FMU and in the units that it declares."""


@record("record.")
class Record:
    """Variables to record beside what is exchanged; None: all outputs and locals."""

    plant: tuple[str, ...] | None = None
    """The variables of the plant to record; None: all outputs and locals."""
    controller: tuple[str, ...] | None = None
    """The variables of the controller to record; None: all outputs and locals."""


def _vehicle_meant(given: Any) -> Any:
    """A vehicle by its name, or the path of its file, as files have it."""
    return load_vehicle(os.fspath(given), Path()) if isinstance(given, (str, os.PathLike)) else given


@record()
class Scenario:
    """One run; the defaults are the paper's scenario (section V) at a 10 ms period.

    Raises `UsageError` for values that cannot be.
    """

    stop_time: float = 30.0
    """The end of the flight [s]."""
    seed: int = 0
    """The seed of all random numbers of the flight."""
    model_mismatch: bool = False
    """Whether it is meant if the controller's nominal mass or inertia is not the plant's; it only silences a
    warning."""
    vehicle: Annotated[Vehicle | None, BeforeValidator(_vehicle_meant)] = None
    """The vehicle whose parameters hold where `controller` and `plant` say nothing else, of `load_vehicle`; or its
    name, or the path of its own file."""
    controller: FmuChoice = field(default_factory=lambda: FmuChoice(fmu=DEFAULT_CONTROLLER))
    """The FMU of the controller and its parameters: in a file `fmu`, its name or path, and parameters by their names in
    the FMU."""
    plant: FmuChoice = field(default_factory=lambda: FmuChoice(fmu=DEFAULT_PLANT))
    """Likewise of the plant."""
    timing: Timing = field(default_factory=Timing)
    """The digital clock between them; in a file `loss` sets both losses, `preset` the rate and latency of a real
    stack."""
    reference: ReferenceChoice = field(default_factory=ReferenceChoice)
    """What is followed: in a file `name` of a motion or `file` of way-points, and its parameters; without it, the
    trajectory that the controller has built in."""
    disturbance: DisturbanceChoice = field(default_factory=DisturbanceChoice)
    """What pushes it beside the built-in wind: in a file `name` of gusts or `file`, `drag`, `interpolation`, and
    parameters of the gusts."""
    record: Record = field(default_factory=Record)
    """What is recorded beside what the two FMUs exchange."""

    def __post_init__(self) -> None:
        if not (is_finite(self.stop_time) and self.stop_time > 0.0):
            raise UsageError(f"stop_time = {shown(self.stop_time)}: expected a positive number of seconds")
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

        What is drawn may be the table that a file has, or its text.

        A dictionary for `plant`, `controller`, `reference` or `disturbance` has parameters: `plant={"mass": 1.2}`.

        Raises `UsageError` for a key that does not exist.
        """
        _expect_keys("", fields, Scenario)
        _expect_keys("timing.", timing or {}, Timing)
        tables = {side: fields.pop(side) for side in SIDES if isinstance(fields.get(side), Mapping)}
        of_tables = {f"{side}.{name}": value for side, table in tables.items() for name, value in table.items()}
        parameters = {**of_tables, **(parameters or {})}
        changed = dataclasses.replace(self, **fields)
        if timing:
            meant = meant_in(self.timing, "timing.", timing)
            changed = dataclasses.replace(changed, timing=dataclasses.replace(self.timing, **meant))
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
        """This scenario with its FMUs at these paths, so that none is looked for."""
        return dataclasses.replace(
            self,
            plant=dataclasses.replace(self.plant, fmu=str(plant)),
            controller=dataclasses.replace(self.controller, fmu=str(controller)),
        )

    def with_twins(self, twin: Callable[[str], str]) -> "Scenario":
        """The same with other FMUs, each what `twin` makes of it."""
        return self.with_fmus(plant=twin(self.plant.fmu), controller=twin(self.controller.fmu))

    def resolved(self) -> "Scenario":
        """The same flight with the parameters of its vehicle as its own."""
        if self.vehicle is None:
            return self
        of_vehicle = {"plant": self.vehicle.plant, "controller": self.vehicle.for_controller(self.controller.fmu)}
        sides: dict[str, Any] = {
            side: dataclasses.replace(choice, parameters={**of_vehicle[side], **choice.parameters})
            for side, choice in (("plant", self.plant), ("controller", self.controller))
        }
        return dataclasses.replace(self, vehicle=None, **sides)

    # What is asked of any request, and of those whose controllers are compared (`system/request.py`).

    kind: ClassVar[str] = "flight"
    title: ClassVar[str | None] = "QuadrotorLoop"
    description: ClassVar[str] = "Quadrotor and its controller in closed loop"

    def as_system(self) -> System:
        """The system that it means: the quadrotor with its values; raises `UsageError` in the words of the system."""
        this = self.resolved()
        sides = {"plant": this.plant, "controller": this.controller}
        changes: dict[str, Any] = {"stop_time": this.stop_time, "seed": this.seed}
        for key, paths in TIMING.items():
            changes |= {path: getattr(this.timing, key) for path in paths}
        for kind in BY_MEASUREMENT:
            changes |= {f"connections.measurement.{kind}.{name}": v for name, v in getattr(this.timing, kind).items()}
        for side, choice in sides.items():
            changes[f"components.{side}.fmu"] = choice.fmu
            changes |= {f"components.{side}.parameters.{name}": value for name, value in choice.parameters.items()}
            changes[f"components.{side}.record"] = getattr(this.record, side)
        fed = reference_source(this.reference)
        changes |= {f"sources.reference.{key}": value for key, value in fed.items()}
        if not fed and this.controller.parameters.get(USE_REFERENCE_INPUTS) is True:
            raise UsageError(f"controller.{USE_REFERENCE_INPUTS}: expected [reference] name or file = … to feed them")
        return disturbed(changed(quadrotor(), changes), this.disturbance)

    def in_words(self, text: str) -> str:
        """`text` with the paths of its system as scenarios call them."""
        return in_words_of_a_scenario(text)

    def paths_of(self, target: str) -> tuple[str, ...]:
        """The paths of `timing.KEY`, `controller.NAME`, `plant.NAME` and so on; raises `UsageError` for no such."""
        return paths_of(target)

    def range_of(self, quantity: str) -> Range | None:
        """The range in which `period`, `delay`, `jitter` or `loss` is looked for; None for another name."""
        return range_of(self.timing, quantity)

    def near_continuous(self, period: float) -> "Scenario":
        """The same with a `period` [s] near continuous time, nothing late, lost or noisy, and nothing more recorded."""
        timing = Timing(period=period, plant_interval=self.timing.plant_interval)
        return dataclasses.replace(self, timing=timing, record=Record(plant=(), controller=()))

    def warnings(self, parameters: Mapping[str, float]) -> tuple[str, ...]:
        """What may not be meant: a nominal model or axes that are not the plant's, a run too short for its timing."""
        other_axes = axes_differ(parameters)
        found = [] if other_axes is None else [other_axes]
        if not self.model_mismatch:
            sides = [
                {name: parameters[f"{side}.{name}"] for name in RIGID_BODY if f"{side}.{name}" in parameters}
                for side in ("plant", "controller")
            ]
            different = mismatch(*sides)
            found += [] if different is None else [different]
        return (*found, *self.timing.warnings(self.stop_time))

    def headline(self) -> str:
        """The controller and its timing."""
        timing = self.timing
        parts = [self.controller.fmu]
        for key in ("period", "delay"):
            if value := getattr(timing, key):
                named = setting(f"timing.{key}", [value])
                said = varying(value) if isinstance(value, Distribution) else named.said(value)
                parts.append(f"{named.name} {said}")
        if timing.order != "gauss-seidel":
            parts.append("Jacobi")
        return ", ".join(parts)

    def with_values(self, values: Mapping[str, Any]) -> "Scenario":
        """The same with values by target, as axes of studies name them; raises `UsageError` for no such target."""
        timing: dict[str, Any] = {}
        parameters: dict[str, Any] = {}
        fields: dict[str, Any] = {}
        fmus = {"plant": self.plant.fmu, "controller": self.controller.fmu}
        for target, value in values.items():
            table, _, key = target.partition(".")
            if table == "timing":
                kind, _, name = key.partition(".")
                alike = ("measurement_loss", "command_loss") if key == "loss" else (kind,)
                given = {**getattr(self.timing, kind), **timing.get(kind, {}), name: value} if name else value
                timing |= dict.fromkeys(alike, given)
            elif table in fmus and key == "fmu":
                fmus[table] = value
            elif key:
                parameters[target] = value
            else:
                fields[target] = value
        return self.with_changes(timing=timing, parameters=parameters, **fields).with_fmus(**fmus)

    def without_vehicle(self) -> "Scenario":
        """The same without a vehicle, where what it flies is said elsewhere."""
        return dataclasses.replace(self, vehicle=None)

    def craft(
        self, given: str | None, folder: Path, *, plant: Mapping[str, Parameter], controller: Mapping[str, Parameter]
    ) -> Vehicle:
        """A vehicle by name, or by a path that starts at `folder`, with these parameters on top; None: those alone."""
        found = Vehicle(name="base") if given is None else load_vehicle(given, folder)
        return found.with_parameters(plant=plant, controller=controller)

    def ensemble(self, table: Mapping[str, Any], beside: Sequence[str] = ()) -> Starts:
        """The starts that a table of a file says, which may have keys `beside`; raises `UsageError`."""
        return starts_in(table, beside)

    def to_toml(self) -> str:
        """The scenario file that loads as this scenario, with the parameters of its vehicle written out."""
        import tomli_w

        resolved = self.resolved()
        said = ((f.name, in_toml(getattr(self.timing, f.name))) for f in dataclasses.fields(self.timing))
        timing = {key: value for key, value in said if value is not None and value != {}}
        tables: dict[str, Any] = {
            "stop_time": self.stop_time,
            "seed": self.seed,
            **({"model_mismatch": True} if self.model_mismatch else {}),
            "controller": _table(resolved.controller),
            "plant": _table(resolved.plant),
            "timing": timing,
        }
        for name in ("reference", "disturbance"):
            tables |= {name: table} if (table := signal_table(getattr(self, name))) else {}
        record = {key: list(value) for key, value in dataclasses.asdict(self.record).items() if value is not None}
        if record:
            tables["record"] = record
        return tomli_w.dumps(tables)


SIDES = ("controller", "plant", "reference", "disturbance")
"""Tables of a scenario that have parameters"""
OWN_KEYS = {
    "reference": ("name",),
    "disturbance": ("name", "interpolation", "drag"),
}
"""What is no parameter in them"""


def signal_table(choice: ReferenceChoice | DisturbanceChoice) -> dict[str, Any]:
    """A choice as a table of a scenario file that may lie in any folder; empty if it says nothing."""
    table = {
        f.name: getattr(choice, f.name)
        for f in dataclasses.fields(choice)
        if f.name not in ("file", "parameters") and getattr(choice, f.name) != f.default
    }
    return {**table, **({} if choice.file is None else {"file": str(choice.file.absolute())}), **choice.parameters}


def _expect_keys(prefix: str, given: Mapping[str, Any], table: type) -> None:
    known = [f.name for f in dataclasses.fields(table)]
    for key in given:
        if key not in known:
            raise UsageError(no_such_key(prefix, key, known))


def _table(choice: FmuChoice) -> dict[str, Any]:
    """A choice as a table of a scenario file that may lie in any folder."""
    fmu = str(Path(choice.fmu).absolute()) if choice.fmu.endswith(".fmu") else choice.fmu
    return {"fmu": fmu, **choice.parameters}
