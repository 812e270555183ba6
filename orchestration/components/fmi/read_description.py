"""The model of an FMU: its description, in one form for FMI 1.0, 2.0 and 3.0."""

import functools
import itertools
import math
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, Literal
from xml.etree.ElementTree import Element

import fmpy
from fmpy.model_description import ModelDescription, ModelVariable, Unknown

from fmu_kit.archive import read_source_hash, read_wrapped
from fmu_kit.units import BASE
from orchestration.components.fmi import trust
from orchestration.components.fmi.access import INTERFACES, SCHEDULED, USUAL, Access, Interface
from orchestration.components.fmi.archive import (
    TOKENS,
    VERSIONS,
    UnreadableFmuError,
    expect_honest_size,
    read_archive,
    read_root,
)
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.foundation.basics.documents import readable
from orchestration.foundation.basics.errors import UsageError, did_you_mean, listed, no_utf8, shown
from orchestration.foundation.basics.unit_algebra import BaseUnits, Unit, named
from orchestration.foundation.processes.resource_limits import ELEMENTS

Kind = Literal["Real", "Integer", "Boolean", "Enumeration", "String", "Binary", "Clock"]
"""Types by their FMI 2.0 names; FMI 3.0's Float64 is a Real, its Int32 an Integer"""
NUMERIC: tuple[Kind, ...] = ("Real", "Integer", "Boolean", "Enumeration")
"""Types that can be connected and recorded: as numbers, a Boolean as 0 or 1"""

