"""The report of single runs, from their directories or from results."""

from collections.abc import Mapping, Sequence

import numpy as np

from orchestration.experiments.report.blobs import Blobs
from orchestration.experiments.report.model import Bars, Report, ReportRun, Setting
from orchestration.experiments.report.tracks import Tracks
from orchestration.foundation.basics.documents import tables_in
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import seconds
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results import quantities
from orchestration.simulation.runs.result import Result
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.system.component import flattened
from orchestration.systems.system.model import System

BYTES, BYTES_OF_ONE = 9_000_000, 700_000
"""Characters that the signals of all runs, and of one, may take"""
MAX_ROWS, MIN_ROWS = 6000, 200
"""Most and fewest rows of a run"""
MAX_RUNS = 200
MAX_PIECES = 20_000
"""Most pieces of the timeline of a computer or a network"""
SETTLING = "settling_time"
"""The objective that is the time at which a run settles, in systems that have it"""
_CODED = 4.0 * 4.0 / 3.0
"""Characters of a number"""


def runs_report(results: Mapping[str, Result], command: str) -> Report:
    """The report of runs by name; raises `UsageError` for more than `MAX_RUNS`."""
    if len(results) > MAX_RUNS:
        raise UsageError(f"{len(results)} runs: expected at most {MAX_RUNS}; a study holds more")
    blobs = Blobs()
    tracks = Tracks(blobs)
    columns = sum(len(result.columns) for result in results.values())
    rows = int(min(MAX_ROWS, max(MIN_ROWS, min(BYTES, BYTES_OF_ONE * len(results)) / _CODED / columns)))
    runs = [_run(name, result, tracks, blobs, rows) for name, result in results.items()]
    first = next(iter(results.values()))
    summaries = [_summary(name, result) for name, result in results.items()]
    return Report(
        kind="runs",
        title=next(iter(results)) if len(results) == 1 else f"{len(results)} runs",
        summary=summaries[0] if len(results) == 1 else "; ".join(summaries[:6]) + ("; …" if len(summaries) > 6 else ""),
        words=first.system.criterion.outcomes,
        layouts=tuple(tracks.layouts),
        runs=tuple(runs),
        blobs=blobs.blobs,
        units={
            key: shown
            for result in results.values()
            for key, unit in result.units.items()
            if (shown := labels.unit(unit))
        },
        labels={key: labels.metric(key) for result in results.values() for key in result.metrics},
        contents=(*_contents(results, rows),),
        warnings=tuple(f"{name}: {text}" for name, result in results.items() for text in result.warnings),
        provenance=tuple(provenance(results)),
        command=command,
    )


def _run(name: str, result: Result, tracks: Tracks, blobs: Blobs, rows: int) -> ReportRun:
    signals = dict(result.signals)
    return ReportRun(
        name=name,
        settings=_settings(result),
        metrics=result.metrics,
        message=result.divergence or result.termination,
        note=None if result.interrupted_at is None else f"interrupted at {result.interrupted_at:.6g} s",
        track=tracks.whole(result.system, signals, result.described, rows),
        bars=_bars(result.system, blobs),
    )


def _bars(system: System, blobs: Blobs) -> Bars | None:
    """The timeline of its computers and networks; at most `MAX_PIECES` pieces of each."""
    if not (system.computers or system.networks):
        return None
    timeline = timeline_of(system)
    rows: list[str] = []
    pieces = []
    for shared in (*timeline.processors.values(), *timeline.links.values()):
        places = np.arange(len(rows), len(rows) + len(shared.owners))
        rows += shared.owners
        part = slice(MAX_PIECES)
        pieces.append(
            np.column_stack([places[shared.owner[part]], seconds(shared.begin[part]), seconds(shared.end[part])])
        )
    row, begin, end = np.vstack(pieces).T
    return Bars(rows=tuple(rows), row=blobs.exact(row), begin=blobs.exact(begin), end=blobs.exact(end))


def _settings(result: Result) -> dict[str, Setting]:
    """The values of its file, by display name."""
    settings: dict[str, Setting] = {}
    for path, value in flattened(tables_in(result.request.to_toml())):
        if isinstance(value, float | int | bool | str):
            named = quantities.setting(path, [value])
            settings[named.title] = value if isinstance(value, int | str) else named.factor * value
    return settings


def _summary(name: str, result: Result) -> str:
    """The outcome of a run and its time."""
    metrics = result.metrics
    outcome = "no criterion" if metrics["outcome"] is None else str(metrics["outcome"])
    settled = metrics.get(SETTLING) if metrics["good"] else None
    if settled is not None:
        return f"{name}: {outcome} in {settled:.3g} s"
    ended = result.divergence is not None or result.termination is not None
    return f"{name}: {outcome} {'at' if ended else 'in a run of'} {result.end:.6g} s"


def _contents(results: Mapping[str, Result], rows: int) -> Sequence[str]:
    longest = max(len(result.recording) for result in results.values())
    if longest <= rows:
        return ["All recorded rows are in this file, as numbers of 32 bits."]
    stride = -(-longest // rows)
    return [
        f"Every {stride}th of the recorded rows is in this file, and those at which a signal is largest or smallest; "
        "the metrics are of all rows."
    ]


def provenance(results: Mapping[str, Result]) -> list[tuple[str, str]]:
    """Versions, platform, engine and GUIDs of FMUs; values that differ between runs with the names of their runs."""
    runs_by_fact: dict[tuple[str, str], list[str]] = {}
    for name, result in results.items():
        notes = result.provenance
        facts = [
            *notes.get("versions", {}).items(),
            *((key, notes[key]) for key in ("platform", "engine") if key in notes),
        ]
        facts += [
            (f"FMU of {component}", f"{fmu.get('model')} {fmu.get('guid')}")
            for component, fmu in notes.get("fmus", {}).items()
        ]
        for key, value in facts:
            runs_by_fact.setdefault((str(key), str(value)), []).append(name)
    return [
        (key, value if len(names) == len(results) else f"{value} ({', '.join(names)})")
        for (key, value), names in runs_by_fact.items()
    ]
