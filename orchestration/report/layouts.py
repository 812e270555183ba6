"""Which panels runs get, from the columns that they have: those of a quadrotor, or the connections of any system."""

from collections.abc import Collection, Iterator, Mapping, Sequence

from orchestration.quadrotor.wiring import (
    ANGULAR_VELOCITY,
    COMMAND,
    ENERGY,
    POSITION,
    POSITION_REFERENCE,
    QUATERNION,
    VELOCITY,
    components,
)
from orchestration.report.model import Layout, Line, Panel, Scene
from orchestration.results import display_names as labels
from orchestration.results.column_info import Described
from orchestration.system.model import System, component_of

POSITION_ERROR = "position error"
"""A column that is computed: ‖P - P_d‖ [m]"""
ANGLES = ("roll", "pitch", "yaw")
"""Columns that the page computes from the quaternion [deg]"""
PLACE, ATTITUDE = (tuple(f"plant.{name}" for name in names) for names in (POSITION, QUATERNION))
COMPACT = tuple(f"plant.{name}" for name in (*POSITION, *QUATERNION, *ANGULAR_VELOCITY, *COMMAND))
"""Columns of the plant that a track of a flight has, if it is to be short"""
OF_REFERENCE = ("x of the reference", "y of the reference", "z of the reference")
MOST_LINES = 8
"""in one panel"""

About = Mapping[str, Described]
"""What is known of columns"""


def is_flight(columns: Collection[str]) -> bool:
    """Whether they are those of a quadrotor."""
    return {*PLACE, *ATTITUDE} <= {*columns}


def layout_of(system: System | None, columns: Collection[str], about: About) -> Layout:
    """The panels for some columns; `system` is what they are of, where it is known."""
    if is_flight(columns):
        return _of_flight(system, columns, about)
    return Layout(columns=tuple(columns), panels=(*_of_connections(system, columns, about),), scene=None)


def _of_flight(system: System | None, columns: Collection[str], about: About) -> Layout:
    aims = all(name in columns for name in POSITION_REFERENCE)
    panels = [
        _panel("position error", "m", [Line(column=POSITION_ERROR, label="‖P − P_d‖")], logarithmic=True),
        Panel(
            title="position (x north, y east, z down)",
            unit="m",
            lines=(
                *_vector(PLACE, "xyz"),
                *(_vector(POSITION_REFERENCE, OF_REFERENCE, reference=True) if aims else ()),
            ),
        ),
        Panel(title="attitude", unit="°", lines=(*_vector(ANGLES, ANGLES),)),
        _panel("thrust", "N", [Line(column="plant.thrust", label="thrust", held=True)]),
        Panel(title="torque", unit="N·m", lines=(*_vector(_of_plant(components("torque")), "xyz", held=True),)),
        Panel(title="angular velocity", unit="rad/s", lines=(*_vector(_of_plant(ANGULAR_VELOCITY), "xyz"),)),
        Panel(title="velocity", unit="m/s", lines=(*_vector(_of_plant(VELOCITY), "xyz"),), shown=False),
        Panel(
            title="energy", unit="J", lines=(Line(column=f"controller.{ENERGY}", label="L", held=True),),
            logarithmic=True, shown=False,
        ),
    ]  # fmt: skip
    known = {*columns, *ANGLES, *([POSITION_ERROR] if aims else [])}
    kept = [panel for panel in panels if all(line.column in known for line in panel.lines)]
    drawn = {line.column for panel in kept for line in panel.lines} | {*ATTITUDE}
    rest = [*_of_components(system, [name for name in columns if name not in drawn], about, shown=False)]
    scene = Scene(
        position=(PLACE[0], PLACE[1], PLACE[2]),
        quaternion=(ATTITUDE[0], ATTITUDE[1], ATTITUDE[2], ATTITUDE[3]),
        reference=(POSITION_REFERENCE[0], POSITION_REFERENCE[1], POSITION_REFERENCE[2]) if aims else None,
    )
    return Layout(columns=tuple(columns), panels=(*kept, *rest), scene=scene)


def _of_connections(system: System | None, columns: Collection[str], about: About) -> Iterator[Panel]:
    """What is exchanged, as the receiver has it; then all else that was recorded."""
    drawn: set[str] = set()
    for x in system.connections if system is not None else ():
        ends = [end if end in columns else start for start, end in zip(x.start, x.end)]
        drawn |= {*x.start, *x.end}
        title = f"connection {x.name}" if x.name.isdigit() else x.name
        applied = x.end[0] in columns or (system is not None and system.components[x.sender].sampling is not None)
        yield from _split(title, [end for end in ends if end in columns], about, held=applied)
    rest = [name for name in columns if name not in drawn and name != "time"]
    yield from _of_components(system, rest, about, shown=not drawn)


def _of_components(system: System | None, columns: Sequence[str], about: About, *, shown: bool) -> Iterator[Panel]:
    """Columns by component and vector; those of a component that samples are held."""
    groups: dict[str, list[str]] = {}
    for name in columns:
        groups.setdefault(name.rpartition(".")[0], []).append(name)
    for group, names in groups.items():
        owner = None if system is None else system.components.get(component_of(names[0]))
        held = owner is not None and owner.sampling is not None
        yield from _split(group, names, about, held=held, shown=shown)


def _split(
    title: str, names: Sequence[str], about: About, *, held: bool = False, shown: bool = True
) -> Iterator[Panel]:
    """Panels of one unit and few lines each."""
    alike: dict[str | None, list[str]] = {}
    for name in names:
        alike.setdefault(labels.unit(about[name].unit) if name in about else None, []).append(name)
    for unit, some in alike.items():
        for first in range(0, len(some), MOST_LINES):
            lines = [
                Line(column=name, label=labels.signal(name, about), held=held)
                for name in some[first : first + MOST_LINES]
            ]
            yield Panel(title=title, unit=unit, lines=(*lines,), shown=shown)


def _panel(title: str, unit: str, lines: Sequence[Line], *, logarithmic: bool = False) -> Panel:
    return Panel(title=title, unit=unit, lines=tuple(lines), logarithmic=logarithmic)


def _vector(
    columns: Sequence[str], labels: Sequence[str], *, held: bool = False, reference: bool = False
) -> Iterator[Line]:
    for column, label in zip(columns, labels, strict=True):
        yield Line(column=column, label=label, held=held, reference=reference)


def _of_plant(names: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"plant.{name}" for name in names)