ENUMERATED = {
    "causality": (
        "parameter", "calculatedParameter", "input", "output", "local", "independent", "structuralParameter",
    ),
    "variability": ("constant", "fixed", "tunable", "discrete", "continuous"),
    "initial": ("exact", "approx", "calculated"),
}  # fmt: skip
"""Attributes of variables, and the values that FMI 2.0 and 3.0 have for them"""


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A scalar of an FMU; an element of an array has its indices in its name, as in `u[1]`."""

    name: str
    kind: Kind
    type: str
    """Type as in the description: Real, Float64, Int32 …"""
    causality: str
    variability: str
    initial: str | None
    """exact, approx or calculated, as declared or by the default of FMI"""
    unit: str | None
    description: str | None
    start: str | None
    reference: int
    element: int
    """place within the array, 0 for a scalar"""
    length: int
    """Number of elements of that array; 0 for a scalar"""
    minimum: float | None
    maximum: float | None
    nominal: float | None
    choices: Mapping[str, int]
    """items of an Enumeration, by name"""

    @property
    def whole(self) -> str:
        """The name of the array that it is an element of; its own name if it is none."""
        return self.name.rpartition("[")[0] if self.length else self.name

    @property
    def role(self) -> str:
        """Its causality in words with an article, with the variability of a local variable or a constant."""
        shown = f"{self.causality} variable" if self.causality == "local" else self.causality
        if self.causality == "local" or self.variability == "constant":
            shown = f"{self.variability} {shown}"
        return f"a{'n' if shown[0] in 'aeiou' else ''} {shown}"

    @property
    def is_settable(self) -> bool:
        """Whether it is a parameter or an input."""
        return self.causality in ("parameter", "input", "structuralParameter")

    @property
    def has_settable_start(self) -> bool:
        """Whether it is an output or local, as a state, whose start value can be set."""
        return not self.is_settable and self.variability != "constant" and self.initial in ("exact", "approx")

    @property
    def is_constant(self) -> bool:
        """Whether it is a parameter that was fixed when the FMU was built: it can be set to its own value only."""
        return self.variability == "constant" and self.causality == "local" and self.start is not None


def items_text(choices: Mapping[str, int]) -> str:
    """The items of an Enumeration with the numbers that files have of them."""
    return ", ".join(f"{number} = {item}" for item, number in choices.items())


@dataclass(frozen=True, kw_only=True)
class DeclaredClock:
    """A clock; an input clock that is periodic is one that the importer makes tick."""

    name: str
    reference: int
    variability: str
    """constant, fixed or tunable: the importer may set an interval that is not constant"""
    interval: Fraction | None
    """Time between ticks [s]; None: it is not stated"""
    shift: Fraction
    """Time of its first tick [s]"""
    priority: int


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Model:
    """An FMU file and its description; it is read once and compared by identity."""

    path: Path
    """Path of the FMU."""
    description: ModelDescription
    """Its model description, as fmpy reads it."""
    variables: Mapping[str, Variable]
    """Its variables by name, arrays by their elements: causality, unit, start value, description."""
    initial_dependencies: Mapping[str, frozenset[str] | None]
    """Inputs that an output depends on at initialisation, by output; None: all of them."""
    access: Access
    """Way in which it is called."""
    interface: Interface
    """The interface by which it is called."""

    def __repr__(self) -> str:
        counts = Counter(v.causality for v in self.variables.values())
        return f"<Model {self.name}, FMI {self.version}: {', '.join(f'{n} {what}' for what, n in counts.items())}>"

    @property
    def is_own(self) -> bool:
        """Whether it was built here from this project's sources, and may run in this process."""
        return trust.is_own(self.path)

    @cached_property
    def follows_kit(self) -> bool:
        """Whether it says that it is built on `fmu_kit`, whose conventions it follows then."""
        return read_source_hash(self.path) is not None

    @cached_property
    def believed_period(self) -> float | None:
        """The sampling period that a user's own code believes [s], or that of a partition; None for other FMUs."""
        wrapped = read_wrapped(self.path)
        if wrapped is not None and self.ticking:
            interval = self.ticking[0].interval
            return None if interval is None else float(interval)
        period = None if wrapped is None else wrapped.get("period")
        return period if isinstance(period, float) and period > 0.0 else None

    @property
    def waits(self) -> bool:
        """Whether the time of its first sample is set by a parameter, and it does not sample in steps before."""
        return bool(self.ticking) or (self.follows_kit and self.has_clock and SAMPLE_OFFSET in self.variables)

    @property
    def has_clock(self) -> bool:
        """Whether it has its own clock, which its parameters set."""
        parameters = [self.variables[name] for name in (SAMPLE_PERIOD, SAMPLE_OFFSET) if name in self.variables]
        return SAMPLE_PERIOD in self.variables and all(each.is_settable for each in parameters)

    @property
    def name(self) -> str:
        """The model's name."""
        return str(self.description.modelName)

    @property
    def version(self) -> int:
        """Of FMI: 1, 2 or 3."""
        return int(self.description.fmiMajorVersion)

    @cached_property
    def capabilities(self) -> Any:
        """What it declares of the interface by which it is called."""
        return declared_of(self.description)[self.interface]

    @property
    def handles_events(self) -> bool:
        """Whether it handles its events within its steps, although it could have the importer do so."""
        return self.interface == "co-simulation" and "event-mode" in declared_of(self.description)

    @property
    def varies_step(self) -> bool:
        """Whether it supports communication steps of any length."""
        return bool(getattr(self.capabilities, "canHandleVariableCommunicationStepSize", True))

    @cached_property
    def saves_state(self) -> bool:
        """Whether its state can be saved as bytes and restored."""
        return bool(self.capabilities.canGetAndSetFMUstate and self.capabilities.canSerializeFMUstate)

    @cached_property
    def has_slopes(self) -> bool:
        """Whether it offers directional derivatives as it is called."""
        declared = attributes_of(self, self.interface, read_root(read_archive(self.path, math.inf)))
        return declared.get(f"providesDirectionalDerivative{'s' if self.version == 3 else ''}") in ("true", "1")

    @property
    def once_per_process(self) -> bool:
        """Whether a process can have one instance only."""
        return bool(self.capabilities.canBeInstantiatedOnlyOncePerProcess)

    @property
    def tolerance(self) -> float | None:
        """The relative tolerance of the experiment that it declares; None if it declares none."""
        tolerance = _number(getattr(self.description.defaultExperiment, "tolerance", None))
        return tolerance if tolerance is not None and tolerance > 0.0 else None

    def variable(self, name: str, place: str) -> Variable:
        """A variable by name; raises `UsageError` naming the place and similar variables."""
        if name in self.variables:
            return self.variables[name]
        own = name.removeprefix("parameters.")
        if own in self.variables:
            raise UsageError(f"{place}: expected {place.removesuffix(name)}{own}, without a table of parameters")
        if count := sum(each.whole == name for each in self.variables.values()):
            raise UsageError(f"{place}: is an array; expected a list of its {count} values")
        hint = did_you_mean(name, self.variables, most=3) or ";"
        settable = [v.name for v in self.variables.values() if v.causality == "parameter"]
        raise UsageError(
            f"{place}: {self.name} has no such variable{hint} its parameters are {listed(settable, most=20)}"
        )

    def by_elements(self, values: Mapping[str, Any], place: str) -> dict[str, Any]:
        """Values by name, of each array those of its elements: of a list, or of a text with one beside the other.

        Raises `UsageError`, naming place and array, for another number of them, and for a text that has others.
        """
        found = dict[str, Any]()
        for name, value in values.items():
            elements = [each.name for each in self.variables.values() if each.whole == name != each.name]
            if not elements or not isinstance(value, (str, list)):
                found[name] = value
                continue
            cells = list(_cells(value))
            if len(cells) != len(elements):
                raise UsageError(f"{place}{name} = {value}: expected {len(elements)} numbers")
            try:
                found |= zip(elements, map(_number_in, cells))
            except ValueError:
                raise UsageError(f"{place}{name} = {value}: expected numbers") from None
        return found

    def base_units(self, unit: str | None) -> BaseUnits | None:
        """A unit in base units, by the FMU's definitions; None if they do not define it."""
        definition = next((u for u in self.description.unitDefinitions if u.name == unit), None)
        base = getattr(definition, "baseUnit", None)
        if base is None:
            return None
        exponents = tuple(Fraction(getattr(base, key)) for key in BASE)
        return BaseUnits(exponents=exponents, factor=float(base.factor), offset=float(base.offset))

    @cached_property
    def units(self) -> dict[str, Unit]:
        """The units of the variables that have one, by name."""
        declared = {name: v.unit for name, v in self.variables.items() if v.unit}
        parsed = {unit: named(unit, self.base_units(unit)) for unit in dict.fromkeys(declared.values())}
        return {name: parsed[unit] for name, unit in declared.items()}

    @cached_property
    def clocks(self) -> tuple[DeclaredClock, ...]:
        """Its periodic input clocks, by priority.

        Raises `UsageError` for a clock of another kind: its ticks would be instants of their own.
        """
        if not any(variable.kind == "Clock" for variable in self.variables.values()):
            return ()
        found = []
        for causality, clock in clocks_of(read_root(read_archive(self.path, math.inf))):
            if causality != "input" or clock.variability not in PERIODIC:
                raise UsageError(
                    f"{self.path}: {clock.name} is a clock of causality {causality} and interval {clock.variability}, "
                    "whose ticks would be instants of their own; expected periodic input clocks: constant, fixed or "
                    "tunable"
                )
            found.append(clock)
        return tuple(sorted(found, key=lambda clock: clock.priority))

    @cached_property
    def ticking(self) -> tuple[DeclaredClock, ...]:
        """The clocks that tick as it is called, that of every sample first; of a partition, its own."""
        if self.interface == SCHEDULED:
            return () if self.access.clock is None else (self._base_clock(),)
        if self.interface != "event-mode" or not self.clocks:
            return ()
        base = self._base_clock()
        return (base, *(clock for clock in self.clocks if clock is not base))

    def _base_clock(self) -> DeclaredClock:
        if self.access.clock is not None:
            return next(clock for clock in self.clocks if clock.name == self.access.clock)
        return min(self.clocks, key=lambda clock: clock.interval or math.inf)

    def expect_clocks_that_tick(self) -> None:
        """Raise `UsageError` for an FMU with clocks that do not tick as it is called."""
        clocks = [v.name for v in self.variables.values() if v.kind == "Clock"]
        samples_without = self.follows_kit or read_wrapped(self.path) is not None  # at every step
        if clocks and not self.ticking and not samples_without:
            if "event-mode" not in declared_of(self.description):
                raise UsageError(f"{self.path}: has clocks, but no event mode, in which they tick: {', '.join(clocks)}")
            raise UsageError(
                f"{self.path}: its clocks {', '.join(clocks)} do not tick: expected sampling = {{ fmu_clock = "
                f'"{clocks[0]}" }}'
            )

    @cached_property
    def for_solvers(self) -> frozenset[str]:
        """Derivatives of one of this project's FMUs, and states beside its outputs: only recorded where named."""
        derivatives = [one.variable for one in self.description.derivatives] if self.follows_kit else []
        return frozenset(v.name for rate in derivatives for v in (rate, rate.derivative) if v.causality == "local")

    def names(self, *causalities: str, kinds: tuple[Kind, ...] = NUMERIC) -> tuple[str, ...]:
        """Variables of these causalities and types, in the order of the description."""
        return tuple(v.name for v in self.variables.values() if v.causality in causalities and v.kind in kinds)

    def follows_at_once(self, output: str) -> frozenset[str] | None:
        """The inputs that an output follows before the next step; None: all of them, or unknown."""
        if self.interface in ("co-simulation", SCHEDULED):
            return frozenset()
        declared = self._output_dependencies.get(output)
        return self.depends_on(output) if declared is None else declared

    @cached_property
    def _output_dependencies(self) -> Mapping[str, frozenset[str] | None]:
        """Inputs that an output depends on in steps, by output; None: not declared."""
        return _dependencies(self.description.outputs, self.variables, None)

    def is_clocked(self, name: str) -> bool:
        """Whether a variable changes at ticks of the clocks only; before the first one it has its start value."""
        return bool(self.ticking) and self.variables[name].whole in self._clocked

    @cached_property
    def _clocked(self) -> frozenset[str]:
        return frozenset(v.name for v in self.description.modelVariables if v.clocks)

    def depends_on(self, output: str) -> frozenset[str] | None:
        """The inputs that an output depends on at initialisation; None: on all of them, or unknown."""
        return self.initial_dependencies.get(output)


