"""The rows of a study as tables for analysis, and exports of studies and runs in the formats of other programs."""

import json
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import csv

from fmu_kit.new_files import new_files
from orchestration.experiments.studies import shares
from orchestration.experiments.studies.infinite_means import InfiniteMeans
from orchestration.experiments.studies.store import Store, open_for_reading
from orchestration.experiments.studies.store_columns import GUIDS, SETTINGS, TEXTS, UNITS, metrics_with
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import UsageError, expected_name
from orchestration.foundation.basics.terminal import inform
from orchestration.foundation.recording import mat_file
from orchestration.simulation.results.objectives import criterion_in_words
from orchestration.simulation.runs.run_directory import MAT, load_run

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

FORMATS = ("parquet", "csv", "mat")
TABLES = ("runs", "shares", "shares_*", "medians_*", "means_*", "differences", "differences_*")
"""Patterns of the names of the files that `export` writes"""

SHARED = (*TEXTS, "status", "machine", "engine")
"""Columns with few distinct texts"""


def frame(path: Path) -> "pd.DataFrame":
    """All rows sorted by design index: settings by axis, metrics, seed, status, duration, machine, GUIDs, versions."""
    import pandas as pd

    with open_for_reading(path) as opened:
        about = opened.about()
        if "axes" not in about:
            raise UsageError(f"{path}: expected the store of a study that has begun")
        axes = json.loads(about["axes"])
        settings_by_axis, columns = _columns(opened, axes)
    settings, table = pd.DataFrame(settings_by_axis, columns=axes), pd.DataFrame(columns)
    for name in ("diverged", "good"):
        table[name] = table[name].astype("boolean")
    for name in ("steps", "design_index", "seed"):
        table[name] = table[name].astype("Int64")
    settings = settings.drop(columns=[name for name in settings if name in table])  # only an axis of seeds can coincide
    table = pd.concat([table[["design_index"]], settings, table.drop(columns="design_index")], axis=1)
    for name, guid in json.loads(about[GUIDS]).items():
        table[f"guid.{name}"] = guid if isinstance(guid, str) else _guids_by_row(guid, settings_by_axis)
    for name, version in json.loads(about["versions"]).items():
        table[f"version.{name}"] = version
    return table


def _guids_by_row(guid: Mapping[str, Any], settings: Mapping[str, Sequence[Any]]) -> list[Any]:
    """The GUID of each row by the values of the axes that choose its FMU."""
    known = {tuple(values): one for values, one in guid["of"]}
    return [known.get(values) for values in zip(*(settings[axis] for axis in guid["axes"]))]


def rows_at(table: "pd.DataFrame", at: Mapping[str, Any]) -> "pd.DataFrame":
    """The rows with these values of some axes."""
    for name, value in at.items():
        table = table[table[name] == value]
    return table


def meaning_of(study: Study, metric: str, units: Mapping[str, str]) -> str:
    """What the outcome that cells count means, and by when; empty where an axis changes it.

    As "settled by 8 s: largest position error, last third < 0.05 m"; of a `metric` of `BOOLEAN` by when it is true.
    """
    system = study.origin
    if system.criterion.good is None or study.axes_of("stop_time") or study.axes_of("criterion.good"):
        return ""
    by = f"by {system.stop_time:g} s"
    if metric in shares.BOOLEAN and metric != shares.GOOD:
        return f"{metric} {by}"
    return f"{system.criterion.outcomes[0]} {by}: {criterion_in_words(system, units)}"


