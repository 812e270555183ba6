"""The axes of a study, their display names, the points that they span, and settings linked to their values."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, overload

import numpy as np

from orchestration.experiments.studies import sensitivity
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.records import Scalar, record
from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.simulation.figures import cells
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.quantities import Quantity, quantity, unit_known
from orchestration.systems.system.distribution import is_table
from orchestration.systems.system.requirements import is_number

Value = Scalar
Scale = Literal["linear", "logarithmic"]
Method = Literal["random", "latin-hypercube", "sobol", "morris", "saltelli"]
"""Sampling methods: the last two are for sensitivity (Morris screening, Sobol indices)"""
MAX_POINTS = 1_000_000
"""Largest number of runs of a study"""
CONTROLLER = frozenset({"controller", "controller.fmu", "components.controller.fmu"})
"""Targets that set the controller of the quadrotor, by name or path"""
OF_ONE_LAW = 'parameters of one of them stand under [controllers.NAME] of a vehicle file, vehicle = "FILE" under [base]'


_BY_NAME = ("axis.name",)


@record()
class Axis:
    """One quantity that a study varies.

    It takes `values` in turn, or is sampled between `low` and `high` together with all other sampled axes. Raises
    `UsageError` for invalid values.
    """

    name: str
    """The name of its column in the table of runs; default target."""
    targets: tuple[str, ...] = _BY_NAME
    """The paths that it sets: those of the system, for the quadrotor also `timing.KEY`, `controller.NAME`,
    `plant.NAME`; `seed`, `stop_time`."""
    multiplies: bool = False
    """Whether its values are factors on the targets' values in the base, instead of setting them."""
    values: tuple[Value, ...] | None = None
    """The values, in turn; None: it is sampled."""
    low: float = 0.0
    """The lower end of its range if sampled, in the unit of its targets."""
    high: float = 1.0
    """The upper end of that range."""
    scale: Scale = "linear"
    """Whether it is sampled uniformly, or uniformly in its logarithm."""

    def __post_init__(self) -> None:
        if self.targets == _BY_NAME:
            object.__setattr__(self, "targets", (self.name,))
        if self.values is not None and not self.values:
            raise UsageError(f"axis {self.name}: expected at least one value")
        of_scenario = CONTROLLER - {"components.controller.fmu"}
        if of_scenario & {*self.targets} and any(is_table(v) or not isinstance(v, str) for v in self.values or ()):
            raise UsageError(f"axis {self.name}: expected controllers by name or path; {OF_ONE_LAW}")
        if len({_kind(value) for value in self.values or ()}) > 1:
            given = ", ".join(repr(value) for value in {_kind(value): value for value in self.values or ()}.values())
            kinds = "expected values of one kind: numbers, texts, or true and false"
            raise UsageError(f"axis {self.name}: {kinds}; there are {given}")
        if self.values is None:
            _check_range(self.name, self.low, self.high, self.scale)

    @property
    def is_numeric(self) -> bool:
        """Whether its values are numbers, not names."""
        return self.values is None or all(map(is_number, self.values))

    def at(self, share: float) -> float:
        """The value at `share` in [0, 1] of the range."""
        if self.scale == "logarithmic":
            return math.exp(math.log(self.low) + share * math.log(self.high / self.low))
        return self.low + share * (self.high - self.low)

    def share(self, value: float) -> float | None:
        """The share of the range at which a value lies, in [0, 1] if within; None: on no logarithmic scale."""
        if self.scale == "logarithmic":
            return math.log(value / self.low) / math.log(self.high / self.low) if value > 0.0 else None
        return (value - self.low) / (self.high - self.low)

    def at_each(self, shares: Floats) -> list[Value]:
        """The values at many shares."""
        if self.scale == "logarithmic":  # NumPy's exponential function has other last bits
            return [self.at(share) for share in shares.tolist()]
        values: list[Value] = (self.low + shares * (self.high - self.low)).tolist()
        return values