def read_description(path: Path) -> ModelDescription:
    """The description of an FMU; raises `UsageError` for a file that is no FMU that can be called."""
    if not zipfile.is_zipfile(path):
        raise UsageError(f"{path}: expected an FMU, which is a zip file")
    try:
        expect_honest_size(path)
        description: ModelDescription = fmpy.read_model_description(str(path), validate=False)
    except UsageError:
        raise
    except UnicodeEncodeError as error:
        raise no_utf8(error) from error
    except Exception as error:  # fmpy passes on any exception of the readers of zip and XML
        _expect_version(path)
        what = "its ModelStructure has an index of no variable; quadcosim validate names it"
        what = what if isinstance(error, IndexError) else str(error)
        raise UsageError(f"{path}: expected an FMU with a valid modelDescription.xml: {what}") from error
    if description.fmiMajorVersion == 1:
        from orchestration.components.fmi.fmi1_description import completed  # not before: few FMUs are of FMI 1.0

        completed(description, read_root(read_archive(path, math.inf)), path)
    else:
        _expect_enumerated(description, path)
    offered = declared_of(description)
    if not offered:
        raise UsageError(f"{path}: offers no interface; expected co-simulation, model exchange or scheduled execution")
    token = TOKENS[description.fmiMajorVersion]
    identifiers = [("modelIdentifier", interface.modelIdentifier) for interface in offered.values()]
    for name, value in ((token, description.guid), *identifiers):
        if value is None:
            raise UsageError(f"{path}: its modelDescription.xml has no {name}")
    return description


