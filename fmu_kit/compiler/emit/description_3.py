"""`modelDescription.xml` of FMI 3.0 from the declarations of a slave, with the same content as that of FMI 2.0."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, SubElement

from fmu_kit import write_description
from fmu_kit.compiler.emit.sampling_clock import CLOCK
from fmu_kit.variables import Variable
from fmu_kit.write_description import GUID_PLACEHOLDER, NATIVE_LOG_CATEGORIES

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