def span(name: str, low: float, high: float, number: int, scale: Scale) -> tuple[float, ...]:
    """`number` values from `low` to `high`, in equal steps or equal ratios; the ends are exact."""
    _check_range(name, low, high, scale)
    if number < 2:
        raise UsageError(f"axis {name}: number = {number}, expected at least 2")
    if number > MAX_POINTS:
        raise UsageError(f"axis {name}: number = {number}, expected at most {MAX_POINTS}")
    axis = Axis(name=name, targets=(), low=low, high=high, scale=scale)
    # Twelve digits keep the steps of a decimal range decimal: 0.003 instead of 0.0030000000000000005.
    inner = [float(f"{axis.at(i / (number - 1)):.12g}") for i in range(1, number - 1)]
    return (low, *inner, high)


class Points(Sequence[dict[str, Value]]):
    """The design: every combination of the listed values, each with every sampled point, in that order.

    Each point is a dictionary of values by axis name, computed on access; the last listed axis varies fastest, but for
    the samples. Raises `UsageError` for a design of more than `MAX_POINTS`, before it is expanded.
    """

    def __init__(self, axes: Sequence[Axis], method: Method, samples: int, seed: int) -> None:
        self._axes = tuple(axes)
        self._sampled = [axis for axis in axes if axis.values is None]
        sizes = [len(axis.values) for axis in axes if axis.values is not None]
        self._draws = 1
        if self._sampled:
            if samples < 1:
                raise UsageError(f"design.samples = {samples}: expected at least 1 for sampled axes")
            self._draws = samples * sensitivity.runs_a_sample(method, len(self._sampled))
        self._number = math.prod(sizes) * self._draws
        if self._number > MAX_POINTS:
            factors = " x ".join(map(str, [*sizes, *([self._draws] if self._sampled else [])]))
            raise UsageError(f"{factors} = {self._number} runs: expected at most {MAX_POINTS}")
        if self._sampled:
            self._shares = unit_points(method, len(self._sampled), samples, seed)

    def __len__(self) -> int:
        return self._number

    @overload
    def __getitem__(self, index: int) -> dict[str, Value]: ...
    @overload
    def __getitem__(self, index: slice) -> list[dict[str, Value]]: ...
    def __getitem__(self, index: int | slice) -> dict[str, Value] | list[dict[str, Value]]:
        if isinstance(index, slice):
            return [self._point(i) for i in range(*index.indices(self._number))]
        return self._point(range(self._number)[index])

    def columns(self, indices: Integers) -> dict[str, list[Value]]:
        """The values of some points by axis: the same as of each point alone, to the bit."""
        rest, draw = np.divmod(indices, self._draws)
        columns: dict[str, list[Value]] = {}
        for axis in reversed(self._axes):
            if axis.values is not None:
                rest, place = np.divmod(rest, len(axis.values))
                columns[axis.name] = [axis.values[i] for i in place.tolist()]
        for column, axis in enumerate(self._sampled):
            columns[axis.name] = axis.at_each(self._shares[draw, column])
        return {axis.name: columns[axis.name] for axis in self._axes}

    def _point(self, index: int) -> dict[str, Value]:
        rest, draw = divmod(index, self._draws)
        point: dict[str, Value] = {}
        for axis in reversed(self._axes):
            if axis.values is not None:
                rest, place = divmod(rest, len(axis.values))
                point[axis.name] = axis.values[place]
        for axis, share in zip(self._sampled, self._shares[draw] if self._sampled else ()):
            point[axis.name] = axis.at(float(share))
        return {axis.name: point[axis.name] for axis in self._axes}


def unit_points(method: Method, dimension: int, samples: int, seed: int) -> Floats:
    """Points of the unit cube, shape (n, dimension); n is `samples` except for the sensitivity designs."""
    if method in ("morris", "saltelli"):
        return sensitivity.shares(method, dimension, samples, seed)
    generator = np.random.default_rng(seed)
    if method == "random":
        return generator.random((samples, dimension))
    from scipy.stats import qmc

    if method == "latin-hypercube":
        return np.asarray(qmc.LatinHypercube(dimension, rng=generator).random(samples))
    exponent = round(math.log2(samples))
    if 2**exponent != samples:
        raise UsageError(f"design.samples = {samples}: expected a power of two for a Sobol sequence")
    return np.asarray(qmc.Sobol(dimension, rng=generator).random_base2(exponent))


def _kind(value: Value) -> str:
    return "truth" if isinstance(value, bool) else "text" if isinstance(value, str) else "number"