def _expect_enumerated(description: ModelDescription, path: Path) -> None:
    """Raise `UsageError` for a value that FMI's enumerations do not have: the variable would be, say, no output."""
    for declared in description.modelVariables:
        for name, known in ENUMERATED.items():
            value = getattr(declared, name)
            if value is not None and value not in known:
                line = f"modelDescription.xml, line {declared.sourceline}"
                raise UsageError(
                    f"{path}: {line}: {declared.name}: {name} = {shown(value)}: expected one of {', '.join(known)}"
                )


def declared_of(description: ModelDescription) -> dict[Interface, Any]:
    """What an FMU declares of each interface that it offers, as fmpy reads it; the default one is the first."""
    slave, model = description.coSimulation, description.modelExchange
    found = {
        "co-simulation": slave,
        "event-mode": slave if slave is not None and slave.hasEventMode else None,
        "model-exchange": model,
        SCHEDULED: description.scheduledExecution,
    }
    return {name: found[name] for name in INTERFACES if found[name] is not None}


def _expect_version(path: Path) -> None:
    """Raise `UsageError` for an FMU that says to be of a version of FMI that is not supported."""
    with suppress(UnreadableFmuError):
        version = read_root(read_archive(path, math.inf)).get("fmiVersion")
        if version not in ("1.0", *VERSIONS):
            raise UsageError(f"{path}: fmiVersion = {version}: expected 1.0, 2.0 or 3.0")


def read_model(path: str | Path, access: Access = USUAL) -> Model:
    """Read the model of an FMU that is called in a way.

    It is read once in a process while the file stays the same. Raises `UsageError` for a file that is no FMU of FMI
    1.0, 2.0 or 3.0, or does not offer what is asked.
    """
    path = Path(path)
    with readable(path, "FMU"):
        about = path.stat()
    return called(_read_model(path, about.st_mtime_ns, about.st_size), access)