def _columns(store: Store, axes: Sequence[str]) -> tuple[dict[str, list[Any]], dict[str, Any]]:
    """The settings by axis and the other columns of a store's rows, read block by block."""
    settings: dict[str, list[Any]] = {name: [] for name in axes}
    blocks: dict[str, list[Any]] = {name: [] for name in store.columns}
    known: dict[Any, Any] = {}  # keeps one object per text
    for block in store.blocks():
        points = json.loads(f"[{','.join(block.pop(SETTINGS))}]")
        for name, values in settings.items():
            values += [point[name] for point in points]
        for name, column in block.items():
            if name in store.metrics and name not in TEXTS:
                blocks[name].append(np.array(column, dtype=float))
            else:
                blocks[name] += [known.setdefault(each, each) for each in column] if name in SHARED else column
    numeric = {name: np.concatenate(blocks[name] or [[]]) for name in store.metrics if name not in TEXTS}
    return settings, {**blocks, **numeric}


def dataset(path: Path) -> "xr.Dataset":
    """The metrics over the axes of a grid, with units as attributes; raises `UsageError` if some axis is sampled."""
    import xarray as xr

    with open_for_reading(path) as opened:
        grid, metrics = json.loads(opened.about()["grid"]), opened.metrics
    if grid is None:
        raise UsageError(f"{path}: expected a study whose axes all list their values, to make a grid of it")
    kept = [name for name in (*metrics, "seed", "duration") if name not in grid]
    table = frame(path).set_index(list(grid))[kept]
    table = table.astype({name: float for name in kept if name not in TEXTS})
    cube: xr.Dataset = xr.Dataset.from_dataframe(table).reindex(grid)
    for name, unit in units_in(path).items():
        if name in cube:
            cube[name].attrs["units"] = unit
    return cube


def units_in(path: Path) -> dict[str, str]:
    """The units of the axes and metrics in a store."""
    with open_for_reading(path) as opened:
        units: dict[str, str] = json.loads(opened.about().get(UNITS, "{}"))
    return {**units, "duration": "s"}


def _with_units(table: Any, units: Mapping[str, str]) -> Any:
    """A table with the units in the metadata of its fields."""
    fields = [f.with_metadata({"unit": units[f.name]}) if f.name in units else f for f in table.schema]
    return table.cast(pa.schema(fields, metadata=table.schema.metadata))


def export(
    path: Path,
    folder: Path,
    formats: Collection[str] = ("parquet", "csv"),
    study: Study | None = None,
    *,
    rows: "pd.DataFrame | None" = None,
    metric: str | None = None,
    average: str = shares.MEDIAN,
) -> list[Path]:
    """Write the rows by design index as `runs.parquet`, `runs.csv` or `runs.mat`; their paths.

    `rows` are those of the store with columns of the caller, if any.

    Of a `study` with cells also the share of good runs of each as `shares`, likewise, and of two laws those of the
    second minus those of the first, as `differences`; of a `metric` its medians, as `medians_METRIC`, and of two laws
    those of its differences in pairs, as `differences_METRIC`; or its means, as `means_METRIC` and
    `differences_mean_METRIC`; of one that is true or false, as `diverged`, its shares
    likewise, as `shares_METRIC`. Parquet has units in the metadata of its fields, as `unit`; MAT has a structure `runs`
    with a field for each column, and `units` with the same fields.
    """
    import pandas as pd

    rows = frame(path) if rows is None else rows
    tables, units = {"runs": rows}, units_in(path)
    if study is not None and study.cell_names is not None:
        cells, repeated = study.cell_names, shares.with_chance(rows, study, InfiniteMeans.in_store(path, study))
        laws = shares.laws_of(rows, cells)
        judged = (shares.GOOD,) if study.origin.criterion.good is not None else ()
        for name in dict.fromkeys((*judged, *filter(None, (metric,)))):
            end, is_share = "" if name == shares.GOOD else f"_{name}", name in shares.BOOLEAN
            unit = {} if is_share else {"unit": units.get(name, "")}
            kind = "shares" if is_share else f"{average}s"
            tables[f"{kind}{end}"] = shares.cells_of(repeated, cells, name, average).assign(**unit)
            if laws is not None:
                found = shares.differences_in(repeated, cells, laws, name, average).assign(**unit)
                of = "_mean" if kind == "means" else ""
                tables[f"differences{of}{end}"] = pd.DataFrame({"law": laws.second, "minus": laws.first, **found})
    written = []
    with new_files(folder) as new:
        for name, content in tables.items():
            table = _with_units(pa.Table.from_pandas(content, preserve_index=False), units)
            for kind in formats:
                _WRITERS[kind](table, new / f"{name}.{kind}")
                written.append(folder / f"{name}.{kind}")
    return written


