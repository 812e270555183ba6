"""Writes steps that are a straight line (see `passes/straightening.py`), one or several, as C for SIMD lanes."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace
from enum import IntEnum
from typing import ClassVar

from fmu_kit.compiler.emit.c_names import c_name, place_names
from fmu_kit.compiler.emit.lane_writer import LaneWriter
from fmu_kit.compiler.trace.statements import Block, Function, Statement
from fmu_kit.compiler.trace.symbols import CHEAP, Symbol, closure
from fmu_kit.compiler.trace.tracing import Program


class Rate(IntEnum):
    """How often a value changes while steps of one length follow one another: its operands, with those before them."""

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


class LineWriter(LaneWriter):
    """Writes a step that is a straight line: if a guard holds in any lane, it stores nothing and returns 0.

    Everything that a next step needs is computed before the guards are tested, without any branch, so that a compiler
    can order operations for low latency. Variables that are `unread` by the slave come last, if they are `wanted`.
    """

    type: ClassVar = "Q_FLAT q_mask"
    always: ClassVar[tuple[str, ...]] = ("v", "wanted")
    first: ClassVar[tuple[str, ...]] = ("q_place *v", "q_mask live", "const uint8_t *wanted")

    def __init__(self, function: Function, program: Program, places: dict[str, str], unread: Set[str]) -> None:
        super().__init__(function, program, places)
        self.unread = unread
        self.declared.append("q_mask rare = q_known(0);")
        self.stores = [each for each in function.body if each.op == "store"]
        self.needed = [each for each in self.stores if each.data not in unread]
        self.is_guarded = True
        """whether the guards are still to be tested, so that functions may mark rare lanes"""

    def _block(self, block: Block) -> None:
        self._guarded([each.symbols[0] for each in block if each.op == "if"], "return q_known(0);")
        self._line(self.through)

    def _guarded(self, guards: Sequence[Symbol], leave: str) -> None:
        """Write what a step computes, its guards, and its stores."""
        test = self._any_of(guards)
        for each in self.needed:
            self._as_argument(each.symbols[0])
        self._line(f"Q_IF_EVER(q_any(live & ({test}))) {leave}")
        self.is_guarded = False
        for each in self.needed:
            self._store(each, ())
        for _, some in itertools.groupby((each for each in self.stores if each.data in self.unread), _vector):
            self._wanted(list(some))

    def _any_of(self, guards: Sequence[Symbol]) -> str:
        return " | ".join(dict.fromkeys(["rare", *map(self.value, guards)]))

    def _wanted(self, stores: list[Statement]) -> None:
        """Write the stores of one vector, done if any of them is wanted."""
        self._line(f"if ({' || '.join(['!wanted', *(f'wanted[{self.places[each.data]}]' for each in stores)])}) {{")
        self.scopes.append({})
        for each in stores:
            self._store(each, ())
        self.scopes.pop()
        self._line("}")

    def _of_reals(self, symbol: Symbol) -> str:
        if self.is_guarded and symbol.op in ("sin", "cos"):
            return f"{self._pair(symbol.args[0])}.{symbol.op}"
        if self.is_guarded and symbol.op == "pow":
            return f"q_usual_pow({', '.join(map(self._as_argument, symbol.args))}, &rare)"
        return super()._of_reals(symbol)

    def _sines(self, angle: str) -> str:
        return f"q_usual_sin_cos({angle}, &rare)" if self.is_guarded else super()._sines(angle)


class StepsWriter(LineWriter):
    """Writes several steps of one length that are straight lines; where a guard holds in any lane, they end.

    The function returns how many steps it has done. What is the same in all of them is computed before them; costly
    functions of time alone, too, for as many steps at once as there are lanes.
    """

    type: ClassVar = "Q_FLAT int64_t"
    always: ClassVar[tuple[str, ...]] = ("wanted",)
    first: ClassVar[tuple[str, ...]] = ("q_place *v", "q_mask live", "const uint8_t *wanted", "const Steps *steps")

    def __init__(self, function: Function, program: Program, places: dict[str, str], unread: Set[str]) -> None:
        super().__init__(function, program, places, unread)
        self.declared.append("int64_t done = 0;")
        self.through = "return done;"
        self.time, self.length = function.parameters
        self.rate = rates(self.used, self.time, function.stores)
        guards = [each.symbols[0] for each in function.body if each.op == "if"]
        self.guards = {rate: [guard for guard in guards if self.rate[id(guard)] == rate] for rate in Rate}
        """conditions that are tested once, for all steps at once, and in each"""
        before = closure([*guards, *(each.symbols[0] for each in self.needed)])
        numeric = of_numbers(before, self.rate)
        self.guards[Rate.STATE] += [each for each in self.guards[Rate.TIME] if id(each) not in numeric]
        self.guards[Rate.TIME] = [each for each in self.guards[Rate.TIME] if id(each) in numeric]
        self.tables = [each for key, each in before.items() if key in numeric and is_costly(each)]
        """costly values of time alone that the next step needs"""

    def _parameters(self) -> list[str]:
        return []

    def _unused_parameters(self) -> list[str]:
        return []

    def _load_places(self) -> None:
        """Write the values that stay the same."""
        self._line(f"const q_real {self.scopes[0][id(self.length)]} = steps->h;")
        self._load_all(Rate.NONE)

    def _load_all(self, rate: Rate) -> None:
        for symbol in self.used.values():
            if symbol.op == "load" and self.rate[id(symbol)] == rate:
                self._take_from_memory(symbol)

    def _block(self, block: Block) -> None:
        self._constant()
        self._line(f"q_place timed[{len(self.tables) or 1}][MOST_STEPS + LANES];")
        with self._inside("{"):
            self._of_time()
        self._line("rare = q_known(0);")
        with self._inside("do {", "} while (++done < steps->count && steps->between(steps->given));"):
            self._step()
        self._line(self.through)

    @contextlib.contextmanager
    def _inside(self, head: str, end: str = "}") -> Iterator[None]:
        """Write an inner block of C."""
        self._line(head)
        self.scopes.append({})
        yield
        self.scopes.pop()
        self._line(end)

    def _constant(self) -> None:
        """Write the values that are the same in all steps, as far as others need them, and their guards."""
        needed = [arg for symbol in self.used.values() if self.rate[id(symbol)] for arg in symbol.args]
        for symbol in [*needed, *(each.symbols[0] for each in self.stores), *self.guards[Rate.NONE]]:
            if not self.rate[id(symbol)]:
                self.value(symbol)
        self._line(f"Q_IF_EVER(q_any(live & ({self._any_of(self.guards[Rate.NONE])}))) return 0;")

    def _of_time(self) -> None:
        """Write tables of what follows from time alone: lanes are steps where all else is the same in all lanes."""
        timed = [each for each in closure([*self.tables, *self.guards[Rate.TIME]]).values() if self.rate[id(each)]]
        operands = {
            id(arg): arg for each in timed for arg in each.args if not self.rate[id(arg)] and arg.op != "constant"
        }
        names = {key: self.value(symbol) for key, symbol in operands.items()}
        alike = [f"is_one({name}, live, steps->lane)" for name in dict.fromkeys(names.values())]
        self._line(f"const int at_once = {' && '.join(alike) or '1'};")
        for name in dict.fromkeys(names.values()):
            self._line(f"const q_real of_{name} = at_once ? q_all(q_lane({name}, steps->lane)) : {name};")
        self.scopes[-1].update({key: f"of_{name}" for key, name in names.items()})
        with self._inside("for (int64_t i = 0; i < steps->count; i += at_once ? LANES : 1) {"):
            self._line(f"const q_real {self._begin} = at_once ? values_of(steps->times + i) : q_all(steps->times[i]);")
            for k, symbol in enumerate(self.tables):
                self._line(f"fill(&timed[{k}][i], {self.value(symbol)}, at_once);")
            guards = self._any_of(self.guards[Rate.TIME])
            self._line(f"Q_IF_EVER(q_any((at_once ? q_known(1) : live) & ({guards}))) return 0;")

    @property
    def _begin(self) -> str:
        return self.scopes[0][id(self.time)]

    def _step(self) -> None:
        self._line(f"const q_real {self._begin} = q_all(steps->times[done]);")
        self._load_all(Rate.STATE)
        self.scopes[-1].update({id(symbol): f"timed[{k}][done]" for k, symbol in enumerate(self.tables)})
        self._guarded(self.guards[Rate.STATE], "break;")


def _vector(store: Statement) -> str:
    name: str = store.data
    return name.rpartition(".")[0] or name


def lane_code(program: Program, line: Function | None = None) -> str:
    """The C of the functions of a program in lanes, each after those that it calls, and of its straight line."""
    names = place_names(program.places)
    writers: list[LaneWriter] = [LaneWriter(function, program, names) for function in program.functions]
    if line is None:
        return "\n\n".join(writer.text() for writer in writers) + "\n"
    read = {symbol.data[0] for writer in writers for symbol in writer.used.values() if symbol.op == "load"}
    unread = {variable.name for variable in program.slave.variables} - read
    several = replace(line, name=f"{line.name} several times", doc="Several of such steps.")
    return "\n\n".join([
        *(writer.text() for writer in (*writers, LineWriter(line, program, names, unread))),
        f"#define STRAIGHT_STEP {c_name(line.name)}", "#ifdef QUADCOSIM_SEVERAL",
        StepsWriter(several, program, names, unread).text(),
        f"#define STRAIGHT_STEPS {c_name(several.name)}", "#endif\n",
    ])  # fmt: skip
