"""`modelDescription.xml` from the declarations of a slave.

pythonfmu writes neither units, bounds, initial unknowns nor dependencies, and start values with 16
digits only; here every number is written in its shortest exact form.
"""

import datetime
import os
from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from fmu_kit.units import base_unit_exponents
from fmu_kit.variables import Variable

PYTHON_REQUIRED = ">=3.10"
"""The Pythons that run what an FMU bundles, as a version specifier; it is in every model description."""

GUID_PLACEHOLDER = "guid-of-the-content"
"""Stands where packaging writes the GUID, once it knows the content."""


def to_xml(slave: Any, sources: Sequence[str] | None = None) -> Element:
    """The FMI 2.0 description of a `Slave` class, its GUID still the placeholder.

    With `sources`, the files to compile, it is the one of an FMU without Python inside.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=slave.__name__,
        guid=GUID_PLACEHOLDER,
        description=slave.description,
        author=slave.author,
        license=slave.license,
        generationTool="quadcosim",
        generationDateAndTime=generation_date(),
        variableNamingConvention="structured",
    )
    kind = SubElement(
        root,
        "CoSimulation",
        modelIdentifier=slave.__name__,
        needsExecutionTool="false",
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs="false",
        canBeInstantiatedOnlyOncePerProcess="false",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    if sources is not None:
        kind.set("providesDirectionalDerivative", "true")
    if sources is not None:
        files = SubElement(kind, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)
    _add_units(root, slave.variables)
    categories = SubElement(root, "LogCategories")
    native = {} if sources is None else {"logStatusError": "All other failures."}
    for name, description in {**slave.log_categories, **native}.items():
        SubElement(categories, "Category", name=name, description=description)
    experiment = slave.default_experiment
    SubElement(
        root,
        "DefaultExperiment",
        startTime=repr(experiment.start_time),
        stopTime=repr(experiment.stop_time),
        stepSize=repr(experiment.step_size),
    )
    annotations = SubElement(root, "VendorAnnotations")
    tool = SubElement(annotations, "Tool", name="quadcosim")
    if sources is None:
        SubElement(tool, "Python", requires=PYTHON_REQUIRED)
    variables = SubElement(root, "ModelVariables")
    for value_reference, variable in enumerate(slave.variables):
        variables.append(_scalar_variable(variable, value_reference))
    _add_structure(root, slave)
    return root


def generation_date() -> str:
    """SOURCE_DATE_EPOCH, else the start of 1980, in Zulu form."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if epoch is None:
        return "1980-01-01T00:00:00Z"
    return datetime.datetime.fromtimestamp(int(epoch), datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")


def _add_units(root: Element, variables: tuple[Variable, ...]) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in variables if v.unit is not None}):
        unit = SubElement(definitions, "Unit", name=name)
        exponents = {base: str(exponent) for base, exponent in base_unit_exponents(name).items()}
        SubElement(unit, "BaseUnit", attrib=exponents)


def _scalar_variable(variable: Variable, value_reference: int) -> Element:
    element = Element(
        "ScalarVariable",
        name=variable.name,
        valueReference=str(value_reference),
        description=variable.description,
        causality=variable.causality,
        variability=variable.variability,
    )
    attributes: dict[str, str] = {}
    if variable.has_start:
        attributes["start"] = _literal(variable.start)
    if variable.causality != "input":  # an input's initial is exact and must not be written
        element.set("initial", "exact" if variable.has_start else "calculated")
    if variable.unit is not None:
        attributes["unit"] = variable.unit
    lower = variable.minimum if variable.minimum is not None else variable.above
    if lower is not None:
        attributes["min"] = _literal(lower)
    if variable.maximum is not None:
        attributes["max"] = _literal(variable.maximum)
    SubElement(element, variable.type, attrib=attributes)
    return element


def _literal(value: float | int | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _add_structure(root: Element, slave: Any) -> None:
    structure = SubElement(root, "ModelStructure")
    by_causality = {
        causality: [i for i, v in enumerate(slave.variables, start=1) if v.causality == causality]
        for causality in ("input", "output")
    }
    outputs = SubElement(structure, "Outputs")
    for index in by_causality["output"]:
        SubElement(outputs, "Unknown", index=str(index), dependencies="")
    known = by_causality["input"] if slave.initial_outputs_depend_on_inputs else []
    initial = SubElement(structure, "InitialUnknowns")
    for index in by_causality["output"]:
        SubElement(initial, "Unknown", index=str(index), dependencies=" ".join(map(str, known)))
