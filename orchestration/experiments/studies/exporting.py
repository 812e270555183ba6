"""Export of a study or a run in the formats of other programs, for `quadcosim export`."""

from collections.abc import Sequence
from pathlib import Path

from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.table import FORMATS, export
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.runs.run_directory import MAT, load_run

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


def of_study(store: Path, formats: Sequence[str], study: Study | None = None) -> list[Path]:
    """Write the rows of a store beside it, default: as Parquet and CSV; the paths.

    Of a `study` with cells also the share of good runs of each, with its interval.
    """
    for kind in formats:
        _expect(kind, FORMATS)
    return export(store, store.parent, formats or FORMATS[:2], study)


def _expect(kind: str, known: Sequence[str], hint: str = "") -> None:
    if kind not in known:
        raise UsageError(f"--format {kind}: expected {' or '.join(known)}{hint}")
