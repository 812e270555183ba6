"""The functions over a run, such as max and integral, as C that processes row after row: those of `reductions.py`.

The value of each is computed from its final states. A signal in continuous time alone has the same value just before a
row as at that row; a held signal has there the value of the row before.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.engines.batch.writing import ExpressionWriter, Kind, Moment, Section
from orchestration.systems.expressions.syntax import Call, Name, Node, Sampled

Value: TypeAlias = Callable[[Floats, Floats], Floats]
"""Computes a number for each lane, NaN for none, from states, shape (states, lanes), and end times, shape (lanes,)"""


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
        self.values: dict[Call, Value] = {}
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

    def _state(self, begin: float = 0.0) -> tuple[str, int]:
        name = self.folds.writer.state(begin)
        return name, len(self.folds.writer.states) - 1

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

    def max(self) -> Value:
        """The largest value, also just before a held signal changes."""
        return self._extreme("q_gt", -np.inf)

    def min(self) -> Value:
        """The smallest value."""
        return self._extreme("q_lt", np.inf)

    def _extreme(self, sign: str, begin: float) -> Value:
        state, i = self._state(begin)
        self.rows.always.append(f"doubtful |= {self.rows.mask} & q_isnan({self.x});")
        self.rows.always.append(self._set(state, self.x, f"{sign}({self.x}, {state})"))
        if self._is_mixed:
            end = self._at("end")
            self.rows.next.append(self._set(state, end, f"{sign}({end}, {state})"))
        return lambda states, end: states[i]

    def integral(self) -> Value:
        """integral, and mean, rms and share by it; of a sampled signal the mean of its values."""
        total, i = self._state()
        if self.sampled:
            count, j = self._state()
            value = self._of_value(self.x, None)
            self.rows.always += [self._set(total, f"{total} + {value}"), self._set(count, f"{count} + q_all(1.0)")]
            if self.call.function == "integral":
                return lambda states, end: np.where(states[j] > 0, states[i], np.nan)
            return self._rooted(lambda states, end: states[i] / np.where(states[j] > 0, states[j], np.nan))
        self.folds.rows[None].next.append(f"{total} = {total} + {self._mean_of_step()} * dt;")
        if self.call.function == "integral":
            return lambda states, end: states[i]
        return self._rooted(lambda states, end: states[i] / end)

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

    def _rooted(self, mean: Value) -> Value:
        return (lambda states, end: np.sqrt(mean(states, end))) if self.call.function == "rms" else mean

    def first(self) -> Value:
        """The first value."""
        state, i = self._state(np.nan)
        if not self.sampled:
            self.rows.first.append(self._set(state, self.x))
            return lambda states, end: states[i]
        seen, j = self._state()
        where = f"q_eq({seen}, 0.0)"
        self.rows.always += [self._set(state, self.x, where), self._set(seen, "q_all(1.0)")]
        return lambda states, end: np.where(states[j] > 0, states[i], np.nan)

    def last(self) -> Value:
        """The last value."""
        state, i = self._state(np.nan)
        self.rows.always.append(self._set(state, self.x))
        return lambda states, end: states[i]

    def peak_time(self) -> Value:
        """The time of the first largest value."""
        best, _ = self._state(-np.inf)
        time, i = self._state(np.nan)
        more = f"q_gt({self.x}, {best})"
        self.rows.always.append(f"doubtful |= {self.rows.mask} & q_isnan({self.x});")
        self.rows.always += [self._set(time, "t", more), self._set(best, self.x, more)]
        return lambda states, end: states[i]

    def settling_time(self) -> Value:
        """The time from which |x| stays within the band."""
        since, i = self._state(-1.0)
        band = self.folds.writer.value(self.call.arguments[1], "row", self.rows.section)
        inside = f"q_le(q_fabs({self.x}), {band})"
        value = f"q_select({inside}, q_select(q_lt({since}, 0.0), t, {since}), q_all(-1.0))"
        self.rows.always.append(self._set(since, value))
        return lambda states, end: np.where(states[i] < 0.0, np.nan, states[i])

    def total_variation(self) -> Value:
        """The sum of the changes of x, including jumps."""
        total, i = self._state()
        if self.sampled:
            last, _ = self._state(np.nan)
            step = f"q_fabs({self.x} - {last})"
            self.rows.always += [
                self._set(total, f"{total} + {step}", f"q_eq({last}, {last})"),
                self._set(last, self.x),
            ]
            return lambda states, end: states[i]
        if self.rows is self.folds.held:  # NaN would be kept although other rows have numbers
            self.rows.always.append(f"doubtful |= m & q_isnan({self.x} - {self.x});")
        before = self.folds.writer.before(self.node)
        step = f"q_fabs({self.x} - {before})"
        if self._is_mixed:
            end = self._at("end")
            step = f"(q_fabs({end} - {before}) + q_fabs({self.x} - {end}))"
        self.rows.next.append(self._set(total, f"{total} + {step}"))
        return lambda states, end: states[i]

    def growth_share(self) -> Value:
        """The share of the steps between values that grow and end above the floor: the values are kept."""
        last, _ = self._state(np.nan)
        steps, i = self._state(-1.0)
        number = self.folds.kept.setdefault(self.call, len(self.folds.kept))
        self.folds.steps[self.call] = i
        self.rows.always += [
            self._set(last, self.x), self._set(steps, f"{steps} + q_all(1.0)"),
            f"if (!keep(&b->kept[{number}], {last})) return 0;",
        ]  # fmt: skip
        return lambda states, end: np.full(len(end), np.nan)  # its floor is known at the end of the run


LANES: Mapping[str, Callable[[_Fold], Value]] = {
    "min": _Fold.min, "max": _Fold.max, "mean": _Fold.integral, "rms": _Fold.integral, "last": _Fold.last,
    "first": _Fold.first, "integral": _Fold.integral, "peak_time": _Fold.peak_time,
    "settling_time": _Fold.settling_time, "total_variation": _Fold.total_variation, "share": _Fold.integral,
    "growth_share": _Fold.growth_share,
}  # fmt: skip
"""The writers of reductions in C, by function: with one that is not here, runs are executed one at a time"""


def _has_time(node: Node) -> bool:
    if isinstance(node, Name):
        return node.text == "time"
    parts = getattr(node, "operands", getattr(node, "arguments", ()))
    return any(map(_has_time, parts))
