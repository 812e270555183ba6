"""The versions of FMI for which C is generated, their differences, and the description of FMI 3.0."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

from fmu_kit import write_description
from fmu_kit.variables import Variable
from fmu_kit.write_description import GUID_PLACEHOLDER, NATIVE_LOG_CATEGORIES

CLOCK = "sample_clock"
"""Name of the clock"""
_PERIOD = "sample_period"


def sampling_period(slave: Any) -> int | None:
    """The value reference of the parameter that is the period of its samples, 0 for one at every step; None: none."""
    return next((i for i, v in enumerate(slave.variables) if v.name == _PERIOD and v.is_settable), None)


def samples(slave: Any) -> bool:
    """Whether it has one."""
    return sampling_period(slave) is not None


TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration"}
"""Types of variables, by their names in FMI 2.0"""


def to_xml(slave: Any, *, has_clock: bool) -> Element:
    """The FMI 3.0 description of a `Slave` class without Python inside, with the placeholder as its token.

    Variables have the value references that they have in FMI 2.0; the independent variable comes after them, then the
    clock of its samples, if it has one.
    """
    root = Element(
        "fmiModelDescription",
        {"fmiVersion": "3.0", "instantiationToken": GUID_PLACEHOLDER, **write_description.about(slave)},
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=slave.__name__,
        needsExecutionTool="false",
        canBeInstantiatedOnlyOncePerProcess="false",
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        providesDirectionalDerivatives="true",
        canHandleVariableCommunicationStepSize="true",
        hasEventMode=str(has_clock).lower(),
    )
    write_description.add_units(root, slave.variables)
    write_description.add_types(
        root, slave.variables, lambda types, name: SubElement(types, "EnumerationType", name=name)
    )
    write_description.add_log_categories(root, {**slave.log_categories, **NATIVE_LOG_CATEGORIES})
    write_description.add_experiment(root, slave)
    variables = SubElement(root, "ModelVariables")
    for value_reference, variable in enumerate(slave.variables):
        variables.append(_variable(variable, value_reference))
    variables.append(_time(len(slave.variables)))
    if has_clock:
        variables.append(_clock(slave, len(slave.variables) + 1))
    _add_structure(root, slave)
    return root


def _variable(variable: Variable, value_reference: int) -> Element:
    return Element(
        TYPES[variable.type],
        {**write_description.attributes(variable, value_reference), **write_description.type_attributes(variable)},
    )


def _time(value_reference: int) -> Element:
    """The independent variable, in seconds, the default."""
    return Element(
        "Float64",
        name="time",
        valueReference=str(value_reference),
        description="The time of the last communication point",
        causality="independent",
        variability="continuous",
    )


def _clock(slave: Any, value_reference: int) -> Element:
    """The clock at whose ticks it samples, in event mode; without that its parameters say when."""
    return Element(
        "Clock",
        name=CLOCK,
        valueReference=str(value_reference),
        description="Ticks at each sample, in event mode",
        causality="input",
        variability="discrete",
        intervalVariability="fixed",
        intervalDecimal=repr(slave.default_experiment.step_size),
    )


def _add_structure(root: Element, slave: Any) -> None:
    structure = SubElement(root, "ModelStructure")
    known = write_description.initial_dependencies(slave)
    for reference in known:
        SubElement(structure, "Output", valueReference=str(reference), dependencies="")
    for reference, needed in known.items():
        unknown = SubElement(structure, "InitialUnknown", valueReference=str(reference))
        if needed is not None:
            unknown.set("dependencies", " ".join(map(str, needed)))


TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
"""Path in an FMU of what says which variables are connected together"""


def terminals_xml(slave: Any) -> Element | None:
    """The terminals of a `Slave` class; None if it has none.

    Two terminals of one name are connected by the names of their variables (matching rule plug).
    """
    names = dict.fromkeys(v.terminal for v in slave.variables if v.terminal is not None)
    if not names:
        return None
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    listed = SubElement(root, "Terminals")
    for name in names:
        terminal = SubElement(listed, "Terminal", name=name, matchingRule="plug")
        for variable in slave.variables:
            if variable.terminal == name:
                SubElement(
                    terminal,
                    "TerminalMemberVariable",
                    variableName=variable.name,
                    memberName=variable.name,
                    variableKind="signal",
                )
    return root


@dataclass(frozen=True, kw_only=True)
class Standard:
    """A version of FMI, for co-simulation."""

    version: int
    main: str
    """the file to compile; it includes the others"""
    describe: Callable[[Any, str], Element]
    """makes the model description of a slave class, from it and the file to compile"""
    beside: Callable[[Any, str], Mapping[str, bytes]]
    """makes the other description files, by path, from the slave class and the file to compile"""
    calls: Mapping[str, str]
    """the functions that a phase may refuse, by their names in instance.h"""
    has_clocks: bool = False
    """whether a slave that samples has a clock, at whose ticks a host makes it sample"""
    types: Mapping[str, str]
    """Type in the names of the functions that get and set its values, by type of FMI 2.0"""


def _build_description(model: str, main: str) -> Element:
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=model)
    files = SubElement(configuration, "SourceFileSet", language="C11")
    SubElement(files, "SourceFile", name=main)
    return root


def _beside_3(slave: Any, main: str) -> dict[str, bytes]:
    found = {
        "sources/buildDescription.xml": _build_description(slave.__name__, main),
        TERMINALS: terminals_xml(slave),
    }
    return {
        path: tostring(root, encoding="UTF-8", xml_declaration=True) for path, root in found.items() if root is not None
    }


STANDARDS = {
    2: Standard(
        version=2,
        main="fmi2.c",
        describe=lambda slave, main: write_description.to_xml(slave, [main]),
        beside=lambda slave, main: {},
        calls={
            "SETUP_EXPERIMENT": "fmi2SetupExperiment",
            "ENTER_INITIALIZATION_MODE": "fmi2EnterInitializationMode",
            "EXIT_INITIALIZATION_MODE": "fmi2ExitInitializationMode",
            "DO_STEP": "fmi2DoStep",
            "TERMINATE": "fmi2Terminate",
        },
        types={
            "Real": "Real",
            "Integer": "Integer",
            "Boolean": "Boolean",
            "String": "String",
            "Enumeration": "Integer",
        },
    ),
    3: Standard(
        version=3,
        main="fmi3.c",
        describe=lambda slave, main: to_xml(slave, has_clock=False),
        beside=_beside_3,
        calls={
            "SETUP_EXPERIMENT": "fmi3EnterInitializationMode",
            "ENTER_INITIALIZATION_MODE": "fmi3EnterInitializationMode",
            "EXIT_INITIALIZATION_MODE": "fmi3ExitInitializationMode",
            "DO_STEP": "fmi3DoStep",
            "TERMINATE": "fmi3Terminate",
        },
        types={
            "Real": "Float64",
            "Integer": "Int32",
            "Boolean": "Boolean",
            "String": "String",
            "Enumeration": "Enumeration",
        },
    ),
}
"""Standards by version of FMI"""
CLOCKED = replace(STANDARDS[3], has_clocks=True, describe=lambda slave, main: to_xml(slave, has_clock=samples(slave)))
"""FMI 3.0, with clocks"""
