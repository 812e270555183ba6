"""What `quadcosim new controller NAME --for PLANT.fmu` takes from the plant: variables of the law, and the loop."""

import keyword
import re
from collections.abc import Container
from dataclasses import replace
from pathlib import Path

from fmu_kit.units import base_unit_exponents
from orchestration.components.building import wrap
from orchestration.components.fmi.read_description import NUMERIC, Model, Variable, items_text
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.proposal import PERIOD, STEP, STOP, experiment, key_of, listed, placed, to_fill_in

OF_SLAVES = (
    "author continuous_states copyright default_experiment depends_initially derivatives description do_step "
    "enter_initialization_mode exit_initialization_mode fixed get_boolean get_integer get_real get_string guid "
    "initial_dependencies initial_outputs_depend_on_inputs initialise initially_idle instance_name internal_state "
    "is_fresh license log log_categories log_queue modelName next_jump read_parameters register_variable resources "
    "restore set_boolean set_integer set_real set_string setup_experiment step terminate to_xml usual_parameters "
    "variables vars version visible warn_once"
)
"""Attributes that each slave has: a variable of such a name gets another attribute"""
OF_C = (
    "alignas alignof asm auto bool break case char const constexpr continue default do double else enum extern false "
    "float for goto if inline int linux long nullptr register restrict return short signed sizeof static "
    "static_assert struct switch thread_local true typedef typeof typeof_unqual union unix unsigned void volatile while"
)
"""Words of C, and macros of its compilers: a variable of such a name gets another field"""


def texts_for(fmu: str, plant: Model, folder: Path, *, in_c: bool = False) -> dict[str, str]:
    """The texts about a plant, by their names in the templates; `fmu` is what the user wrote, `folder` is written.

    Raises `UsageError` for a plant without inputs or without outputs that are numbers, and for a law `in_c` also for
    an input that is not Real, as all outputs of C are.
    """
    taken, set_ = (
        [plant.variables[name] for name in plant.names(causality, kinds=NUMERIC)] for causality in ("output", "input")
    )
    if not (taken and set_):
        raise UsageError(f"--for {fmu}: {plant.name} has no {'inputs' if taken else 'outputs'}; expected a plant")
    taken = [_as_begun(v, plant) for v in taken]
    called, law = (_in_c if in_c else _in_python)(fmu, taken, set_)
    step = experiment(plant, "stepSize")
    return {
        **law,
        "plant": plant.name,
        "fmu_of_plant": placed(fmu, folder),
        "stop_time": repr(experiment(plant, "stopTime") or STOP),
        "step": repr(step or STEP),
        "period": repr(max(PERIOD, step or 0.0)),
        "measurement": _connection("plant", [v.name for v in taken], "controller", [called[v.name] for v in taken]),
        "command": _connection("controller", [called[v.name] for v in set_], "plant", [v.name for v in set_]),
        "to_fill_in": "\n".join(to_fill_in(f"plant.{taken[0].name}")),
    }


def _in_python(_: str, taken: list[Variable], set_: list[Variable]) -> tuple[dict[str, str], dict[str, str]]:
    """The names that a law in Python gives the variables, which are those of the plant, and the texts about it."""
    names = [v.name for v in (*taken, *set_)]
    attributes = _identifiers(names, {*OF_SLAVES.split(), *keyword.kwlist})
    return dict(zip(names, names)), {
        "inputs": "\n".join(_declared("Input", v, attributes[v.name], "measured") for v in taken),
        "outputs": "\n".join(_declared("Output", v, attributes[v.name], "command of") for v in set_),
        "law": "\n".join(f"        self.{attributes[v.name]} = {_start(v)!r}" for v in set_),
    }


