"""The values in the parameter bindings of an element, after their mappings."""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from fmu_kit.units import BASE
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.unit_algebra import BaseUnits
from orchestration.simulation.requests.ssp.document import Package, Read, all_of, read
from orchestration.systems.system.component import Parameter
from orchestration.systems.system.conversion import Conversion


@dataclass(frozen=True, kw_only=True)
class Value:
    """A value with its unit."""

    value: Parameter
    unit: str | None
    definition: BaseUnits | None
    """Definition of the unit, in the parameter set itself"""


def values_of(element: Read, package: Package, component: Path) -> Iterator[tuple[str, Value]]:
    """The values of the bindings of an element; a later one overrides. Raises `UsageError`.

    `component` is the file that a source with `sourceBase` component is relative to.
    """
    for binding in all_of(element, "ssd:ParameterBindings/ssd:ParameterBinding"):
        base = component if binding.get("sourceBase") == "component" else None
        if binding.get("source") is not None:
            sets = [read(package.file(binding.get("source"), base), "ssv")]
        else:
            sets = all_of(binding, "ssd:ParameterValues/ssv:ParameterSet")
        prefix = binding.get("prefix", "")
        values = {prefix + name: value for found in sets for name, value in _in_set(found)}
        mappings = all_of(binding, "ssd:ParameterMapping")
        yield from (_mapped(values, mappings[0], package, component) if mappings else values.items())


def _in_set(root: Read) -> Iterator[tuple[str, Value]]:
    definitions = definitions_in(root, "ssv:Units/ssc:Unit")
    for parameter in all_of(root, "ssv:Parameters/ssv:Parameter"):
        (typed, *_) = all_of(parameter, "*")
        kind, text = typed.tag.rpartition("}")[2], typed.get("value")
        unit = typed.get("unit")
        value = Value(value=_value(parameter.get("name"), kind, text), unit=unit, definition=definitions.get(unit))
        yield parameter.get("name"), value


def _value(name: str, kind: str, text: str) -> Parameter:
    if kind == "Real":
        return float(text)
    if kind == "Integer":
        return int(text)
    if kind == "Boolean":
        return text in ("true", "1")
    if kind in ("String", "Enumeration"):
        return text
    raise UsageError(f"parameter {name}: is a {kind}; only Real, Integer, Boolean, Enumeration and String are read")


def _mapped(values: dict[str, Value], mapping: Read, package: Package, component: Path) -> Iterator[tuple[str, Value]]:
    """The values by the entries of a mapping; others are dropped."""
    if mapping.get("source") is not None:
        base = component if mapping.get("sourceBase") == "component" else None
        roots = [read(package.file(mapping.get("source"), base), "ssm")]
    else:
        roots = all_of(mapping, "ssm:ParameterMapping")
    for entry in (entry for root in roots for entry in all_of(root, "ssm:MappingEntry")):
        source, target = entry.get("source"), entry.get("target")
        if source not in values:
            raise UsageError(f"parameter mapping of {source}: the set has no such parameter")
        value, change = values[source], transformation(entry)
        suppressed = entry.get("suppressUnitConversion", "false") in ("true", "1")
        number = value.value
        if not change.is_none:
            if isinstance(number, (bool, str)):
                raise UsageError(f"parameter mapping of {source}: has a transformation; expected a number")
            number = change(number)
        unit = None if suppressed else value.unit
        yield target, Value(value=number, unit=unit, definition=value.definition)


def transformation(parent: Read) -> Conversion:
    """The linear transformation of a connection or of an entry of a mapping; raises `UsageError` for other kinds."""
    for child in all_of(parent, "*"):
        name = child.tag.rpartition("}")[2]
        if name == "LinearTransformation":
            return Conversion(scale=float(child.get("factor", 1.0)), offset=float(child.get("offset", 0.0)))
        if name.endswith("Transformation"):
            raise UsageError(f"a {name}: only linear transformations are read")
    return Conversion()


def definitions_in(root: Read, path: str) -> dict[str, BaseUnits]:
    """The units of a document by name."""
    found = {}
    for unit in all_of(root, path):
        (base,) = all_of(unit, "ssc:BaseUnit")
        found[unit.get("name")] = BaseUnits(
            exponents=tuple(Fraction(int(base.get(key, 0))) for key in BASE),
            factor=float(base.get("factor", 1.0)),
            offset=float(base.get("offset", 0.0)),
        )
    return found
