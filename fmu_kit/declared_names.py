"""Names of a slave's attributes: those that it must not declare, and those that it must declare before it sets them."""

from collections.abc import Callable, Iterable
from typing import Any

from fmu_kit.interface import Declaration

PYTHONFMU_NAMES = ("vars", "instance_name", "resources", "visible", "log_queue", "guid", "version", "modelName")
"""Attributes of instances that pythonfmu sets."""


def expect_free_names(slave: type, base: type, declared: Iterable[Declaration]) -> None:
    """Raise `TypeError` for a variable whose name every slave, made from `base`, already uses."""
    for each in declared:
        if hasattr(base, each.attribute) or each.attribute in (*base.__annotations__, *PYTHONFMU_NAMES):
            raise TypeError(f"{slave.__name__}.{each.attribute}: every slave has this name; expected another one")


def expect_variables(slave: Any, where: str, names: Iterable[str]) -> None:
    """Raise `TypeError` for a name that is not of a variable of the slave."""
    for name in sorted(set(names).difference(each.name for each in slave.variables)):
        raise TypeError(f"{slave.__name__}: {where}: there is no {name}; expected inputs and parameters")


def expect_declared(slave: Any, again: Callable[[], None]) -> None:
    """Raise `AttributeError` for an attribute that was set without being declared, probably by a typing error.

    The statement that sets it is found by running it `again`: checking each assignment would slow down all steps.
    """
    undeclared = [name for name in vars(slave) if _is_undeclared(slave, name)]
    slave._known_attributes = len(vars(slave))
    if undeclared:
        type(slave).__setattr__ = _set_declared  # type: ignore[assignment]
        try:
            again()
        finally:
            del type(slave).__setattr__
        _raise_undeclared(slave, undeclared[0])


def _is_undeclared(slave: Any, name: str) -> bool:
    return not (name.startswith("_") or name in slave._base_attributes or hasattr(type(slave), name))


def _raise_undeclared(slave: Any, name: str) -> None:
    own = ", ".join(slave._own)
    raise AttributeError(f"self.{name}: no such variable; expected {own}, or a name that begins with _")


def _set_declared(slave: Any, name: str, value: Any) -> None:
    """Set an attribute; raises `AttributeError` for one that is not declared."""
    if _is_undeclared(slave, name):
        _raise_undeclared(slave, name)
    object.__setattr__(slave, name, value)
