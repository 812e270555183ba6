"""Numbers that vary: their distribution, or the trace that they are taken from; in a file, a table in place of one."""

import dataclasses
import functools
import json
import math
from collections.abc import Hashable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard

from orchestration.foundation.basics.documents import toml_of
from orchestration.foundation.basics.records import record
from orchestration.systems.system.choices import TraceOrder
from orchestration.systems.system.requirements import is_finite, require, require_loss

if TYPE_CHECKING:
    from orchestration.foundation.basics.simulator import Floats

MIN_INSIDE = 1e-6
"""The least share of a normal distribution within its range: with less, digits are lost"""


@record()
class Distribution:
    """A number that varies: drawn from a distribution or from a measured trace, or a trace in its order.

    Exactly one of `uniform`, `normal`, `values` and `file` is given. No value is below 0; times are in seconds.
    """

    uniform: tuple[float, float] | None = None
    """The least and the largest value, between which all are equally likely."""
    normal: tuple[float, float] | None = None
    """The mean and the standard deviation of a normal distribution, which is cut to `range`."""
    range: tuple[float, float] | None = None
    """The least and the largest value of the normal distribution."""
    values: tuple[float, ...] | None = None
    """The possible values."""
    probabilities: tuple[float, ...] | None = None
    """The probability of each of the values; default: all are equally likely."""
    file: Path | None = None
    """The path of a CSV file with a trace; in a file, relative to its folder."""
    column: str | None = None
    """The column of the file that holds the values."""
    order: TraceOrder = "drawn"
    """Whether a row is drawn each time, all equally likely (drawn), or the rows are used in order, beginning anew after
    the last (as recorded)."""

    @property
    def lowest(self) -> float:
        """The least value; raises `UsageError` for a file that cannot be read."""
        span = self.uniform or self.range
        return span[0] if span is not None else float(self.table().min())

    @property
    def highest(self) -> float:
        """The largest value, likewise."""
        span = self.uniform or self.range
        return span[1] if span is not None else float(self.table().max())

    @property
    def mean(self) -> float:
        """The mean value, likewise."""
        if self.uniform is not None:
            return sum(self.uniform) / 2.0
        if self.normal is not None and self.range is not None:
            (mean, deviation), (low, high) = self.normal, self.range
            density = [math.exp(-(((end - mean) / deviation) ** 2) / 2.0) for end in (low, high)]
            inside = self.share(high) - self.share(low)
            return mean + deviation * (density[0] - density[1]) / (math.sqrt(2.0 * math.pi) * inside)
        values = self.table()
        return float(values.mean() if self.probabilities is None else values @ self.probabilities)

    @property
    def is_random(self) -> bool:
        """Whether the seed changes the values, likewise."""
        return self.order == "drawn" and self.lowest < self.highest

    def table(self) -> "Floats":
        """The possible values of a discrete distribution.

        Raises `UsageError` for a file that cannot be read, or holds a value below 0.
        """
        if self.file is not None and self.column is not None:
            return _column(self.file, self.column, _state(self.file))
        import numpy as np  # not needed to read a system

        return np.array(self.values, dtype=np.float64)

    def share(self, value: float) -> float:
        """The share of the normal distribution below a value."""
        assert self.normal is not None
        mean, deviation = self.normal
        return math.erfc((mean - value) / (deviation * math.sqrt(2.0))) / 2.0

    def __post_init__(self) -> None:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        require(len(given) == 1, "distribution", " and ".join(given) or "nothing", f"one of {', '.join(KINDS)}")
        for belonging, kind in (("range", "normal"), ("probabilities", "values"), ("column", "file")):
            if kind not in given:
                value = getattr(self, belonging)
                require(value is None, belonging, value, f"none without {kind}")
        require(self.order == "drawn" or self.file is not None, "order", self.order, "none without file")
        if self.uniform is not None:
            _require_span("uniform", self.uniform)
        if self.normal is not None:
            self._expect_normal()
        if self.values is not None:
            self._expect_values()
        require(self.file is None or self.column is not None, "column", "none", "the name of a column of the file")

    def _expect_normal(self) -> None:
        assert self.normal is not None
        mean, deviation = self.normal
        require(is_finite(mean), "normal", list(self.normal), "a mean and a deviation")
        require(is_finite(deviation) and deviation > 0.0, "normal", list(self.normal), "a positive deviation")
        require(self.range is not None, "range", "none", "the least and the largest value of a normal distribution")
        assert self.range is not None
        _require_span("range", self.range)
        inside = self.share(self.range[1]) - self.share(self.range[0])
        require(inside >= MIN_INSIDE, "range", list(self.range), f"one that has {MIN_INSIDE:g} of it or more inside")

    def _expect_values(self) -> None:
        assert self.values is not None
        require(len(self.values) > 0, "values", "none", "at least one")
        for value in self.values:
            require(is_finite(value) and value >= 0.0, "values", value, "zero or positive numbers")
        if self.probabilities is None:
            return
        count = len(self.values)
        require(len(self.probabilities) == count, "probabilities", len(self.probabilities), f"{count}, one a value")
        for share in self.probabilities:
            require(is_finite(share) and 0.0 <= share <= 1.0, "probabilities", share, "probabilities in [0, 1]")
        total = math.fsum(self.probabilities)
        require(abs(total - 1.0) <= 1e-9, "probabilities", total, "a sum of 1")


