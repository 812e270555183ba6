"""The sources of a report: directories of runs, one study or its store, two over one another, one comparison."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from orchestration.experiments.report import of_runs
from orchestration.experiments.report.model import Report
from orchestration.experiments.report.subset import Wanted
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.runs.result import Result
from orchestration.simulation.runs.run_directory import METRICS, load_run

EXPECTED = "the directory of a run, a study file or its store, or a comparison file"
STORE = "study.sqlite"


def report_of(
    what: Sequence[Path],
    command: str,
    wanted: Wanted,
    *,
    store: Path | None = None,
) -> Report:
    """The report of the runs, study or comparison at these paths; raises `UsageError` for anything else.

    `store` is the folder of the store of a study or a comparison, default `results/NAME`, whose runs are `wanted`.
    """
    if not what:
        raise UsageError(f"expected {EXPECTED}")
    kinds = [_kind(path) for path in what]
    if len(what) > 1 and set(kinds) != {"run"} and not (len(what) == 2 and {*kinds} <= {"study", "store"}):
        listed = ", ".join(map(str, what))
        raise UsageError(f"{listed}: expected directories of runs, one or two studies, or one comparison alone")
    if kinds[0] == "run":
        if wanted.required or wanted.most is not None:
            raise UsageError("--run and --flights: expected a study or a comparison with them")
        return of_runs.runs_report(dict(_runs(what)), command)
    if kinds[0] == "comparison":
        return _of_comparison(what[0], command, wanted, store)
    return _of_studies(what, kinds, command, wanted, store)


def _kind(path: Path) -> str:
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


def _of_studies(
    paths: Sequence[Path], kinds: Sequence[str], command: str, wanted: Wanted, store: Path | None
) -> Report:
    # reading stores needs an extra
    from orchestration.experiments.report import of_study
    from orchestration.experiments.studies.store import store_path
    from orchestration.experiments.studies.study import Study
    from orchestration.experiments.studies.study_file import load_study

    found: list[tuple[str, of_study.Stored, Study | None]] = []
    for path, kind in zip(paths, kinds):
        if kind == "store":
            file = path / STORE if path.is_dir() else path
            found.append((file.resolve().parent.name, of_study.read(file), None))
        else:
            study = load_study(path)
            folder = store if path is paths[0] else None
            found.append((study.name, of_study.read(store_path(study.name, folder), study), study))
    first, *others = found
    return of_study.study_report(*first, command, wanted, other=others[0] if others else None)


def _of_comparison(path: Path, command: str, wanted: Wanted, store: Path | None) -> Report:
    from orchestration.experiments.comparison.file import load_comparison
    from orchestration.experiments.report import of_comparison
    from orchestration.experiments.studies.store import store_path

    comparison = load_comparison(path)
    return of_comparison.comparison_report(comparison, store_path(comparison.name, store), command, wanted)
