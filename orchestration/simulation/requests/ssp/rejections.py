"""Contents of an SSP that tested masters reject (see `docs/guides/ssp.md`)."""

from collections.abc import Iterator

from fmu_kit.variables import INDEX
from orchestration.simulation.requests.ssp.export import Export, Part
from orchestration.systems.system.component import Parameter
from orchestration.systems.system.connection import variable_of


def rejections(export: Export) -> Iterator[str]:
    """A line for each rejected value and connection, with its place in the system and the masters."""
    parts = {part.name: part for part in export.parts}
    for part in export.parts:
        for name, value in part.parameters.items():
            masters = _masters_without(part, name, value)
            if masters is not None:
                kind, instead = part.variable(name).kind, _integer_instead(part, name, value)
                yield f"components.{part.name}.parameters.{name} = {value}: of type {kind}; {masters}{instead}"
    for x in export.system.connections:
        for start, end in zip(x.start, x.end, strict=True):
            kinds = [
                parts[name].variable(variable_of(port)).kind for name, port in ((x.sender, start), (x.receiver, end))
            ]
            if kinds[0] != kinds[1] or "Enumeration" in kinds:
                yield f"{start} to {end}: from {kinds[0]} to {kinds[1]}; libcosim and ecos refuse the SSP"


def _integer_instead(part: Part, name: str, value: Parameter) -> str:
    """The alternative that all masters accept: the Integer that this project's FMUs have beside an Enumeration."""
    index, choices = f"{name}{INDEX}", part.variable(name).choices
    if index not in part.model.variables or not choices:
        return ""
    return f"; all take {index} = {choices.get(str(value), value)}"


def _masters_without(part: Part, name: str, value: Parameter) -> str | None:
    """The behaviour of masters that reject a value; None if all accept it."""
    kind = part.variable(name).kind
    if kind == "Enumeration" and isinstance(value, str):
        return "libcosim crashes, ecos and fmpy refuse the SSP"
    if kind == "Enumeration":
        return "libcosim and ecos leave it as it starts"
    return "fmpy refuses the SSP" if kind == "String" else None