def _in_c(fmu: str, taken: list[Variable], set_: list[Variable]) -> tuple[dict[str, str], dict[str, str]]:
    """Likewise for one in C, whose variables have the names of the plant where `wrap` knows such names."""
    for v in set_:
        if v.kind != "Real":
            raise UsageError(
                f"--for {fmu} --c: {v.name} is {v.kind}; expected Real inputs, as outputs of C are; without --c, "
                "a law in Python has others too"
            )
    names = [v.name for v in (*taken, *set_)]
    fields = _identifiers(names, OF_C.split())
    called = _identifiers(names, (), kept=wrap.NAME)
    texts: dict[str, str] = {}
    for struct, variables, what in (("in", taken, "measured"), ("out", set_, "command of")):
        texts[f"fields_{struct}"] = "\n".join(_field(v, fields[v.name]) for v in variables)
        lines = (_mapped(v, called[v.name], f"{struct}.{fields[v.name]}", what) for v in variables)
        texts[f"{struct}puts"] = "\n".join(lines)
    return called, {
        **texts,
        "starts": "".join(f"in.{fields[v.name]} = {float(_start(v))!r}; " for v in taken if _start(v)),
        "law": "\n".join(f"    out->{fields[v.name]} = {_start(v)!r};" for v in set_),
    }


def _identifiers(names: list[str], taken: Container[str], kept: re.Pattern[str] | None = None) -> dict[str, str]:
    """An identifier for each name, all different: that name, where it can be one, or one that is `kept`."""
    found: dict[str, str] = {}
    for name in names:
        one = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "variable"
        one = name if kept is not None and kept.fullmatch(name) else f"v{one}" if one[0].isdigit() else one
        while one in found.values() or one in taken:
            one += "_"
        found[name] = one
    return found


def _about(variable: Variable, what: str) -> tuple[str, str | None]:
    """Its description and its unit, as what can be connected to it without a conversion.

    An Enumeration is an Integer. Its items, and a unit that no slave can have, stand in the description.
    """
    described, unit = variable.description or f"{what} {variable.name}", variable.unit
    if variable.choices:
        described += f": {items_text(variable.choices)}"
    if unit is not None:
        try:
            base_unit_exponents(unit)
        except ValueError:
            described, unit = f"{described} [{unit}]", None
    return described, unit


def _declared(kind: str, variable: Variable, attribute: str, what: str) -> str:
    """The line of a class that declares a variable."""
    described, unit = _about(variable, what)
    arguments = [_text(described), "None" if unit is None else _text(unit), repr(_start(variable))]
    arguments += [f"name={_text(variable.name)}"] * (attribute != variable.name)
    return f"    {attribute} = {kind}({', '.join(arguments)})"


def _mapped(variable: Variable, name: str, c: str, what: str) -> str:
    """The line of a file for `wrap` that says which variable of the C it is."""
    described, unit = _about(variable, what)
    return f'{key_of(name)} = {{ c = "{c}", unit = {_text(unit or "")}, description = {_text(described)} }}'


def _field(variable: Variable, field: str) -> str:
    """The line of a struct that declares a variable; its unit cannot end the comment."""
    return f"    double {field};" + (f" /* {variable.unit.replace('*/', '* /')} */" if variable.unit else "")


def _as_begun(output: Variable, plant: Model) -> Variable:
    """An output with the start value of the state that it is, which slaves have as a parameter `initial.NAME`."""
    state = plant.variables.get(f"initial.{output.name}")
    return output if output.start is not None or state is None else replace(output, start=state.start)


def _start(variable: Variable) -> float | bool:
    """Its start value; else 0, or the first item."""
    start = variable.start or str(min(variable.choices.values(), default=0))
    if variable.kind == "Boolean":
        return start in ("true", "1")
    return float(start) if variable.kind == "Real" else int(start)


def _connection(sender: str, outputs: list[str], receiver: str, inputs: list[str]) -> str:
    ends = (("from", sender, outputs), ("to", receiver, inputs))
    return "\n".join(line for key, end, names in ends for line in listed(key, [f"{end}.{name}" for name in names]))


def _text(text: str) -> str:
    """A literal of Python, and of TOML, in double quotes."""
    return '"' + "".join("\\" + c if c in '"\\' else c for c in " ".join(text.split())) + '"'
