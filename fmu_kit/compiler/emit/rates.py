"""How often the values of a step change while steps of one length follow one another and no input is set."""

from __future__ import annotations

from collections.abc import Mapping, Set
from enum import IntEnum

from fmu_kit.compiler.trace.symbols import CHEAP, Symbol


class Rate(IntEnum):
    """The operands of a value; each rate includes those before it."""

    NONE = 0
    """parameters, inputs and the length of the step: it is the same in all steps"""
    TIME = 1
    """time at which the step begins"""
    STATE = 2
    """places that steps store"""


def rates(used: Mapping[int, Symbol], time: Symbol, stores: Set[str]) -> dict[int, Rate]:
    """The rate of each of the `used` symbols of a function, which come after their operands, by identity.

    The parameter `time` is where a step begins; `stores` are the places that a step stores.
    """
    found: dict[int, Rate] = {}
    for key, symbol in used.items():
        if symbol is time:
            found[key] = Rate.TIME
        elif symbol.op == "load":
            found[key] = Rate.STATE if symbol.data[0] in stores else Rate.NONE
        else:
            found[key] = max((found[id(arg)] for arg in symbol.args), default=Rate.NONE)
    return found


def of_numbers(symbols: Mapping[int, Symbol], rate: Mapping[int, Rate]) -> frozenset[int]:
    """Those that follow from time alone without conditions that are the same in all steps, by identity."""
    numeric: set[int] = set()
    for key, symbol in symbols.items():
        if rate[key] == Rate.TIME:
            fixed = [arg for arg in symbol.args if not rate[id(arg)] and arg.op != "constant"]
            timed = [arg for arg in symbol.args if rate[id(arg)]]
            if all(arg.kind in ("real", "int") for arg in fixed) and all(id(arg) in numeric for arg in timed):
                numeric.add(key)
    return frozenset(numeric)


def is_costly(symbol: Symbol) -> bool:
    """Whether a number takes more than a few sums and products to compute."""
    return symbol.kind == "real" and bool(symbol.args) and symbol.op not in CHEAP