def _write_mat(table: Any, file: Path) -> None:
    columns = {field.name: _column(table[field.name]) for field in table.schema}
    units = {f.name: (f.metadata or {}).get(b"unit", b"").decode() for f in table.schema}
    mat_file.write(file, {file.stem: mat_file.flat(columns), "units": mat_file.flat(units)})


_WRITERS = {"parquet": pq.write_table, "csv": csv.write_csv, "mat": _write_mat}


def _column(values: Any) -> Any:
    """The values for MATLAB: NaN for missing numbers, empty for missing texts."""
    if pa.types.is_string(values.type) or pa.types.is_large_string(values.type):
        return [text or "" for text in values.to_pylist()]
    return values.to_pandas().to_numpy(float, na_value=np.nan)


OF_RUNS = ("csv", "mat")


def of_run(folder: Path, out: Path, formats: Sequence[str]) -> list[Path]:
    """Write the signals and events of a run as CSV (default), or all of it as MAT; the paths.

    Raises `UsageError` for an unknown format, and for a folder that is not the directory of a run.
    """
    for kind in formats:
        hint = " (signals.parquet and events.parquet are there already)" if kind == "parquet" else ""
        _expect(kind, OF_RUNS, hint)
    result = load_run(folder)
    written = result.to_csv(out) if "csv" in formats or not formats else []
    return [*written, *([result.to_mat(out / MAT)] if "mat" in formats else [])]


def of_study(
    store: Path,
    formats: Sequence[str],
    study: Study | None = None,
    metric: str | None = None,
    *,
    out: Path | None = None,
    mean: bool = False,
) -> list[Path]:
    """Write the rows of a store to `out`, default: beside it, and as Parquet and CSV; the paths.

    Of a `study` with cells also the share of good runs of each, and the median or mean of a `metric`, with
    intervals.
    """
    for kind in formats:
        _expect(kind, FORMATS)
    if metric is not None:
        expect_metric_of_cells(study, metric)
    if mean:
        shares.expect_mean(metric, None if study is None else study.repeat)
    average = shares.MEAN if mean else shares.MEDIAN
    written = export(store, out or store.parent, formats or FORMATS[:2], study, metric=metric, average=average)
    if old := _older(written, store):
        inform(
            f"{', '.join(old)}: older than the store, of fewer runs or an earlier design; {written[0].parent} keeps "
            "them until an export with their --format and --metric writes them again"
        )
    return written


def _older(written: Sequence[Path], store: Path) -> list[str]:
    """The names of tables of a study beside those that are `written` that are older than its store."""
    found = {path for name in TABLES for kind in FORMATS for path in written[0].parent.glob(f"{name}.{kind}")}
    return sorted(path.name for path in found - {*written} if path.stat().st_mtime < store.stat().st_mtime)


def expect_metric_of_cells(study: Study | None, metric: str) -> None:
    """Raise `UsageError` for a metric that is a text, and for a study without cells."""
    if study is None or study.cell_names is None:
        raise UsageError(f"metric {metric}: {OF_CELLS}")
    known = [name for name in metrics_with(study.metric_names) if name not in TEXTS]
    if metric not in known:
        raise UsageError(f"metric {metric}: {expected_name(metric, known)}")


OF_CELLS = "expected a study file whose design.repeat has the name of the axis that repeats, as seed"


def _expect(kind: str, known: Sequence[str], hint: str = "") -> None:
    if kind not in known:
        raise UsageError(f"--format {kind}: expected {' or '.join(known)}{hint}")