@functools.lru_cache(maxsize=64)
def called(model: Model, access: Access) -> Model:
    """The same model, called in a way; raises `UsageError` if it does not offer that."""
    if model.access == access:
        return model
    offered = declared_of(model.description)
    interface = access.interface or next(iter(offered))
    if interface not in offered:
        raise UsageError(f"interface = {interface}: {model.name} does not offer it; expected {' or '.join(offered)}")
    if access.clock is not None and access.clock not in [clock.name for clock in model.clocks]:
        clocks = ", ".join(clock.name for clock in model.clocks) or "no clocks"
        key = "partition" if interface == SCHEDULED else "sampling.fmu_clock"
        raise UsageError(f"{key} = {access.clock}: {model.name} has {clocks}; expected one of its clocks")
    if access.solver is not None and interface != "model-exchange":
        raise UsageError(f"solver = {access.solver}: expected none with {interface}: {model.name} has its own")
    if interface == SCHEDULED:
        return _partition(model, access)
    return replace(model, access=access, interface=interface)


def _partition(model: Model, access: Access) -> Model:
    """A partition: its clock, and the variables that belong to it or to no clock."""
    names = ", ".join(clock.name for clock in model.clocks)
    if access.clock is None:
        raise UsageError(f"interface = scheduled-execution: {model.name}: expected partition, one of {names}")
    own = next(clock.reference for clock in model.clocks if clock.name == access.clock)
    others = {
        each.name
        for each in model.description.modelVariables
        if each.clocks and own not in [clock.valueReference for clock in each.clocks]
    }
    variables = {name: v for name, v in model.variables.items() if v.whole not in others}
    return replace(model, access=access, interface=SCHEDULED, variables=variables)


@functools.lru_cache(maxsize=64)
def _read_model(path: Path, changed: int, size: int) -> Model:
    description = read_description(path)
    for declared in description.modelVariables:
        if not 0 <= declared.valueReference < 2**32:
            what = f"{declared.name}: valueReference = {declared.valueReference}"
            raise UsageError(f"{path}: {what}: expected a whole number of 32 bits without a sign")
    elements = sum(math.prod(declared.shape) for declared in description.modelVariables if declared.shape)
    if elements > ELEMENTS.value:
        raise UsageError(f"{path}: its arrays have {elements} elements: expected at most {ELEMENTS}")
    scalars = [scalar for declared in description.modelVariables for scalar in scalars_of(declared)]
    variables = {v.name: v for v in scalars}
    if len(variables) < len(scalars):
        name = Counter(v.name for v in scalars).most_common(1)[0][0]
        raise UsageError(f"{path}: its modelDescription.xml has more than one variable {name}")
    return Model(
        path=path,
        description=description,
        variables=variables,
        initial_dependencies=_dependencies(
            description.initialUnknowns, variables, frozenset() if description.initialUnknowns else None
        )
        | _of_partitions(description, variables),
        access=USUAL,
        interface=next(iter(declared_of(description))),
    )


def _cells(value: Any) -> Iterator[Any]:
    """The values of a text, or of a list that may have others."""
    if not isinstance(value, list):
        yield from value.split() if isinstance(value, str) else [value]
        return
    for each in value:
        yield from _cells(each) if isinstance(each, list) else [each]


def _number_in(cell: Any) -> Any:
    if not isinstance(cell, str):
        return cell
    return int(cell) if cell.lstrip("-").isdecimal() else float(cell)


def _of_partitions(description: ModelDescription, variables: Mapping[str, Variable]) -> dict[str, frozenset[str]]:
    """What the outputs of partitions depend on at initialisation: nothing, they have their start values."""
    clocked = {v.name for v in description.modelVariables if v.clocks} if description.scheduledExecution else ()
    return {v.name: frozenset() for v in variables.values() if v.causality == "output" and v.whole in clocked}


PERIODIC = ("constant", "fixed", "tunable")
"""Interval variabilities of periodic clocks"""


def clocks_of(root: Element) -> Iterator[tuple[str, DeclaredClock]]:
    """The clocks in a description, with their causality; fmpy does not read their intervals."""
    types = {each.get("name"): each.attrib for each in root.iterfind("TypeDefinitions/ClockType")}
    for element in root.iterfind("ModelVariables/Clock"):
        declared = {**types.get(element.get("declaredType"), {}), **element.attrib}
        yield declared.get("causality", "local"), _clock(declared)


