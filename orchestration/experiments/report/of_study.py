"""The report of a study: its store, and signals of some of its runs."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.experiments.report.blobs import Blobs
from orchestration.experiments.report.model import OtherStudy, Report, ReportRun, ReportShare, Setting, Shares
from orchestration.experiments.report.repeated import maps_of_both, repeated_maps, runs_in_cells
from orchestration.experiments.report.reruns import Rerun, fastest, rerun
from orchestration.experiments.report.subset import MAX_IN_BATCHES, MAX_SINGLY, Wanted, points_for, select
from orchestration.experiments.report.tables import ColumnAxis, Row, is_good, report_table, share_of, shares_along
from orchestration.experiments.report.tracks import Tracks
from orchestration.experiments.studies.axes import Axis, quantity_of
from orchestration.experiments.studies.default_metric import default_metric
from orchestration.experiments.studies.infinite_means import INFINITE, InfiniteMeans
from orchestration.experiments.studies.missing_runs import AGREEMENT
from orchestration.experiments.studies.store import open_for_reading
from orchestration.experiments.studies.store_columns import GUIDS, TEXTS, UNITS
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.sweep import expect_current
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.objectives import FIXED, judged_objective
from orchestration.simulation.results.quantities import quantity
from orchestration.simulation.results.units import column_infos
from orchestration.simulation.workers.batching import LaneAgreement
from orchestration.systems.system.model import DIVERGED, TERMINATED

RERUN_TOLERANCE = 1e-6
"""Relative difference of the metric that is drawn first up to which a rerun equals the run in the store"""

Choose = Callable[[int], Sequence[int]]
"""Selects at most this number of runs, by their indices in the design"""
COLUMNS = 24
"""Typical number of columns of a track, its time counted twice"""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """The content of a store."""

    rows: Sequence[Row]
    metrics: Sequence[str]
    units: Mapping[str, str]
    about: Mapping[str, str]


def read(path: Path, study: Study | None = None) -> Stored:
    """The content of a store; raises `UsageError` for one without runs, or of another study."""
    with open_for_reading(path) as opened:
        if study is not None:
            expect_current(opened, study)
        about, rows = opened.about(), list(opened.rows())
        metrics = [name for name in opened.metrics if name not in TEXTS]
    if not rows or "axes" not in about:
        raise UsageError(f"{path}: expected a store with runs; quadcosim sweep makes them")
    units: dict[str, str] = json.loads(about.get(UNITS, "{}"))
    return Stored(rows=rows, metrics=metrics, units=units, about=about)


@dataclass(frozen=True, kw_only=True)
class Embedded:
    """The runs whose signals are in a report."""

    runs: Sequence[ReportRun]
    places: Mapping[int, int]
    """Places in `runs`, by index in the design"""
    contents: Sequence[str]


def study_report(
    name: str,
    stored: Stored,
    study: Study | None,
    command: str,
    wanted: Wanted,
    *,
    axes: Sequence[ColumnAxis] | None = None,
    choose: Choose | None = None,
    other: tuple[str, Stored, Study | None] | None = None,
) -> Report:
    """The report of a store; if the `study` is known, runs are simulated again for their signals.

    Runs that are not required are selected by `choose`. `axes` are by default those of the study. `other` is a second
    study, which is drawn over it. Raises `UsageError` for a run that the study does not have, and for a second one over
    other axes.
    """
    blobs = Blobs()
    tracks = Tracks(blobs)
    axes = axes_of(stored, study) if axes is None else axes
    metric = metric_of(stored, study)
    embedded = embed(study, stored, tracks, wanted, metric, choose)
    overall = _overall(stored, study)
    words = words_of(stored, study)
    runs = runs_in_cells(study, stored.rows, axes)
    if other is None:
        repeated = repeated_maps(runs)
    else:
        repeated = maps_of_both((name, runs), (other[0], runs_in_cells(other[2], other[1].rows, axes)))
        over = _over(*other, axes=axes, of=name, blobs=blobs, metrics=stored.metrics)
    return Report(
        kind="study",
        title=name,
        summary=summary_of(overall, words, stored)
        + _on_means(stored, study)
        + ("" if other is None else _summary_of_other(*other)),
        words=words,
        layouts=tuple(tracks.layouts),
        runs=tuple(embedded.runs),
        table=report_table(
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
            along
            for axis in axes
            if repeated is None and (along := _along(axis, stored, study)) is not None
        ),
        repeat=None if study is None else study.repeat,
        repeated=repeated,
        other=None if other is None else over,
        contents=tuple(embedded.contents),
        provenance=tuple(provenance_of(stored.about)),
        command=command,
    )  # fmt: skip


def _over(
    name: str,
    stored: Stored,
    study: Study | None,
    *,
    axes: Sequence[ColumnAxis],
    of: str,
    blobs: Blobs,
    metrics: Sequence[str],
) -> OtherStudy:
    """A second study with some metrics of its runs; raises `UsageError` for one over other axes."""
    own = {axis.name: axis for axis in axes_of(stored, study)}
    if {*own} != {axis.name for axis in axes}:
        listed = ", ".join(axis.name for axis in axes)
        raise UsageError(
            f"{name}: its axes are {', '.join(own)}; expected those of {of}, over which it is drawn: {listed}"
        )
    shares = (_along(axis, stored, study) for axis in axes)
    known = [name for name in metrics if name in stored.metrics]
    table = report_table(
        stored.rows, axes, known, stored.units, blobs, tracks={}, messages={},
        is_grid=json.loads(stored.about.get("grid", "null")) is not None,
    )  # fmt: skip
    return OtherStudy(name=name, table=table, shares=tuple(along for along in shares if along is not None))


def _summary_of_other(name: str, stored: Stored, study: Study | None) -> str:
    overall = _overall(stored, study)
    return f" Over it {name}: {summary_of(overall, words_of(stored, study), stored)}"


def _on_means(stored: Stored, study: Study | None) -> str:
    """What is to be said of averages over runs, and what is not known of them, in sentences."""
    if study is None or not stored.about.get(INFINITE):
        return ""
    means = InfiniteMeans.from_text(stored.about[INFINITE])
    warnings = (f" Mind {text}." for text in means.warnings(study, stored.units))
    return "".join([*warnings, *(f" {text[0].upper()}{text[1:]}." for text in means.notes(study, stored.units))])


def _overall(stored: Stored, study: Study | None) -> ReportShare:
    return share_of("all runs", None, stored.rows, by_chance=is_by_chance(stored, study))


def _along(axis: ColumnAxis, stored: Stored, study: Study | None) -> Shares | None:
    return shares_along(stored.rows, axis, by_chance=is_by_chance(stored, study, axis.name))


def is_by_chance(stored: Stored, study: Study | None, but: str | None = None) -> bool:
    """Whether a share has an interval: not over chosen values of axes but one, whatever seeds repeat them."""
    axes = () if study is None else study.axes
    drawn = all(axis.values is None or "seed" in axis.targets for axis in axes if axis.name != but)
    return drawn and is_sample(stored, study)


def axes_of(stored: Stored, study: Study | None) -> list[ColumnAxis]:
    """The axes with the units of the store; with scales if the study is known."""
    if study is None:
        return [
            ColumnAxis(name=name, quantity=quantity(labels.words(name), stored.units.get(name), _values(stored, name)))
            for name in json.loads(stored.about["axes"])
        ]
    return [column_axis(axis, stored.units) for axis in study.axes]


def column_axis(axis: Axis, units: Mapping[str, str]) -> ColumnAxis:
    """An axis of a study as the page draws it, with the units of the store."""
    return ColumnAxis(name=axis.name, quantity=quantity_of(axis, units), logarithmic=axis.scale == "logarithmic")


def _values(stored: Stored, axis: str) -> list[Any]:
    return [row["settings"][axis] for row in stored.rows]


def metric_of(stored: Stored, study: Study | None) -> str:
    """The metric that is drawn first, as in figures of the study."""

    def values(name: str) -> Floats:
        return np.array([float(row[name]) for row in stored.rows if is_good(row) and row[name] is not None])

    preferred = None if study is None else judged_objective(study.origin)
    return default_metric((name for name in stored.metrics if name not in FIXED), values, preferred)


def words_of(stored: Stored, study: Study | None) -> tuple[str, str]:
    """The names of the outcomes of a good run and of one that is not good."""
    if study is not None:
        return study.origin.criterion.outcomes
    good = next((str(row["outcome"]) for row in stored.rows if row["good"] == 1), "good")
    others = (str(row["outcome"]) for row in stored.rows if row["good"] == 0)
    bad = next((outcome for outcome in others if outcome not in (DIVERGED, TERMINATED)), "bad")
    return good, bad


def is_sample(stored: Stored, study: Study | None) -> bool:
    """Whether runs are a random sample, so that a share of them has an interval; a grid is not."""
    if study is None:
        return json.loads(stored.about.get("grid", "null")) is None
    drawn = any(axis.values is None or "seed" in axis.targets for axis in study.axes)
    return drawn or study.vary_seed


def summary_of(overall: ReportShare, words: tuple[str, str], stored: Stored) -> str:
    """A sentence with the outcomes of all runs."""
    total = int(stored.about.get("total", overall.runs))
    runs = f"{overall.runs} runs" if total == overall.runs else f"{overall.runs} of {total} runs are done so far"
    text = f"{runs}: {overall.good} {words[0]} ({_percent(overall.good / overall.runs)}"
    if overall.low is not None and overall.high is not None:
        text += f", 95 % interval {_percent(overall.low)} to {_percent(overall.high)}"
    outcomes = Counter(row["outcome"] for row in stored.rows)
    failed = sum(row["status"] == "failed" for row in stored.rows)
    text += f"), {outcomes[DIVERGED]} diverged"
    text += f", {outcomes[TERMINATED]} terminated" if outcomes[TERMINATED] else ""
    return text + (f", {failed} failed." if failed else ".")


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def messages_of(rows: Sequence[Row], places: Mapping[int, int]) -> dict[int, str]:
    """Reasons of failures by index; of runs with signals also reasons of divergence."""
    return {
        row["design_index"]: row["message"]
        for row in rows
        if row["message"] is not None and (row["status"] == "failed" or row["design_index"] in places)
    }


def embed(
    study: Study | None, stored: Stored, tracks: Tracks, wanted: Wanted, metric: str, choose: Choose | None
) -> Embedded:
    """Rerun some of the runs that are done, and keep the signals that the page needs."""
    known = {row["design_index"]: row for row in stored.rows}
    for index in wanted.required:
        if index not in known:
            raise UsageError(f"--run {index}: expected the number of a run that is in the store")
    if study is None:
        return Embedded(
            runs=[], places={},
            contents=["This file has no signals: a store has none. Make the report from the study file to see some."],
        )  # fmt: skip
    variant, files, lanes = fastest(study)
    limit = (MAX_IN_BATCHES if lanes else MAX_SINGLY) if wanted.most is None else wanted.most
    if choose is None:
        done = [row["design_index"] for row in stored.rows if row["status"] == "done"]
        selected = select(done, wanted.required, limit)
    else:
        selected = sorted({*wanted.required, *choose(limit)})
    runs: list[ReportRun] = []
    places: dict[int, int] = {}
    differing = 0
    points = points_for(len(selected), COLUMNS)
    for again in rerun(variant, files, selected, lanes=lanes, progress=wanted.progress):
        note = _difference(again, known[again.index], metric)
        differing += note is not None
        about = column_infos(again.system, files.models_of(variant.origin), again.signals)
        places[again.index] = len(runs)
        settings: dict[str, Setting] = dict(known[again.index]["settings"])
        track = tracks.compact(again.system, again.signals, about, points)
        runs.append(
            ReportRun(
                name=f"run {again.index}", index=again.index, settings=settings, message=again.message, note=note,
                track=track,
            )
        )  # fmt: skip
    return Embedded(runs=runs, places=places, contents=[*_contents(len(runs), len(known), points, differing)])


def _difference(again: Rerun, row: Row, metric: str) -> str | None:
    """How a rerun differs from its row in the store; None if it does not."""
    if again.metrics["outcome"] != row["outcome"]:
        return f"the rerun is {again.metrics['outcome']}; the store has {row['outcome']}"
    new, old = again.metrics.get(metric), row.get(metric)
    if new is None or old is None:
        has, lacks = ("the store", "the rerun") if new is None else ("the rerun", "the store")
        return None if new is old else f"{has} has a value of {labels.metric(metric)}, {lacks} has none"
    if abs(float(new) - float(old)) > RERUN_TOLERANCE * max(abs(float(new)), abs(float(old))):
        return f"in the rerun {labels.metric(metric)} is {float(new):.6g}; the store has {float(old):.6g}"
    return None


def _contents(count: int, total: int, points: int, differing: int) -> Sequence[str]:
    texts = [
        f"Metrics of all {total} runs are in this file, and the signals of {count} of them, which were rerun for it: "
        f"at most {points} points each, most of them where signals change most. The page draws straight lines between "
        "them, so faster changes are not visible."
    ]
    if count < total:
        texts.append(
            "These runs are spread evenly over the design. The others open with their metrics only; "
            "--run N includes the signals of run N, --flights N those of N runs."
        )
    if differing:
        texts.append(
            f"{differing} of the reruns differ from the store (see their notes): the software or the machine is not "
            "that of the study."
        )
    elif count:
        texts.append("All reruns agree with the store.")
    return texts


def provenance_of(about: Mapping[str, str]) -> list[tuple[str, str]]:
    """Versions and GUIDs in a store, and its machine."""
    place: dict[str, Any] = json.loads(about.get("place", "{}"))
    versions = {f"version of {name}": text for name, text in json.loads(about.get("versions", "{}")).items()}
    guids: dict[str, str] = {}
    for name, guid in json.loads(about.get(GUIDS, "{}")).items():
        each = {"": guid} if isinstance(guid, str) else {f" {', '.join(map(str, at))}": one for at, one in guid["of"]}
        guids |= {f"GUID of the {name}{at}": text for at, text in each.items()}
    machine = {"machine": str(place["machine"])} if "machine" in place else {}
    agreement = {"lanes": str(LaneAgreement.from_text(about[AGREEMENT]))} if about.get(AGREEMENT) else {}
    return [*versions.items(), *guids.items(), *machine.items(), *agreement.items()]
