"""A slave with values that are fixed when it is built: they are constants of its FMU, and unused code is left out."""

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass

from fmu_kit.errors import FmuError
from fmu_kit.variables import INDEX, Variable

Value = float | int | bool | str
"""The value of a parameter; for an Enumeration, the name of its item or its number"""
MODULE = "quadcosim_variant"
"""The module that defines the variant in its FMU, beside those of the slave"""


@dataclass(frozen=True, slots=True)
class Variant:
    """The fixed values of an FMU, and its name."""

    name: str
    fixed: tuple[tuple[str, Value], ...]
    """parameters by their FMI names"""

    @classmethod
    def of(cls, name: str, values: Mapping[str, Value]) -> "Variant":
        """The variant with these values, by name."""
        return cls(name, tuple(sorted(values.items())))

    @classmethod
    def parse(cls, text: str) -> "Variant":
        """The variant of a `text`."""
        name, values = json.loads(text)
        return cls.of(name, values)

    @property
    def text(self) -> str:
        """The variant as it is passed to another process."""
        return json.dumps([self.name, dict(self.fixed)])

    def source(self, module: str, model: str) -> str:
        """The source of the module that derives it from a slave class."""
        return (
            f'"""{self.name}: {model} with fixed values."""\n\n'
            f"from {module} import {model}\n\n\n"
            f"class {self.name}({model}):\n"
            f"    description = {self.describe(model)!r}\n"
            f"    fixed = {dict(self.fixed)!r}\n"
        )

    def describe(self, model: str) -> str:
        """A description in one line."""
        listed = ", ".join(f"{name} = {value}" for name, value in self.fixed)
        return f"{model} with {listed or 'another name'}"


def with_fixed_values(model: str, fixed: Mapping[str, Value], variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
    """The variables, with the fixed ones as constants; raises `FmuError` for a name or a value that cannot be fixed."""
    values, names = dict(fixed), {v.name: v for v in variables}
    for name, value in fixed.items():
        beside = name.removesuffix(INDEX)
        if name not in names:
            near = difflib.get_close_matches(name, names, n=1)
            raise FmuError(f"{name}: no parameter of {model}{f'; did you mean {near[0]}?' if near else ''}")
        if beside != name and names.get(beside, names[name]).items:
            raise FmuError(f"{name}: expected {beside}, which fixes both")
        if names[name].items:
            values[f"{name}{INDEX}"] = names[name].items.get(str(value), value)
    return tuple(v.fixed_at(values[v.name]) if v.name in values else v for v in variables)
