"""What `quadcosim new controller NAME --for PLANT.fmu` takes from the plant: variables of the law, and the loop."""

import keyword
import re
from collections.abc import Iterator
from pathlib import Path

from fmu_kit.units import base_unit_exponents
from orchestration.components.fmi.read_description import NUMERIC, Model, Variable
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.proposal import PERIOD, STEP, STOP, experiment, listed, placed, to_fill_in

OF_SLAVES = (
    "author continuous_states copyright default_experiment depends_initially derivatives description do_step "
    "enter_initialization_mode exit_initialization_mode fixed get_boolean get_integer get_real get_string guid "
    "initial_dependencies initial_outputs_depend_on_inputs initialise initially_idle instance_name internal_state "
    "is_fresh license log log_categories log_queue modelName next_jump read_parameters register_variable resources "
    "restore set_boolean set_integer set_real set_string setup_experiment step terminate to_xml usual_parameters "
    "variables vars version visible warn_once"
)
"""Attributes that each slave has: a variable of such a name gets another attribute"""


def texts_for(fmu: str, plant: Model, folder: Path) -> dict[str, str]:
    """The texts about a plant, by their names in the templates; `fmu` is what the user wrote, `folder` is written.

    Raises `UsageError` for a plant without inputs or without outputs that are numbers.
    """
    taken, set_ = (
        [plant.variables[name] for name in plant.names(causality, kinds=NUMERIC)] for causality in ("output", "input")
    )
    if not (taken and set_):
        raise UsageError(f"--for {fmu}: {plant.name} has no {'inputs' if taken else 'outputs'}; expected a plant")
    attributes = dict(zip((v.name for v in (*taken, *set_)), _attributes([v.name for v in (*taken, *set_)])))
    step = experiment(plant, "stepSize")
    return {
        "plant": plant.name,
        "inputs": "\n".join(_declared("Input", v, attributes[v.name], "measured") for v in taken),
        "outputs": "\n".join(_declared("Output", v, attributes[v.name], "command of") for v in set_),
        "law": "\n".join(f"        self.{attributes[v.name]} = {_start(v)}" for v in set_),
        "fmu_of_plant": placed(fmu, folder),
        "stop_time": repr(experiment(plant, "stopTime") or STOP),
        "step": repr(step or STEP),
        "period": repr(max(PERIOD, step or 0.0)),
        "measurement": _connection("plant", "controller", taken),
        "command": _connection("controller", "plant", set_),
        "to_fill_in": "\n".join(to_fill_in(f"plant.{taken[0].name}")),
    }


def _attributes(names: list[str]) -> Iterator[str]:
    """An attribute of a class for each name, all different: that name, where it can be one."""
    used = set[str]()
    for name in names:
        attribute = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "variable"
        attribute = f"v{attribute}" if attribute[0].isdigit() else attribute
        while attribute in used or attribute in OF_SLAVES.split() or keyword.iskeyword(attribute):
            attribute += "_"
        used.add(attribute)
        yield attribute


def _declared(kind: str, variable: Variable, attribute: str, what: str) -> str:
    """The line of a class that declares a variable, as what can be connected to it without a conversion.

    An Enumeration is an Integer. Its items, and a unit that no slave can have, stand in the description.
    """
    described, unit = variable.description or f"{what} {variable.name}", variable.unit
    if variable.choices:
        described += f": {', '.join(f'{item} {number}' for item, number in variable.choices.items())}"
    if unit is not None:
        try:
            base_unit_exponents(unit)
        except ValueError:
            described, unit = f"{described} [{unit}]", None
    arguments = [_text(described), "None" if unit is None else _text(unit), _start(variable)]
    arguments += [f"name={_text(variable.name)}"] * (attribute != variable.name)
    return f"    {attribute} = {kind}({', '.join(arguments)})"


def _start(variable: Variable) -> str:
    """Its start value as Python; else 0, or the first item."""
    start = variable.start or str(min(variable.choices.values(), default=0))
    if variable.kind == "Boolean":
        return str(start in ("true", "1"))
    return repr(float(start) if variable.kind == "Real" else int(start))


def _connection(sender: str, receiver: str, variables: list[Variable]) -> str:
    names = [variable.name for variable in variables]
    ends = (("from", sender), ("to", receiver))
    return "\n".join(line for key, end in ends for line in listed(key, [f"{end}.{name}" for name in names]))


def _text(text: str) -> str:
    """A literal of Python in double quotes."""
    return '"' + "".join("\\" + c if c in '"\\' else c for c in " ".join(text.split())) + '"'
