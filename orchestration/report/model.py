"""What a report holds, as the page reads it: JSON whose arrays are numbers of blobs."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from orchestration.basics.documents import plain
from orchestration.report.blobs import Blob

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
    """whether it is what another line is to follow"""


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Signals of one unit over time."""

    title: str
    unit: str | None
    lines: tuple[Line, ...]
    logarithmic: bool = False
    shown: bool = True
    """whether the page opens with it"""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """The columns of what moves in space: quaternions (x, y, z, w) from body to space."""

    position: tuple[str, str, str]
    quaternion: tuple[str, str, str, str]
    reference: tuple[str, str, str] | None
    """where it should be"""
    desired: tuple[str, str, str, str] | None
    """the attitude that it should have"""
    thrust: str | None
    """upwards as the vehicle has it [N]"""
    is_enu: bool = False
    """whether they are east-north-up and of a body forward-left-up, which the page turns; else north-east-down"""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How the tracks of runs that are alike are drawn."""

    columns: tuple[str, ...]
    """of such a track"""
    panels: tuple[Panel, ...]
    scene: Scene | None


@dataclass(frozen=True, kw_only=True)
class Track:
    """Signals of a run, as places of blobs."""

    layout: int
    time: int
    columns: tuple[int, ...]
    """in the order of those of the layout"""


@dataclass(frozen=True, kw_only=True)
class Bars:
    """Who has a computer or a network when, in pieces; arrays as places of blobs."""

    rows: tuple[str, ...]
    """tasks and messages"""
    row: int
    """of each piece"""
    begin: int
    """[s]"""
    end: int
    """[s]"""


@dataclass(frozen=True, kw_only=True)
class Run:
    """A run that the page can open."""

    name: str
    index: int | None = None
    """in the design of a study"""
    settings: Mapping[str, Setting] = field(default_factory=dict)
    metrics: Mapping[str, float | int | bool | str | None] = field(default_factory=dict)
    """of a run that is in no table"""
    message: str | None = None
    """what diverged"""
    note: str | None = None
    """what is to be known of its track"""
    track: Track | None = None
    bars: Bars | None = None
    """of a system with computers or networks"""


@dataclass(frozen=True, kw_only=True)
class Column:
    """Of a table of runs: numbers, or places in `words`."""

    name: str
    label: str
    unit: str | None
    kind: Literal["axis", "metric", "index"]
    values: int
    words: tuple[str, ...] | None = None
    logarithmic: bool = False


@dataclass(frozen=True, kw_only=True)
class Table:
    """The runs of a study."""

    count: int
    """of rows here"""
    total: int
    """of runs that were flown"""
    columns: tuple[Column, ...]
    tracks: Mapping[str, int]
    """by row: which of the report's runs it is"""
    messages: Mapping[str, str]
    """by row: what failed or diverged"""
    is_grid: bool
    """whether every axis lists its values"""


@dataclass(frozen=True, kw_only=True)
class Share:
    """Of some runs, those that are good."""

    label: str
    value: Number
    """of the axis, or the middle of what it is taken over"""
    good: int
    runs: int
    low: Number
    high: Number
    """Wilson interval at 95 %; None where nothing was left to chance"""


@dataclass(frozen=True, kw_only=True)
class Shares:
    """Shares along an axis."""

    axis: str
    unit: str | None
    logarithmic: bool
    shares: tuple[Share, ...]


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Of a comparison: one controller on one vehicle under one condition at one value of the axis."""

    number: int
    vehicle: str
    condition: str
    controller: str
    value: float
    survives: Share
    settles: Share
    diverged: int
    medians: Mapping[str, tuple[Number, Number, Number]]
    """by metric: value, and the ends of its interval at 95 %"""


@dataclass(frozen=True, kw_only=True)
class Compared:
    """What a comparison adds to its table of runs."""

    axis: str
    """the name of its column"""
    label: str
    unit: str | None
    controllers: tuple[str, ...]
    cells: tuple[Cell, ...]


@dataclass(frozen=True, kw_only=True)
class Report:
    """All of it."""

    kind: Literal["runs", "study", "comparison"]
    title: str
    summary: str
    words: tuple[str, str]
    """what a good run is called, and one that is not"""
    layouts: tuple[Layout, ...]
    runs: tuple[Run, ...]
    blobs: Sequence[Blob]
    units: Mapping[str, str] = field(default_factory=dict)
    """of metrics"""
    labels: Mapping[str, str] = field(default_factory=dict)
    """of metrics: what people call them"""
    table: Table | None = None
    metric: str | None = None
    """of the table, that is drawn first"""
    overall: Share | None = None
    shares: tuple[Shares, ...] = ()
    compared: Compared | None = None
    contents: tuple[str, ...] = ()
    """sentences: what is in the file, and what is left out"""
    warnings: tuple[str, ...] = ()
    provenance: tuple[tuple[str, str], ...] = ()
    command: str = ""
    """that makes this file"""


def as_json(report: Report) -> str:
    """The document of a report; what is not finite is null."""
    content = {each.name: getattr(report, each.name) for each in dataclasses.fields(report) if each.name != "blobs"}
    content["blobs"] = [blob.as_list() for blob in report.blobs]
    return json.dumps(plain(content), allow_nan=False, ensure_ascii=False, separators=(",", ":"))