def _clock(declared: Mapping[str, str]) -> DeclaredClock:
    if "resolution" in declared and "intervalCounter" in declared:
        unit = Fraction(1, int(declared["resolution"]))
        interval: Fraction | None = int(declared["intervalCounter"]) * unit
        shift = int(declared.get("shiftCounter", "0")) * unit
    else:
        interval = Fraction(declared["intervalDecimal"]) if "intervalDecimal" in declared else None
        shift = Fraction(declared.get("shiftDecimal", "0"))
    return DeclaredClock(
        name=declared["name"], reference=int(declared["valueReference"]),
        variability=declared.get("intervalVariability", ""), interval=interval, shift=shift,
        priority=int(declared.get("priority", "0")),
    )  # fmt: skip


_ELEMENTS = {"co-simulation": "CoSimulation", "event-mode": "CoSimulation", "model-exchange": "ModelExchange"}


def attributes_of(model: Model, interface: Interface, root: Element) -> Mapping[str, str]:
    """The attributes by which a description declares an interface; fmpy does not read all of FMI 3.0."""
    name = "Capabilities" if model.version == 1 else _ELEMENTS.get(interface, "ScheduledExecution")
    element = next(root.iter(name), None)
    return {} if element is None else element.attrib


_KINDS: dict[str, Kind] = {
    "Real": "Real", "Float64": "Real", "Float32": "Real", "Boolean": "Boolean", "Enumeration": "Enumeration",
    "String": "String", "Binary": "Binary", "Clock": "Clock", "Integer": "Integer",
}  # fmt: skip


def kind_of(declared: ModelVariable) -> Kind:
    """The type of a variable by its FMI 2.0 name."""
    return _KINDS.get(declared.type, "Integer")


def attribute(declared: ModelVariable, name: str) -> str | None:
    """The unit, min, max or nominal of a variable as it is written: its own, or that of its declared type."""
    own: str | None = getattr(declared, name)
    return getattr(declared.declaredType, name, None) if own is None else own


def starts_of(declared: ModelVariable) -> list[str]:
    """The start values of a variable as they are written: none, one, or one for each element of an array.

    Those of an array of texts are unknown: fmpy reads the first only.
    """
    if declared.start is None:
        return []
    if kind_of(declared) in ("String", "Binary"):
        return [] if declared.shape else [declared.start]
    return declared.start.split() or [""]


def scalars_of(declared: ModelVariable) -> list[Variable]:
    """The elements of a variable: itself, or every `name[i,j]`, counted from 1, the last index varying fastest."""
    shape = tuple(declared.shape or ())
    starts = starts_of(declared)
    variables = []
    for element, index in enumerate(itertools.product(*(range(1, n + 1) for n in shape))):
        start = starts[element] if element < len(starts) else (starts[-1] if starts else None)
        variables.append(
            Variable(
                name=declared.name + (f"[{','.join(map(str, index))}]" if shape else ""),
                kind=kind_of(declared),
                type=declared.type,
                causality=declared.causality or "local",
                variability=declared.variability or "continuous",
                initial=declared.initial,
                unit=attribute(declared, "unit"),
                description=declared.description,
                start=start,
                reference=declared.valueReference,
                element=element,
                length=math.prod(shape) if shape else 0,
                minimum=_number(attribute(declared, "min")),
                maximum=_number(attribute(declared, "max")),
                nominal=_number(attribute(declared, "nominal")),
                choices={i.name: int(i.value) for i in getattr(declared.declaredType, "items", ())},
            )
        )
    return variables


def _number(text: str | None) -> float | None:
    try:
        value = float(text) if text is not None else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _dependencies(
    unknowns: Sequence[Unknown], variables: Mapping[str, Variable], unlisted: frozenset[str] | None
) -> dict[str, frozenset[str] | None]:
    """Declared dependencies of outputs on inputs; `unlisted` are those of an output that is not listed."""
    names: dict[tuple[str, int], list[str]] = {}  # FMI 2.0 counts references by type
    for variable in variables.values():
        names.setdefault((variable.type, variable.reference), []).append(variable.name)
    inputs = {v.name for v in variables.values() if v.causality == "input"}
    dependencies = {v.name: unlisted for v in variables.values() if v.causality == "output"}
    for unknown in unknowns:
        needed = unknown.dependencies
        which = (
            None if needed is None else frozenset(n for v in needed for n in names[v.type, v.valueReference]) & inputs
        )
        for name in names.get((unknown.variable.type, unknown.variable.valueReference), ()):
            dependencies[name] = which
    return dependencies
