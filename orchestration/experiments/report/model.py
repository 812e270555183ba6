"""The document of a report, which the page reads: JSON in which arrays are indices of blobs."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from orchestration.experiments.report.blobs import Blob
from orchestration.foundation.basics.documents import plain

Number = float | int | None
Setting = float | int | bool | str


@dataclass(frozen=True, kw_only=True)
class Line:
    """A signal in a panel."""

    column: str
    label: str
    held: bool = False
    """whether it keeps its value until the next one, as a command does"""
    reference: bool = False
    """whether it is the reference of another line"""


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Signals of one unit over time."""

    title: str
    unit: str | None
    lines: tuple[Line, ...]
    logarithmic: bool = False
    shown: bool = True
    """whether it is visible when the page opens"""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """The columns of a body that moves in space: quaternions (x, y, z, w) from body to space."""

    position: tuple[str, str, str]
    quaternion: tuple[str, str, str, str]
    reference: tuple[str, str, str] | None
    """the desired position"""
    desired: tuple[str, str, str, str] | None
    """the desired attitude"""
    thrust: str | None
    """upwards in the body [N]"""
    is_enu: bool = False
    """whether axes are east-north-up and forward-left-up, which the page converts; else north-east-down"""


@dataclass(frozen=True, kw_only=True)
class ReportLayout:
    """The panels and the scene of tracks with the same columns."""

    columns: tuple[str, ...]
    """Columns of a track"""
    panels: tuple[Panel, ...]
    scene: Scene | None


@dataclass(frozen=True, kw_only=True)
class ReportTrack:
    """Signals of a run, as indices of blobs."""

    layout: int
    time: int
    columns: tuple[int, ...]
    """Columns in the order of those of the layout"""


@dataclass(frozen=True, kw_only=True)
class Bars:
    """The occupation of computers and networks over time, in pieces; arrays as indices of blobs."""

    rows: tuple[str, ...]
    """tasks and messages"""
    row: int
    """Row of each piece"""
    begin: int
    """Begin [s]"""
    end: int
    """End [s]"""


@dataclass(frozen=True, kw_only=True)
class ReportRun:
    """A run that the page can open."""

    name: str
    index: int | None = None
    """Index in the design of a study"""
    settings: Mapping[str, Setting] = field(default_factory=dict)
    metrics: Mapping[str, float | int | bool | str | None] = field(default_factory=dict)
    """Metrics of a run that is not in a table"""
    message: str | None = None
    """Text of what diverged"""
    note: str | None = None
    """Note on its track"""
    track: ReportTrack | None = None
    bars: Bars | None = None
    """Bars of a system with computers or networks"""


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a table of runs: numbers, or indices into `words`."""

    name: str
    label: str
    unit: str | None
    kind: Literal["axis", "metric", "index"]
    values: int
    words: tuple[str, ...] | None = None
    logarithmic: bool = False


@dataclass(frozen=True, kw_only=True)
class ReportTable:
    """The runs of a study."""

    count: int
    """Number of rows here"""
    total: int
    """Number of runs in the store"""
    columns: tuple[Column, ...]
    tracks: Mapping[str, int]
    """Index of its run in the report, by row"""
    messages: Mapping[str, str]
    """Reason of a failure or divergence, by row"""
    is_grid: bool
    """whether every axis lists its values"""


@dataclass(frozen=True, kw_only=True)
class ReportShare:
    """The share of good runs among some runs."""

    label: str
    value: Number
    """Value of the axis, or the middle of its interval"""
    good: int
    runs: int
    low: Number
    high: Number
    """Wilson interval at 95 %; None if nothing is random"""


@dataclass(frozen=True, kw_only=True)
class Shares:
    """Shares along an axis."""

    axis: str
    unit: str | None
    logarithmic: bool
    shares: tuple[ReportShare, ...]


@dataclass(frozen=True, kw_only=True)
class ReportCell:
    """A cell of a comparison: one controller on one vehicle under one condition at one value of the axis."""

    number: int
    vehicle: str
    condition: str
    controller: str
    value: float
    survives: ReportShare
    settles: ReportShare
    diverged: int
    medians: Mapping[str, tuple[Number, Number, Number]]
    """Median and the ends of its interval at 95 %, by metric"""


@dataclass(frozen=True, kw_only=True)
class ComparisonCells:
    """The cells of a comparison, in addition to its table of runs."""

    axis: str
    """the name of its column"""
    label: str
    unit: str | None
    controllers: tuple[str, ...]
    cells: tuple[ReportCell, ...]


@dataclass(frozen=True, kw_only=True)
class MapCell:
    """A cell of a study that repeats."""

    x: float
    y: float | str
    value: float
    """Share, or difference of two shares"""
    low: Number
    high: Number
    """Interval at 95 %, by Wilson or Newcombe; None if nothing is random"""
    text: str
    said: str
    """Sentence of its value and interval"""
    runs: tuple[int, ...]
    """Indices of its runs in the design"""
    others: tuple[int, ...] = ()
    """Those of its runs of a second study"""


@dataclass(frozen=True, kw_only=True)
class CellMap:
    """The cells of a law, or the difference of two."""

    title: str
    is_difference: bool
    cells: tuple[MapCell, ...]


@dataclass(frozen=True, kw_only=True)
class RepeatedMaps:
    """The maps of a study that repeats, over two columns of its table."""

    across: str
    up: str
    maps: tuple[CellMap, ...]


@dataclass(frozen=True, kw_only=True)
class OtherStudy:
    """A second study over the same axes, drawn over the first, or beside it if both repeat."""

    name: str
    table: ReportTable
    """Its runs with their metrics"""
    shares: tuple[Shares, ...]


@dataclass(frozen=True, kw_only=True)
class Report:
    """The whole document."""

    kind: Literal["runs", "study", "comparison"]
    title: str
    summary: str
    words: tuple[str, str]
    """the names of the outcomes of a good run and of one that is not good"""
    layouts: tuple[ReportLayout, ...]
    runs: tuple[ReportRun, ...]
    blobs: Sequence[Blob]
    units: Mapping[str, str] = field(default_factory=dict)
    """Units of metrics"""
    labels: Mapping[str, str] = field(default_factory=dict)
    """Labels of metrics"""
    table: ReportTable | None = None
    metric: str | None = None
    """the one of the table that is drawn first"""
    overall: ReportShare | None = None
    shares: tuple[Shares, ...] = ()
    compared: ComparisonCells | None = None
    repeat: str | None = None
    """the axis that repeats the combinations of the others"""
    repeated: RepeatedMaps | None = None
    other: OtherStudy | None = None
    contents: tuple[str, ...] = ()
    """sentences: what the file contains and what it omits"""
    warnings: tuple[str, ...] = ()
    provenance: tuple[tuple[str, str], ...] = ()
    command: str = ""
    """Command that makes this file"""


def as_json(report: Report) -> str:
    """The document of a report as JSON; values that are not finite are null."""
    content = {each.name: getattr(report, each.name) for each in dataclasses.fields(report) if each.name != "blobs"}
    content["blobs"] = [blob.as_list() for blob in report.blobs]
    return json.dumps(plain(content), allow_nan=False, ensure_ascii=False, separators=(",", ":"))
