"""`modelDescription.xml` from the declarations of a slave.

pythonfmu writes no units, bounds, initial unknowns or dependencies, and start values with only 16 digits; here every
number is written in its shortest exact form.
"""

import datetime
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from fmu_kit.units import DISPLAYED, base_unit_exponents
from fmu_kit.variables import Variable

PYTHON_REQUIRED = ">=3.10"
"""The version specifier of the Pythons that run what an FMU bundles; it is in every model description."""

GUID_PLACEHOLDER = "guid-of-the-content"
"""The placeholder that packaging replaces by the GUID of the content."""


NATIVE_LOG_CATEGORIES = {"logStatusError": "All other failures."}
"""The log categories of an FMU without Python inside, beside those of its slave."""


def to_xml(slave: Any, sources: Sequence[str] | None = None) -> Element:
    """The FMI 2.0 description of a `Slave` class, with the placeholder as its GUID.

    With `sources`, the files to compile, it describes an FMU without Python inside.
    """
    root = Element("fmiModelDescription", {"fmiVersion": "2.0", "guid": GUID_PLACEHOLDER, **about(slave)})
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
        files = SubElement(kind, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)
    add_units(root, slave.variables)
    add_types(root, slave.variables, _simple_type)
    add_log_categories(root, {**slave.log_categories, **({} if sources is None else NATIVE_LOG_CATEGORIES)})
    add_experiment(root, slave)
    annotations = SubElement(root, "VendorAnnotations")
    tool = SubElement(annotations, "Tool", name="quadcosim")
    if sources is None:
        SubElement(tool, "Python", requires=PYTHON_REQUIRED)
    variables = SubElement(root, "ModelVariables")
    for value_reference, variable in enumerate(slave.variables):
        scalar = SubElement(variables, "ScalarVariable", attrib=attributes(variable, value_reference))
        SubElement(scalar, variable.type, attrib=type_attributes(variable))
    _add_structure(root, slave)
    return root


# -- for any version of FMI ---------------------------------------------------------------------------------


def about(slave: Any) -> dict[str, str]:
    """The attributes of a description that concern the model as a whole."""
    attribution = {name: getattr(slave, name) for name in ("author", "copyright", "license")}
    return {
        "modelName": slave.__name__,
        "description": slave.description,
        **{name: text for name, text in attribution.items() if text},
        "generationTool": "quadcosim",
        "generationDateAndTime": generation_date(),
        "variableNamingConvention": "structured",
    }


def generation_date() -> str:
    """SOURCE_DATE_EPOCH, else the start of 1980, in Zulu form."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if epoch is None:
        return "1980-01-01T00:00:00Z"
    return datetime.datetime.fromtimestamp(int(epoch), datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")


def add_units(root: Element, variables: tuple[Variable, ...]) -> Element:
    """Add the units of variables, in base units, with the units that they are displayed in; return their list."""
    definitions = SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in variables if v.unit is not None}):
        unit = SubElement(definitions, "Unit", name=name)
        exponents = {base: str(exponent) for base, exponent in base_unit_exponents(name).items()}
        SubElement(unit, "BaseUnit", attrib=exponents)
        if name in DISPLAYED:
            shown, factor = DISPLAYED[name]
            SubElement(unit, "DisplayUnit", name=shown, factor=repr(factor))
    return definitions


def add_types(root: Element, variables: tuple[Variable, ...], add_type: Callable[[Element, str], Element]) -> None:
    """Add the Enumerations of variables with their items; `add_type` adds the element for the items of one, by name."""
    found = {v.declared_type: v.items for v in variables if v.declared_type is not None}
    if not found:
        return
    types = SubElement(root, "TypeDefinitions")
    for name, items in sorted(found.items()):
        listed = add_type(types, name)
        for item, value in items.items():
            SubElement(listed, "Item", name=item, value=str(value))


def add_log_categories(root: Element, descriptions: Mapping[str, str]) -> None:
    """Add the log categories, by name with their descriptions."""
    categories = SubElement(root, "LogCategories")
    for name, description in descriptions.items():
        SubElement(categories, "Category", name=name, description=description)


def add_experiment(root: Element, slave: Any) -> None:
    """Add the default experiment of a slave."""
    experiment = slave.default_experiment
    SubElement(
        root,
        "DefaultExperiment",
        startTime=repr(experiment.start_time),
        stopTime=repr(experiment.stop_time),
        stepSize=repr(experiment.step_size),
    )


def attributes(variable: Variable, value_reference: int) -> dict[str, str]:
    """The attributes of a variable that do not depend on its type."""
    found = {
        "name": variable.name,
        "valueReference": str(value_reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality != "input":  # an input's initial is exact and must not be written
        found["initial"] = "exact" if variable.has_start else "calculated"
    return found


def type_attributes(variable: Variable) -> dict[str, str]:
    """Declared type, start, quantity, units, bounds and nominal value of a variable."""
    numbers = {
        "start": variable.start if variable.has_start else None,
        "min": variable.minimum if variable.minimum is not None else variable.above,
        "max": variable.maximum,
        "nominal": variable.nominal,
    }
    found = {
        "declaredType": variable.declared_type,
        "quantity": variable.quantity,
        "unit": variable.unit,
        "displayUnit": variable.displayed_in,
        **{name: None if number is None else _literal(number) for name, number in numbers.items()},
    }
    return {name: text for name, text in found.items() if text is not None}


def initial_dependencies(slave: Any) -> dict[int, list[int] | None]:
    """For each output, the inputs and parameters on which it depends when initialisation ends, as value references.

    None: not known, which stands for all.
    """
    names = [v.name for v in slave.variables]
    given = [i for i, v in enumerate(slave.variables) if v.is_settable]
    known = {i: slave.initial_dependencies(v.name) for i, v in enumerate(slave.variables) if v.causality == "output"}
    return {
        output: None if found is None else [i for i in given if names[i] in found] for output, found in known.items()
    }


def _simple_type(types: Element, name: str) -> Element:
    return SubElement(SubElement(types, "SimpleType", name=name), "Enumeration")


def _literal(value: float | int | bool) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(int(value)) if isinstance(value, int) else repr(value)


def _add_structure(root: Element, slave: Any) -> None:
    """Add the model structure; FMI 2.0 refers to variables by their position in the list, from 1."""
    structure = SubElement(root, "ModelStructure")
    known = initial_dependencies(slave)
    listed = SubElement(structure, "Outputs")
    for reference in known:
        SubElement(listed, "Unknown", index=str(reference + 1), dependencies="")
    initial = SubElement(structure, "InitialUnknowns")
    for reference, needed in known.items():
        unknown = SubElement(initial, "Unknown", index=str(reference + 1))
        if needed is not None:
            unknown.set("dependencies", " ".join(str(i + 1) for i in needed))
