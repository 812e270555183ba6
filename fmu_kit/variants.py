"""A slave with values that are fixed when it is built: constants of its FMU, and what they turn off is gone."""

import json
from collections.abc import Mapping
from dataclasses import dataclass

Value = float | int | bool | str
"""Of a parameter; an Enumeration's by the name of its item, or its number"""
MODULE = "quadcosim_variant"
"""Of the source that an FMU has of it, beside those of the slave"""


@dataclass(frozen=True, slots=True)
class Variant:
    """What is fixed, and what the FMU is called."""

    name: str
    fixed: tuple[tuple[str, Value], ...]
    """parameters by their FMI names"""

    @classmethod
    def of(cls, name: str, values: Mapping[str, Value]) -> "Variant":
        """The one of values by name."""
        return cls(name, tuple(sorted(values.items())))

    @classmethod
    def parse(cls, text: str) -> "Variant":
        """What `text` gives."""
        name, values = json.loads(text)
        return cls.of(name, values)

    @property
    def text(self) -> str:
        """As it is passed to another process."""
        return json.dumps([self.name, dict(self.fixed)])

    def source(self, module: str, model: str) -> str:
        """The module that defines it, made of a slave class."""
        return (
            f'"""{self.name}: {model} with values that are fixed."""\n\n'
            f"from {module} import {model}\n\n\n"
            f"class {self.name}({model}):\n"
            f"    description = {self.described(model)!r}\n"
            f"    fixed = {dict(self.fixed)!r}\n"
        )

    def described(self, model: str) -> str:
        """What it is, in a line."""
        listed = ", ".join(f"{name} = {value}" for name, value in self.fixed)
        return f"{model} with {listed or 'another name'}"
