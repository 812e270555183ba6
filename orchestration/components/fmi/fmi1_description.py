"""What fmpy does not read of the description of an FMU of FMI 1.0, in the terms of FMI 2.0."""

from pathlib import Path
from xml.etree.ElementTree import Element

from fmpy.model_description import ModelDescription, ModelVariable, Unknown

from orchestration.foundation.basics.errors import UsageError

_CAPABILITIES = ("canHandleVariableCommunicationStepSize", "canBeInstantiatedOnlyOncePerProcess")


def completed(description: ModelDescription, root: Element, path: Path) -> None:
    """Complete the description, from the XML; raises `UsageError` for an FMU that is not of co-simulation by itself.

    A variable that is the negative of another one, by whose reference it is called, is left out.
    """
    tool, alone = (root.find(f"Implementation/CoSimulation_{name}") for name in ("Tool", "StandAlone"))
    if alone is None:
        found = "model exchange" if tool is None else "co-simulation with the tool that wrote it"
        raise UsageError(f"{path}: FMI 1.0 for {found}; of FMI 1.0 expected co-simulation of an FMU by itself")
    capabilities = alone.find("Capabilities")
    for name in _CAPABILITIES:
        declared = None if capabilities is None else capabilities.get(name)
        setattr(description.coSimulation, name, declared in ("true", "1"))
    elements = {element.get("name"): element for element in root.iterfind("ModelVariables/ScalarVariable")}
    kept = [v for v in description.modelVariables if elements[v.name].get("alias") != "negatedAlias"]
    description.modelVariables[:] = kept
    for variable in kept:
        _complete(variable, elements[variable.name])
    inputs = {v.name: v for v in kept if v.causality == "input"}
    for output in (v for v in kept if v.causality == "output"):
        declared_of = elements[output.name].find("DirectDependency")
        names = None if declared_of is None else [(each.text or "").strip() for each in declared_of.iter("Name")]
        needed = None if names is None else [inputs[name] for name in names if name in inputs]
        description.initialUnknowns.append(Unknown(variable=output, dependencies=needed))


def _complete(variable: ModelVariable, element: Element) -> None:
    """Complete the causality of a variable, and how it gets its initial value."""
    if variable.causality not in ("input", "output", "parameter"):
        variable.causality = "local"
    if variable.start is None:
        variable.initial = "calculated"
        if variable.causality == "parameter":
            variable.causality = "calculatedParameter"
    else:
        value = element.find(variable.type)
        is_guess = value is not None and value.get("fixed") in ("false", "0")
        variable.initial = "approx" if is_guess else "exact"