KINDS = ("uniform", "normal", "values", "file")

Varying: TypeAlias = float | Distribution
"""A number, or its distribution"""
AS_TABLE = "as {uniform = [0.001, 0.004]}"


def lowest(of: Varying) -> float:
    """The least value."""
    return of.lowest if isinstance(of, Distribution) else of


def highest(of: Varying) -> float:
    """The largest value."""
    return of.highest if isinstance(of, Distribution) else of


def mean(of: Varying) -> float:
    """The mean value."""
    return of.mean if isinstance(of, Distribution) else of


def is_random(of: Varying) -> bool:
    """Whether the seed changes it."""
    return isinstance(of, Distribution) and of.is_random


def spreads(of: Varying) -> bool:
    """As `is_random`, for a number that is the largest value or a probability."""
    return of.is_random if isinstance(of, Distribution) else of > 0.0


def content(of: Varying) -> Hashable:
    """A key of the values: the number or distribution, with the state of its file."""
    return (of, None if of.file is None else _state(of.file)) if isinstance(of, Distribution) else of


def require_varying(of: object, *names: str, place: str = "") -> None:
    """Require the fields `names` to be finite numbers from 0 on, or distributions."""
    for name in names:
        value = getattr(of, name)
        fits = isinstance(value, Distribution) or (is_finite(value) and value >= 0.0)
        require(
            fits,
            place + name,
            value,
            f"zero or a positive number, or a table that says how it is distributed, {AS_TABLE}",
        )


def reads_file(of: Varying) -> bool:
    """Whether its values are known only when a file is read."""
    return isinstance(of, Distribution) and of.file is not None


def require_spread(spread: str, *jitters: Varying, place: str = "") -> None:
    """Require the distribution of a lateness to be given once: as such, or by `spread` beside its largest value."""
    fits = spread == "uniform" or not any(isinstance(jitter, Distribution) for jitter in jitters)
    require(fits, f"{place}jitter_distribution", spread, "none beside a jitter that says its distribution itself")


def require_losses(of: object, burst_length: float | None, *names: str, place: str = "") -> None:
    """Require the fields `names` to be probabilities that allow such bursts, or distributions over 0 and 1."""
    for name in names:
        losses = getattr(of, name)
        if not isinstance(losses, Distribution):
            require_loss(of, name, burst_length, place)
            continue
        is_table = losses.values is not None or losses.file is not None
        require(is_table, place + name, "a formula", "a probability, or values or a file of 0 and 1")
        none = "none beside a loss that is no probability"
        require(burst_length is None, f"{place}burst_length", burst_length, none)
        for value in losses.values or ():
            require(value in (0.0, 1.0), f"{place}{name}.values", value, "0 or 1")


def _require_span(name: str, span: tuple[float, float]) -> None:
    first, last = span
    fits = is_finite(first) and is_finite(last) and 0.0 <= first <= last
    require(fits, name, list(span), "two numbers from 0 on, the least and the largest")


def _state(path: Path) -> tuple[int, int] | None:
    """A key that changes when a file is written anew: its time and size."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None  # reading it reports the reason
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=64)
def _column(path: Path, column: str, state: tuple[int, int] | None) -> "Floats":
    from orchestration.systems.signals.table_file import read_rows

    rows = read_rows(path, (column,))
    values = rows.columns[column]
    if (values < 0.0).any():
        raise rows.error(int((values < 0.0).argmax()), column, "zero or positive numbers")
    return values


def parsed_fields(of: Any, place: str, keys: Mapping[str, Any]) -> dict[str, Any]:
    """New values of fields of a record, with distributions in place of their tables, or of the text of these.

    Relative paths of traces start at the current folder. Raises `UsageError` for an invalid table.
    """
    kind: type = type(of)
    varying = may_vary(kind)
    return {key: _parsed_field(f"{place}{key}", value) if key in varying else value for key, value in keys.items()}


@functools.cache
def may_vary(kind: type) -> frozenset[str]:
    """The fields of a record that are a number or a distribution."""
    return frozenset(field.name for field in dataclasses.fields(kind) if field.type == Varying)


def is_table(value: object) -> TypeGuard[str]:
    """Whether a value is the text of a table."""
    return isinstance(value, str) and value.lstrip().startswith("{")


def as_text(table: Mapping[str, Any]) -> str:
    """The text of a table of a file."""
    return f"{{{', '.join(f'{key} = {json.dumps(value, default=str)}' for key, value in table.items())}}}"


def from_folder(value: str, folder: Path) -> str:
    """The text of a table, its trace by a path from the current folder, in place of one from another."""
    path = trace_path(value)
    table = toml_of(f"value = {value}", value)["value"]
    return value if path is None else as_text({**table, "file": str(folder / path)})


def trace_path(value: str) -> str | None:
    """The path of the trace in the text of a table; None without one."""
    file = toml_of(f"value = {value}", value)["value"].get("file")
    return None if file is None else str(Path(file))


def _parsed_field(place: str, value: Any) -> Any:
    if is_table(value):
        value = toml_of(f"value = {value}", f"{place} = {value}")["value"]
    if not isinstance(value, Mapping):
        return value
    from orchestration.systems.system.file import parsed_distribution  # not before: it loads what reads files

    return parsed_distribution(place, value)
