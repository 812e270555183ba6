"""The report of a study: its store, and flights of some of its runs."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.report.blobs import Blobs
from orchestration.report.flights import Flight, Progress, fastest, fly
from orchestration.report.model import Report, Run, Setting, Share
from orchestration.report.number_format import percent
from orchestration.report.subset import ALONE, MOST, chosen, points_for
from orchestration.report.tables import ColumnAxis, Row, is_good, share_of, shares_along, table_of
from orchestration.report.tracks import Tracks
from orchestration.results import display_names as labels
from orchestration.results.column_info import column_infos
from orchestration.results.criterion import judged
from orchestration.results.quantities import quantity
from orchestration.studies.axis_labels import quantity_of
from orchestration.studies.shown_first import shown_first
from orchestration.studies.store import FIXED, TEXTS, UNITS, open_for_reading
from orchestration.studies.study import Study
from orchestration.studies.sweep import AGREEMENT, expect_current
from orchestration.system.criterion import DIVERGED, TERMINATED
from orchestration.workers.batching import Agreement

AGREES = 1e-6
"""Relative difference of the metric that is drawn first, up to which a flight flown again is the one in the store"""

Choose = Callable[[int], Sequence[int]]
"""Picks at most so many runs, by their indices in the design"""
COLUMNS = 24
"""About as many of them a track has, its time counted twice"""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """What is in a store."""

    rows: Sequence[Row]
    metrics: Sequence[str]
    units: Mapping[str, str]
    about: Mapping[str, str]


def read(path: Path, study: Study | None = None) -> Stored:
    """All of a store; raises `UsageError` for one that has no runs, or is not of `study`."""
    with open_for_reading(path) as opened:
        if study is not None:
            expect_current(opened, study)
        about, rows = opened.about(), list(opened.rows())
        metrics = [name for name in opened.metrics if name not in TEXTS]
    if not rows or "axes" not in about:
        raise UsageError(f"{path}: expected the store of a study that has begun; quadcosim sweep flies it")
    units: dict[str, str] = json.loads(about.get(UNITS, "{}"))
    return Stored(rows=rows, metrics=metrics, units=units, about=about)


@dataclass(frozen=True, kw_only=True)
class Embedded:
    """The runs whose signals are in a report."""

    runs: Sequence[Run]
    places: Mapping[int, int]
    """in `runs`, by index in the design"""
    contents: Sequence[str]


def report_of(
    name: str,
    stored: Stored,
    study: Study | None,
    command: str,
    *,
    wanted: Sequence[int] = (),
    most: int | None = None,
    progress: Progress | None = None,
    axes: Sequence[ColumnAxis] | None = None,
    choose: Choose | None = None,
) -> Report:
    """The report of a store; of a `study` that is known, runs are flown again for their signals.

    `wanted` are runs that are among them in any case, `most` is how many, which `choose` picks. `axes` are
    those of the study if none are given. Raises `UsageError` for a run that the study does not have.
    """
    blobs = Blobs()
    tracks = Tracks(blobs)
    axes = axes_of(stored, study) if axes is None else axes
    metric = metric_of(stored, study)
    indices = [row["design_index"] for row in stored.rows if row["status"] == "done"]
    embedded = embed(
        study, stored, indices, tracks, wanted=wanted, most=most, metric=metric, progress=progress, choose=choose
    )
    by_chance = is_sample(stored, study)
    overall = share_of("all runs", None, stored.rows, by_chance=by_chance)
    words = words_of(stored, study)
    return Report(
        kind="study",
        title=name,
        summary=summary_of(overall, words, stored),
        words=words,
        layouts=tuple(tracks.layouts),
        runs=tuple(embedded.runs),
        table=table_of(
            stored.rows, axes, stored.metrics, stored.units, blobs,
            tracks=embedded.places, messages=messages_of(stored.rows, embedded.places),
            is_grid=json.loads(stored.about.get("grid", "null")) is not None,
        ),
        blobs=blobs.blobs,
        units={name: shown for name, unit in stored.units.items() if (shown := labels.unit(unit))},
        labels={key: labels.metric(key) for key in stored.metrics},
        metric=metric,
        overall=overall,
        shares=tuple(
            found for axis in axes if (found := shares_along(stored.rows, axis, by_chance=by_chance)) is not None
        ),
        contents=tuple(embedded.contents),
        provenance=tuple(provenance_of(stored.about)),
        command=command,
    )  # fmt: skip


def axes_of(stored: Stored, study: Study | None) -> list[ColumnAxis]:
    """The axes, with the units of the store, and with scales where the study is known."""
    if study is None:
        return [
            ColumnAxis(name=name, quantity=quantity(labels.words(name), stored.units.get(name), _values(stored, name)))
            for name in json.loads(stored.about["axes"])
        ]
    return [
        ColumnAxis(name=axis.name, quantity=quantity_of(axis, stored.units), logarithmic=axis.scale == "logarithmic")
        for axis in study.axes
    ]


def _values(stored: Stored, axis: str) -> list[Any]:
    return [row["settings"][axis] for row in stored.rows]


def metric_of(stored: Stored, study: Study | None) -> str:
    """What is drawn first, as in figures of the study."""

    def values(name: str) -> Floats:
        return np.array([float(row[name]) for row in stored.rows if is_good(row) and row[name] is not None])

    preferred = None if study is None else judged(study.origin)
    return shown_first((name for name in stored.metrics if name not in FIXED), values, preferred)


def words_of(stored: Stored, study: Study | None) -> tuple[str, str]:
    """What a good run is called, and one that is not."""
    if study is not None:
        return study.origin.criterion.outcomes
    good = next((str(row["outcome"]) for row in stored.rows if row["good"] == 1), "good")
    others = (str(row["outcome"]) for row in stored.rows if row["good"] == 0)
    bad = next((outcome for outcome in others if outcome not in (DIVERGED, TERMINATED)), "bad")
    return good, bad


def is_sample(stored: Stored, study: Study | None) -> bool:
    """Whether runs are drawn from what may happen, so that a share of them has an interval; a grid is chosen."""
    if study is None:
        return json.loads(stored.about.get("grid", "null")) is None
    drawn = any(axis.values is None or "seed" in axis.targets for axis in study.axes)
    return drawn or study.vary_seed


def summary_of(overall: Share, words: tuple[str, str], stored: Stored) -> str:
    """One sentence."""
    total = int(stored.about.get("total", overall.runs))
    flown = f"{overall.runs} runs" if total == overall.runs else f"{overall.runs} of {total} runs are flown so far"
    said = f"{flown}: {overall.good} {words[0]} ({percent(overall.good / overall.runs)}"
    if overall.low is not None and overall.high is not None:
        said += f", 95 % interval {percent(overall.low)} to {percent(overall.high)}"
    outcomes = Counter(row["outcome"] for row in stored.rows)
    failed = sum(row["status"] == "failed" for row in stored.rows)
    said += f"), {outcomes[DIVERGED]} diverged"
    said += f", {outcomes[TERMINATED]} terminated" if outcomes[TERMINATED] else ""
    return said + (f", {failed} failed" if failed else "") + "."


def messages_of(rows: Sequence[Row], places: Mapping[int, int]) -> dict[int, str]:
    """Why runs failed; of those whose signals are there also what diverged."""
    return {
        row["design_index"]: row["message"]
        for row in rows
        if row["message"] is not None and (row["status"] == "failed" or row["design_index"] in places)
    }


def embed(
    study: Study | None,
    stored: Stored,
    indices: Sequence[int],
    tracks: Tracks,
    *,
    wanted: Sequence[int],
    most: int | None,
    metric: str,
    progress: Progress | None,
    choose: Choose | None,
) -> Embedded:
    """Fly some of the runs with these indices again, and keep what the page needs of them."""
    known = {row["design_index"]: row for row in stored.rows}
    for index in wanted:
        if index not in known:
            raise UsageError(f"--run {index}: expected the number of a run that is in the store")
    if study is None:
        return Embedded(
            runs=[], places={},
            contents=["No flight is in this file: a store has none. Make the report from the study file to see some."],
        )  # fmt: skip
    flown_study, files, lanes = fastest(study)
    limit = (MOST if lanes else ALONE) if most is None else most
    some = chosen(indices, wanted, limit) if choose is None else sorted({*wanted, *choose(limit)})
    runs: list[Run] = []
    places: dict[int, int] = {}
    differing = 0
    points = points_for(len(some), COLUMNS)
    for flight in fly(flown_study, files, some, lanes=lanes, progress=progress):
        note = _difference(flight, known[flight.index], metric)
        differing += note is not None
        about = column_infos(flight.system, files.models_of(flown_study.origin), flight.signals)
        places[flight.index] = len(runs)
        settings: dict[str, Setting] = dict(known[flight.index]["settings"])
        track = tracks.compact(flight.system, flight.signals, about, points)
        runs.append(
            Run(
                name=f"run {flight.index}", index=flight.index, settings=settings, message=flight.message, note=note,
                track=track,
            )
        )  # fmt: skip
    return Embedded(runs=runs, places=places, contents=[*_contents(len(runs), len(known), points, differing)])


def _difference(flight: Flight, row: Row, metric: str) -> str | None:
    """How a flight flown again differs from its row in the store; None if it does not."""
    if flight.metrics["outcome"] != row["outcome"]:
        return f"flown again it is {flight.metrics['outcome']}; the store has {row['outcome']}"
    again, before = flight.metrics.get(metric), row.get(metric)
    if again is None or before is None:
        return None if again is before else f"flown again, {labels.metric(metric)} has a value only once"
    if abs(float(again) - float(before)) > AGREES * max(abs(float(again)), abs(float(before))):
        return f"flown again, {labels.metric(metric)} is {float(again):.6g}; the store has {float(before):.6g}"
    return None


def _contents(count: int, total: int, points: int, differing: int) -> Sequence[str]:
    said = [
        f"Metrics of all {total} runs are in this file, and the signals of {count} of them: flown again when it was "
        f"made, at most {points} points each, most of them where most happens. The page draws straight lines between "
        "them, so that what is faster is not to be seen."
    ]
    if count < total:
        said.append(
            "The flights are spread evenly over the design. A run without one opens with its metrics; "
            "--run N puts the flight of run N into the file, --flights N more of them."
        )
    if differing:
        said.append(
            f"{differing} of them came out otherwise than the store has it (their pages say how): the software or the "
            "machine is another one than that of the study."
        )
    elif count:
        said.append("All of them came out as the store has it.")
    return said


def provenance_of(about: Mapping[str, str]) -> list[tuple[str, str]]:
    """Versions and GUIDs that a store tells, and its machine."""
    place: dict[str, Any] = json.loads(about.get("place", "{}"))
    versions = {f"version of {name}": text for name, text in json.loads(about.get("versions", "{}")).items()}
    guids = {f"GUID of the {name}": text for name, text in json.loads(about.get("guids", "{}")).items()}
    machine = {"machine": str(place["machine"])} if "machine" in place else {}
    agreement = {"lanes": str(Agreement.from_text(about[AGREEMENT]))} if AGREEMENT in about else {}
    return [*versions.items(), *guids.items(), *machine.items(), *agreement.items()]
