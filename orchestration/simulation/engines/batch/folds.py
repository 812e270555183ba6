"""The functions over a run, such as max and integral, as C that processes row after row: those of `reductions.py`.

The value of each follows from its final states, likewise in C. A signal in continuous time alone has the same value
just before a row as at that row; a held signal has there the value of the row before.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.simulation.engines.batch.writing import ExpressionWriter, Kind, Moment, Section
from orchestration.systems.expressions.over_run import STOP_TIME, Recorded, SpanValues, reductions
from orchestration.systems.expressions.syntax import Call, Name, Node, Sampled


@dataclass(kw_only=True)
class Rows:
    """The C for rows of one kind: all, those with messages of a connection, those at which held values may change."""

    section: Section
    mask: str
    """Mask of the lanes that have such a row now"""
    first: list[str] = field(default_factory=list)
    """Lines of the first row alone"""
    next: list[str] = field(default_factory=list)
    """Lines of all rows after the first"""
    always: list[str] = field(default_factory=list)


class Folds:
    """Writes reductions, and how their values follow from states."""

    def __init__(self, writer: ExpressionWriter) -> None:
        self.writer = writer
        self.rows: dict[str | None, Rows] = {None: Rows(section=writer.now, mask="m")}
        """Rows by connection; None: all"""
        self.held = Rows(section=writer.held, mask="m")
        self.values: dict[Call, str] = {}
        """the C of each: a number for each lane, NaN for none"""
        self.kept: dict[Call, int] = {}
        """the numbers of the calls of growth_share whose values are kept"""
        self.steps: dict[Call, int] = {}
        """the states that count them"""

    def add(self, call: Call) -> None:
        """Write a reduction; raises `UsageError` for an invalid argument, and for one that lanes cannot compute."""
        if call.function not in LANES:
            raise UsageError(f"{call.function}(…) is not computed in SIMD lanes; expected {', '.join(LANES)}")
        argument = call.arguments[0]
        connection = argument.connection if isinstance(argument, Sampled) else None
        node = argument.argument if isinstance(argument, Sampled) else argument
        if connection not in self.rows:
            self.rows[connection] = Rows(section=Section(f"s{len(self.rows)}_", self.writer.now), mask="some")
        rows = self.rows[connection]
        if connection is None and call.function != "growth_share" and self.writer.is_held(*call.arguments):
            rows = self.held  # at other rows it would be the same again
        if connection is None and self.writer.kinds(node) <= {"number"}:
            raise UsageError(f"{call.function} of a number; expected a signal")
        x = self.writer.value(node, "row", rows.section)
        self.values[call] = LANES[call.function](_Fold(self, rows, call, node, x, connection is not None))


@dataclass
class _Fold:
    """One reduction that is being written: a method for each function."""

    folds: Folds
    rows: Rows
    call: Call
    node: Node
    x: str
    """its argument at this row"""
    sampled: bool

    # -- states ----------------------------------------------------------------------------------------------------

    def _state(self, begin: float = 0.0) -> str:
        return self.folds.writer.state(begin)

    def _set(self, state: str, value: str, where: str = "") -> str:
        mask = f"({self.rows.mask} & {where})" if where else self.rows.mask
        return f"{state} = q_select({mask}, {value}, {state});"

    def _at(self, place: Moment) -> str:
        return self.folds.writer.value(self.node, place, self.folds.writer.step)

    @property
    def _moves(self) -> set[Kind]:
        return self.folds.writer.kinds(self.node) - {"number"}

    @property
    def _is_mixed(self) -> bool:
        """Whether its value just before a row is neither that of the row nor of the one before."""
        return not self.sampled and not (self._moves <= {"continuous"} or self._moves <= {"held"})

    # -- functions -------------------------------------------------------------------------------------------------

    def max(self) -> str:
        """The largest value, also just before a held signal changes."""
        return self._extreme("q_gt", -math.inf)

    def min(self) -> str:
        """The smallest value."""
        return self._extreme("q_lt", math.inf)

    def _extreme(self, sign: str, begin: float) -> str:
        state = self._state(begin)
        self.rows.always.append(f"doubtful |= {self.rows.mask} & q_isnan({self.x});")
        self.rows.always.append(self._set(state, self.x, f"{sign}({self.x}, {state})"))
        if self._is_mixed:
            end = self._at("end")
            self.rows.next.append(self._set(state, end, f"{sign}({end}, {state})"))
        return state

    def integral(self) -> str:
        """integral, and mean, rms and share by it; of a sampled signal the mean of its values."""
        total = self._state()
        if self.sampled:
            count = self._state()
            value = self._of_value(self.x, None)
            self.rows.always += [self._set(total, f"{total} + {value}"), self._set(count, f"{count} + q_all(1.0)")]
            if self.call.function == "integral":
                return _only_if(f"q_gt({count}, 0.0)", total)
            return self._rooted(f"{total} / {_only_if(f'q_gt({count}, 0.0)', count)}")
        self.folds.rows[None].next.append(f"{total} = {total} + {self._mean_of_step()} * dt;")
        if self.call.function == "integral":
            return total
        return self._rooted(f"{total} / {self.folds.writer.leaf(STOP_TIME).code}")

    def _mean_of_step(self) -> str:
        """The C of the mean over the step that ends at this row."""
        writer = self.folds.writer
        before = writer.before(self.node)
        start = self._of_value(before, self.node)
        if self.call.function == "share" or self._moves <= {"held"}:
            return start
        end = self._of_value(self._at("end"), self.node)
        if self._moves <= {"held", "line"} and not _has_time(self.node):
            middle = self._of_value(self._at("middle"), self.node)
            return f"(({start} + 4.0 * {middle} + {end}) / 6.0)"
        return f"(0.5 * ({start} + {end}))"

    def _of_value(self, x: str, node: Node | None) -> str:
        if self.call.function == "share":
            return f"TRUE(q_ne({x}, 0.0))"
        return f"({x} * {x})" if self.call.function == "rms" else x

    def _rooted(self, mean: str) -> str:
        return f"q_sqrt({mean})" if self.call.function == "rms" else mean

    def first(self) -> str:
        """The first value."""
        state = self._state(math.nan)
        if not self.sampled:
            self.rows.first.append(self._set(state, self.x))
            return state
        seen = self._state()
        where = f"q_eq({seen}, 0.0)"
        self.rows.always += [self._set(state, self.x, where), self._set(seen, "q_all(1.0)")]
        return _only_if(f"q_gt({seen}, 0.0)", state)

    def last(self) -> str:
        """The last value."""
        state = self._state(math.nan)
        self.rows.always.append(self._set(state, self.x))
        return state

    def peak_time(self) -> str:
        """The time of the first largest value."""
        best, time = self._state(-math.inf), self._state(math.nan)
        more = f"q_gt({self.x}, {best})"
        self.rows.always.append(f"doubtful |= {self.rows.mask} & q_isnan({self.x});")
        self.rows.always += [self._set(time, "t", more), self._set(best, self.x, more)]
        return time

    def settling_time(self) -> str:
        """The time from which |x| stays within the band."""
        since = self._state(-1.0)
        band = self.folds.writer.value(self.call.arguments[1], "row", self.rows.section)
        inside = f"q_le(q_fabs({self.x}), {band})"
        value = f"q_select({inside}, q_select(q_lt({since}, 0.0), t, {since}), q_all(-1.0))"
        self.rows.always.append(self._set(since, value))
        return _only_if(f"q_ge({since}, 0.0)", since)

    def total_variation(self) -> str:
        """The sum of the changes of x, including jumps."""
        total = self._state()
        if self.sampled:
            last = self._state(math.nan)
            step = f"q_fabs({self.x} - {last})"
            self.rows.always += [
                self._set(total, f"{total} + {step}", f"q_eq({last}, {last})"),
                self._set(last, self.x),
            ]
            return total
        if self.rows is self.folds.held:  # NaN would be kept although other rows have numbers
            self.rows.always.append(f"doubtful |= m & q_isnan({self.x} - {self.x});")
        before = self.folds.writer.before(self.node)
        step = f"q_fabs({self.x} - {before})"
        if self._is_mixed:
            end = self._at("end")
            step = f"(q_fabs({end} - {before}) + q_fabs({self.x} - {end}))"
        self.rows.next.append(self._set(total, f"{total} + {step}"))
        return total

    def growth_share(self) -> str:
        """The share of the steps between values that grow and end above the floor: the values are kept."""
        last, steps = self._state(math.nan), self._state(-1.0)
        number = self.folds.kept.setdefault(self.call, len(self.folds.kept))
        self.folds.steps[self.call] = len(self.folds.writer.states) - 1
        self.rows.always += [
            self._set(last, self.x), self._set(steps, f"{steps} + q_all(1.0)"),
            f"if (!keep(&b->kept[{number}], {last})) return 0;",
        ]  # fmt: skip
        return 'q_all(__builtin_nan(""))'  # its floor is known at the end of the run


LANES: Mapping[str, Callable[[_Fold], str]] = {
    "min": _Fold.min, "max": _Fold.max, "mean": _Fold.integral, "rms": _Fold.integral, "last": _Fold.last,
    "first": _Fold.first, "integral": _Fold.integral, "peak_time": _Fold.peak_time,
    "settling_time": _Fold.settling_time, "total_variation": _Fold.total_variation, "share": _Fold.integral,
    "growth_share": _Fold.growth_share,
}  # fmt: skip
"""The writers of reductions in C, by function: with one that is not here, runs are executed one at a time"""


def _only_if(condition: str, value: str) -> str:
    """The C of a value that there is only under a condition."""
    return f'q_select({condition}, {value}, q_all(__builtin_nan("")))'


def _has_time(node: Node) -> bool:
    if isinstance(node, Name):
        return node.text == "time"
    parts = getattr(node, "operands", getattr(node, "arguments", ()))
    return any(map(_has_time, parts))


def combined(
    nodes: Sequence[Node], known: Mapping[Call, Floats], numbers: Mapping[str, Floats], count: int
) -> list[tuple[Floats, Booleans]]:
    """The values of expressions in each of `count` runs, and the runs in which they have none.

    `known` are the values of the reductions in them, NaN for none; `numbers` are parameters and the stop time by name.
    """
    number_arrays: Any = numbers
    reduction_arrays: Any = known
    at_rows = SpanValues(
        Recorded(time=np.zeros(0), signals={}, numbers=number_arrays, stop_time=0.0), reduction_arrays
    ).at_rows
    unknown = {call: np.isnan(values) for call, values in known.items()}
    results = []
    with np.errstate(all="ignore"):
        for node in nodes:
            values: Floats = np.empty(count)
            values[:] = at_rows(node)
            none = np.zeros(count, dtype=np.bool_)
            for call in reductions(node):
                if call in unknown:
                    none |= unknown[call]
            results.append((values, none))
    return results
