"""The sources of a report: directories of runs, one study or its store, two over one another, one comparison."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from orchestration.experiments.report import of_runs
from orchestration.experiments.report.model import Report
from orchestration.experiments.report.subset import Wanted
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.simulation.runs.flights import NOT_STORED, Flights
from orchestration.simulation.runs.result import Result
from orchestration.simulation.runs.run_directory import METRICS, load_run

EXPECTED = "the directory of a run, a study file or its store, or a comparison file"
STORE = "study.sqlite"
Kind = Literal["run", "store", "study", "comparison"]


@dataclass(frozen=True, kw_only=True)
class Source:
    """What a report is of."""

    kind: Kind
    what: Any
    """The path of a run or a store, or a `Study`, or a `Comparison`"""
    name: str
    """The name of its path, or its own"""
    store: Path | None = None
    """The folder of its store; None: `results/NAME`"""


def source_of(what: object, store: Path | None = None, out: Path | None = None) -> Source:
    """A study, a comparison, the result or the file of one, or its content, or the path of a run or a store.

    `store` is the folder of the store, by default `out` if it is there. Raises `UsageError` for anything else.
    """
    if isinstance(what, Flights):
        raise UsageError(f"report: runs of fly: {NOT_STORED}")
    path = Path(what) if isinstance(what, (str, os.PathLike)) else None
    kind = None if path is None else _kind(path)
    if path is not None and kind is not None and kind in ("run", "store"):
        if store is not None:
            raise UsageError("--store: expected a study file or a comparison file with it")
        return Source(kind=kind, what=path, name=path.resolve().stem)
    # reading studies and stores needs an extra
    from orchestration.experiments.comparison.design import Comparison
    from orchestration.experiments.comparison.file import load_comparison
    from orchestration.experiments.comparison.run import Compared
    from orchestration.experiments.studies.store import store_folder
    from orchestration.experiments.studies.study import Study
    from orchestration.experiments.studies.study_file import load_study
    from orchestration.experiments.studies.swept import Swept

    if isinstance(what, (Compared, Swept)):
        swept = what.summary if isinstance(what, Compared) else what
        what, store = what.comparison if isinstance(what, Compared) else what.study, swept.path.parent
    if not isinstance(what, (str, os.PathLike, Mapping, Study, Comparison)):
        raise UsageError(
            f"report: {shown(repr(what))}: expected a Result, a Study, a Comparison or what sweep or compare has "
            f"returned, or the path of a run, a study or a store"
        )
    loaded: Study | Comparison
    if kind == "comparison" or isinstance(what, Comparison) or (isinstance(what, Mapping) and "controllers" in what):
        kind, loaded = "comparison", load_comparison(what)  # type: ignore[arg-type]
    else:
        kind, loaded = "study", load_study(what)
    name = loaded.name if path is None else path.resolve().stem
    return Source(kind=kind, what=loaded, name=name, store=store_folder(loaded.name, store, out))


def report_of(what: Sequence[Source], command: str, wanted: Wanted) -> Report:
    """The report of runs, a study or a comparison, of which some runs are `wanted`; raises `UsageError` for others."""
    kinds = [each.kind for each in what]
    if len(what) > 1 and set(kinds) != {"run"} and not (len(what) == 2 and {*kinds} <= {"study", "store"}):
        listed = ", ".join(str(each.what) if isinstance(each.what, Path) else each.name for each in what)
        raise UsageError(f"{listed}: expected directories of runs, one or two studies, or one comparison alone")
    if kinds[0] == "run":
        if wanted.required or wanted.most is not None:
            raise UsageError("--run and --flights: expected a study or a comparison with them")
        return of_runs.runs_report(dict(_runs([each.what for each in what])), command)
    if kinds[0] == "comparison":
        from orchestration.experiments.report import of_comparison
        from orchestration.experiments.studies.store import store_path

        comparison = what[0].what
        return of_comparison.comparison_report(comparison, store_path(comparison.name, what[0].store), command, wanted)
    return _of_studies(what, command, wanted)


def _kind(path: Path) -> Kind:
    if path.is_dir():
        if (path / METRICS).is_file():
            return "run"
        if (path / STORE).is_file():
            return "store"
    elif path.suffix == ".sqlite" and path.is_file():
        return "store"
    elif path.suffix == ".toml" and path.is_file():
        return "comparison" if "controllers" in read_toml(path, "study or comparison file") else "study"
    raise UsageError(f"{path}: expected {EXPECTED}")


def _runs(paths: Sequence[Path]) -> Iterator[tuple[str, Result]]:
    """Runs by the name of their directory; by their path if that is not unique."""
    names = [path.resolve().name for path in paths]
    for path, name in zip(paths, names):
        yield (name if names.count(name) == 1 else str(path)), load_run(path)


def _of_studies(what: Sequence[Source], command: str, wanted: Wanted) -> Report:
    # reading stores needs an extra
    from orchestration.experiments.report import of_study
    from orchestration.experiments.studies.store import store_path
    from orchestration.experiments.studies.study import Study

    found: list[tuple[str, of_study.Stored, Study | None]] = []
    for each in what:
        if isinstance(each.what, Path):
            file = each.what / STORE if each.what.is_dir() else each.what
            found.append((file.resolve().parent.name, of_study.read(file), None))
        else:
            store = store_path(each.what.name, each.store)
            found.append((each.what.name, of_study.read(store, each.what), each.what))
    first, *others = found
    return of_study.study_report(*first, command, wanted, other=others[0] if others else None)
