"""The results of many runs as arrays by name, and as the tables of pandas and xarray."""

import importlib.util
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestration.foundation.basics.errors import Named, UsageError, expected_name
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.statistics import Estimate, wilson
from orchestration.simulation.results.objectives import OUTCOME, how_runs_ended
from orchestration.simulation.runs.columns import RUN

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


NOT_STORED = (
    "keep no run to be written: expected a Result of run, or what sweep has returned of a Study; their numbers are "
    "written by to_pandas() or to_xarray()"
)


@dataclass(frozen=True, kw_only=True, repr=False)
class Flights(Mapping[str, Any]):
    """The results of many runs as arrays by name: `flights["position_rmse"]` has a value for each run."""

    arrays: Mapping[str, Any]
    """The arrays: of an output the shape that the given values have together, NaN where it has no value; `time` and
    what was recorded have one axis more, of the rows, NaN after the last row of a run that has fewer."""
    given: Mapping[str, Any]
    """The values that were given, by path, as arrays that broadcast to that shape."""
    recorded: tuple[str, ...]
    """The names of the arrays with rows."""
    shape: tuple[int, ...]
    """The shape that the given values have together, so that of the outputs."""
    engine: str
    """The engine of the runs: `batch`, which is SIMD lanes, `compiled` or `python`; the numbers are the same."""
    reason: str | None
    """Why they did not run in lanes, in a line; None: they did."""
    units: Mapping[str, str] = field(default_factory=dict)
    """The units of the outputs and of the given values that have one, by name, as FMI writes them (`N.m`)."""
    axes: Mapping[str, Any] = field(default_factory=dict)
    """The axes of that shape by name, with their labels or None, where the given values have such: the index of a
    table or of series of pandas (`run`), the dimensions of xarray."""

    def __getitem__(self, name: str) -> Any:
        """The array of a name."""
        return Named(self.arrays)[name]

    def __iter__(self) -> Iterator[str]:
        """Over the names."""
        return iter(self.arrays)

    def __len__(self) -> int:
        """The number of arrays."""
        return len(self.arrays)

    @property
    def verdict(self) -> str:
        """How many runs have ended in which way; without the output `outcome` only how many there are."""
        outcomes = Counter(np.asarray(self.arrays.get(OUTCOME, ())).ravel().tolist())
        return how_runs_ended(outcomes, int(np.prod(self.shape, dtype=int)))

    def share(self, name: str = "good", *, axis: Any = None, where: Any = True, confidence: float = 0.95) -> Estimate:
        """The share of runs of which an output is true, with Wilson's interval, over all axes, or over one or several.

        An axis is a number, or its name in `to_xarray`. Of a part of the axes, numbers are arrays over the others.
        `where` are truth values that choose runs. Raises `UsageError` for an output that is no truth value in each run,
        and where no run is chosen.
        """
        values, chosen = self[name], np.asarray(where)
        if values.dtype != np.bool_:
            raise UsageError(f"share of {name}: expected an output that is true or false in each run, as good")
        try:
            if chosen.dtype != np.bool_:
                raise ValueError("where are no truth values")
            chosen = np.broadcast_to(chosen, values.shape)
            places = self._places(axis)
            count, true = chosen.sum(axis=places), (values & chosen).sum(axis=places)
        except (TypeError, ValueError) as error:  # NumPy's error of an axis is a ValueError too
            raise UsageError(f"share of {name}: {error}; expected axes and truth values of {values.shape}") from None
        if not count.all():
            of = "" if count.ndim == 0 else f" at {np.count_nonzero(count == 0)} of {count.size} places"
            raise UsageError(
                f"share of {name}: where chooses no run{of}; expected one at least, of which to have a share"
            )
        bounds = [wilson(int(of), int(all_of), confidence) for of, all_of in zip(true.flat, count.flat)]
        low, high = (np.reshape(ends, count.shape) for ends in zip(*bounds))
        as_given: Any = np.asarray if count.shape else float
        return Estimate(value=as_given(true / count), low=as_given(low), high=as_given(high), confidence=confidence)

    def __repr__(self) -> str:
        return f"<Flights: {np.prod(self.shape, dtype=int)} runs by {self.engine}; {', '.join(self.arrays)}>"

    def _repr_html_(self) -> str:
        """The form that notebooks show: how the runs have ended, and the table of pandas if it is installed."""
        from orchestration.simulation.results import html

        has_pandas = importlib.util.find_spec("pandas") is not None
        facts = f"{self.verdict}; shape {self.shape}, by {self.engine}"
        return html.card("Runs", None, None, facts, ()) + (self.to_pandas().to_html(max_rows=10) if has_pandas else "")

    @explains_missing
    def to_pandas(self) -> "pd.DataFrame":
        """A row for each run, in the order of C: the values that were given, then the outputs.

        It has the index of the table or of the series that were given. Units are in its `attrs["units"]`, by column.
        Raises `QuadcosimError` where pandas is not installed.
        """
        import pandas as pd

        columns = {path: np.broadcast_to(each, self.shape) for path, each in self.given.items()} | self._outputs
        index = next(iter(self.axes.values()), None) if len(self.shape) == 1 else None
        table = pd.DataFrame({name: column.reshape(-1) for name, column in columns.items()}, index)
        table.attrs["units"] = dict(self.units)
        return table

    @explains_missing
    def to_xarray(self) -> "xr.Dataset":
        """The outputs and what was recorded, over the axes of the given values, as a Dataset with units.

        Axes are those of the given values of xarray. Else an axis along which alone a single path varies has its name
        and values; others are called `run`, or `axis_0` and so on. Rows have the dimension `time` if the runs have the
        same times, as far as they go, else `row`. Raises `QuadcosimError` where xarray is not installed.
        """
        import xarray as xr

        names, coordinates = self._axes()
        rows: tuple[str, ...] = ()
        variables = {name: (names, array) for name, array in self._outputs.items()}
        if self.recorded:
            time = self.arrays["time"].reshape(-1, self.arrays["time"].shape[-1])
            longest = time[np.isfinite(time[:, -1]).argmax()]
            is_common = bool(((time == longest) | np.isnan(time)).all())
            rows = (*names, "time" if is_common else "row")
            coordinates["time"] = ("time", longest) if is_common else (rows, self.arrays["time"])
            variables |= {name: (rows, self.arrays[name]) for name in self.recorded if name != "time"}
        dataset = xr.Dataset(variables, coordinates)
        for name, unit in self.units.items():
            dataset[name].attrs["units"] = unit
        return dataset

    @property
    def _outputs(self) -> dict[str, Any]:
        return {name: array for name, array in self.arrays.items() if name not in self.recorded}

    def _places(self, axis: Any) -> Any:
        """The number of an axis, or a tuple of those of several, of which some are given by name."""
        if isinstance(axis, tuple | list):
            return tuple(map(self._places, axis))
        if not isinstance(axis, str):
            return axis
        names = self._axes()[0]
        if axis not in names:
            raise UsageError(f"axis = {axis}: {expected_name(axis, names)}")
        return names.index(axis)

    def _axes(self) -> tuple[tuple[str, ...], dict[str, Any]]:
        """The names of the axes, and coordinates of the given values."""
        count = len(self.shape)
        along = {
            path: [axis + count - each.ndim for axis, length in enumerate(each.shape) if length > 1]
            for path, each in self.given.items()
        }
        names = [*self.axes] or ([RUN] if count == 1 else [f"axis_{axis}" for axis in range(count)])
        for axis in range(count):
            own = [path for path, axes in along.items() if axes == [axis]]
            if len(own) == 1 and names[axis] in (RUN, f"axis_{axis}"):
                names[axis] = own[0]
        coordinates: dict[str, Any] = {}
        for path, axes in along.items():
            values = self.given[path].reshape([self.shape[axis] for axis in axes])
            coordinates[path] = (tuple(names[axis] for axis in axes), values)
        for name, labels in self.axes.items():
            if name in names and labels is not None and labels.nlevels == 1:
                coordinates.setdefault(name, (name, labels))
        return tuple(names), coordinates