def _check_range(name: str, low: float, high: float, scale: Scale) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise UsageError(f"axis {name}: start = {low}, stop = {high}, expected finite numbers with start < stop")
    if scale == "logarithmic" and low <= 0.0:
        raise UsageError(f"axis {name}: start = {low}, expected a positive number on a logarithmic scale")


Key = tuple[Value, ...]


@dataclass(frozen=True, kw_only=True)
class LinkedSettings:
    """Targets that the values of one or several axes set together."""

    axes: tuple[str, ...]
    sets: Mapping[Key, Mapping[str, Value]] = field(default_factory=dict)
    """values by target, by the values of the axes; values without an entry set nothing"""
    multiplies: Mapping[Key, Mapping[str, float]] = field(default_factory=dict)
    """likewise factors on the targets' values so far, or in the base"""

    @property
    def targets(self) -> Iterator[str]:
        """All targets that it sets or multiplies."""
        for table in (self.sets, self.multiplies):
            for changes in table.values():
                yield from changes

    def of(self, point: Mapping[str, Value]) -> tuple[Mapping[str, Value], Mapping[str, float]]:
        """The values and the factors by target at a point of the design."""
        key = tuple(point[name] for name in self.axes)
        return self.sets.get(key, {}), self.multiplies.get(key, {})

    def as_lists(self) -> list[Any]:
        """The content in JSON types."""
        return [[[*key, dict(changes)] for key, changes in table.items()] for table in (self.sets, self.multiplies)]


SCALES = {"linear": "linear", "logarithmic": "log"}
"""Names of scales in matplotlib"""


def quantity_of(axis: Axis, units: Mapping[str, str]) -> Quantity:
    """The quantity of an axis, with its display name and its unit in the store; a factor has no unit."""
    unit = None
    if axis.targets and not axis.multiplies:
        known = {unit for target in axis.targets if (unit := unit_known(target)) is not None}  # all have one value
        unit = units.get(axis.name) or (known.pop() if len(known) == 1 else None)
    return quantity(name_of(axis), unit, (axis.low, axis.high) if axis.values is None else axis.values)


def name_of(axis: Axis) -> str:
    """The display name of an axis: its own name, or that of its target if it is named by its path."""
    return labels.setting(axis.name) if axis.name in axis.targets else labels.words(axis.name)


def names_of(values: Iterable[Value]) -> dict[Value, str]:
    """The display names of values: of paths the last parts, if these differ."""
    listed = list(dict.fromkeys(values))
    short = [str(value).rpartition("/")[2] for value in listed]
    return dict(zip(listed, short if len({*short}) == len(short) else map(str, listed)))


def picked(axes: Sequence[Axis], texts: Sequence[str]) -> dict[str, Value]:
    """The values of axes in texts such as `delay=0.02`; raises `UsageError` for one that a study does not list."""
    listed = {axis.name: axis.values for axis in axes if axis.values is not None}
    found: dict[str, Value] = {}
    for text in texts:
        name, _, wanted = text.partition("=")
        if name not in listed or name in found:
            raise UsageError(
                f"--at {text}: expected NAME=VALUE, once for each NAME of {', '.join(listed) or 'no axis'}"
            )
        same = [value for value in listed[name] if _is_written(value, wanted)]
        if not same:
            raise UsageError(f"--at {text}: expected one of {', '.join(map(shown, listed[name]))}")
        found[name] = same[0]
    return found


def _is_written(value: Value, text: str) -> bool:
    if isinstance(value, (bool, str)):
        return text in (str(value), str(value).lower(), str(value).rpartition("/")[2])
    try:
        return math.isclose(value, float(text), rel_tol=1e-9)
    except ValueError:
        return False


def edges(axis: Axis, values: Floats) -> Floats:
    """The edges of the cells around the values of an axis."""
    return cells.edges(np.unique(values), logarithmic=axis.scale == "logarithmic")


def place_of(axes: Iterable[Axis], at: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """The values of some axes in words, as "delay 20 ms, loss 0.1"."""
    known = {axis.name: quantity_of(axis, units) for axis in axes if axis.name in at}
    return ", ".join(f"{known[k].name} {known[k].text_of(v) if is_number(v) else v}" for k, v in at.items())
