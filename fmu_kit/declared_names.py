"""Names that a slave must not declare, and names of what it declares."""

from collections.abc import Iterable
from typing import Any

from fmu_kit.interface import Declaration

PYTHONFMU_NAMES = ("vars", "instance_name", "resources", "visible", "log_queue", "guid", "version", "modelName")
"""Attributes of instances that pythonfmu sets."""


def expect_free_names(slave: type, base: type, declared: Iterable[Declaration]) -> None:
    """Raise `TypeError` for a variable whose name every slave, made from `base`, or another kind of variable has."""
    for each in declared:
        if hasattr(base, each.attribute) or each.attribute in (*base.__annotations__, *PYTHONFMU_NAMES):
            raise TypeError(f"{slave.__name__}.{each.attribute}: every slave has this name; expected another one")
        for cls in slave.__mro__:
            other = vars(cls).get(each.attribute)
            if isinstance(other, Declaration) and other.causality != each.causality:
                raise TypeError(
                    f"{slave.__name__}.{each.attribute}: {cls.__name__} has a variable of this name, with causality "
                    f"{other.causality}; expected another name"
                )


def expect_variables(slave: Any, where: str, names: Iterable[str]) -> None:
    """Raise `TypeError` for a name that is not of a variable of the slave."""
    for name in sorted(set(names).difference(each.name for each in slave.variables)):
        raise TypeError(f"{slave.__name__}: {where}: there is no {name}; expected inputs and parameters")
