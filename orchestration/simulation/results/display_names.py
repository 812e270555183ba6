"""Display names of metrics, signals and settings, with their units, for figures and printed tables."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from orchestration.foundation.basics.documents import read_toml
from orchestration.simulation.results.units import ColumnInfo
from orchestration.systems.system.connection import component_of, variable_of

_TABLES = read_toml(Path(__file__).with_suffix(".toml"), "file of display names")


def _with_units(table: str) -> Mapping[str, tuple[str, str | None]]:
    return {key: (name, unit[0] if unit else None) for key, (name, *unit) in _TABLES[table].items()}


METRICS = _with_units("metrics")
"""Metrics of a run of the quadrotor: name and unit."""
SETTINGS = _with_units("settings")
"""Settings of a scenario, by path: name and unit."""
SIGNALS: Mapping[str, str] = _TABLES["signals"]
"""Signals of the quadrotor's loop, vectors by their stem."""
AXES: Mapping[str, str] = {"x": "x", "y": "y", "z": "z", "w": "w"}


def metric(name: str) -> str:
    """The display name of a metric or objective."""
    return METRICS[name][0] if name in METRICS else words(name)


def metric_with_unit(name: str, of: str | None) -> str:
    """The display name of a metric with its unit: the unit from its FMUs, else the quadrotor's."""
    return with_unit(metric(name), of or METRICS.get(name, ("", None))[1])


def setting(path: str) -> str:
    """The display name of a path of a scenario, system or study file: `period of pilot` for
    `components.pilot.sampling.period`, `execution of mcu's task control` for `computers.mcu.tasks.control.execution`.

    A parameter keeps its name.
    """
    known = _known(path)
    if known is not None:
        return known[0]
    head, _, rest = path.partition(".")
    name, _, what = rest.partition(".")
    if what.startswith("parameters."):
        return f"{what.removeprefix('parameters.').replace('.', ' ')} of {words(name)}"
    if (of_part := _OF_PART.fullmatch(path)) is not None:
        return f"{words(of_part['what'])} of {of_part['owner']}'s {of_part['kind']} {of_part['part']}"
    if head in ("components", "connections", "sources", "computers", "networks") and what:
        return f"{words(what.removeprefix('sampling.'))} of {words(name)}"
    return words(rest) if head in ("timing", "controller", "plant") and rest else words(path)


_OF_PART = re.compile(
    r"(?:computers|networks)\.(?P<owner>[^.]+)\.(?P<kind>task|message)s\.(?P<part>[^.]+)\.(?P<what>.+)"
)
"""A path of a task of a computer, or of a message of a network"""


def unit_of_setting(path: str) -> str | None:
    """The unit of a path of a scenario; None if it is not known here."""
    known = _known(path)
    return None if known is None else known[1]


def _known(path: str) -> tuple[str, str | None] | None:
    """Name and unit of a path, or of a key of the timing without its table, as `limit` uses it."""
    return SETTINGS.get(path) or SETTINGS.get(f"timing.{path}")


def signal(name: str, described: Mapping[str, ColumnInfo]) -> str:
    """The display name of a recorded column: from the table for the quadrotor, else from the FMU's description."""
    stem, _, axis = name.rpartition(".")
    if name in SIGNALS:
        return SIGNALS[name]
    if stem in SIGNALS and axis in AXES:
        return f"{SIGNALS[stem]} {axis}"
    known, what = described.get(name), words(variable_of(name))
    text = (known.text or "").strip().rstrip(".") if known is not None else ""
    if text and len(text) <= MAX_LEGEND_LENGTH:
        what = text if re.search(rf"\b{re.escape(what)}\b", text) else f"{what}, {text}"
    return f"{words(component_of(name))}: {what}"


def quantities(owner: str, columns: Iterable[str]) -> str:
    """The title of a panel: the connection or component that its columns are of, and what they are."""
    stems = [variable_of(column).rpartition(".") for column in columns]
    found = dict.fromkeys(words(stem if stem and axis in AXES else f"{stem}.{axis}") for stem, _, axis in stems)
    text = ", ".join(found)
    return f"{owner}: {text if len(text) <= MAX_LEGEND_LENGTH else f'{next(iter(found))}, …'}"


MAX_LEGEND_LENGTH = 32
"""characters of a description that fit into a legend"""


def words(name: str) -> str:
    """The words of a name in a file."""
    return re.sub(r"[_.\s]+", " ", name).strip()


def unit(text: str | None) -> str | None:
    """A unit in print: N·m for N.m, m/s² for m/s2; None for none and for 1."""
    if text in (None, "", "1"):
        return None
    raised = re.sub(r"(?<=[A-Za-zµΩ°%)])\^?(-?\d+)", lambda match: match[1].translate(_RAISED), str(text))
    return raised.replace(".", "·").replace("*", "·")


_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def amount(value: float, of: str | None, digits: int = 3) -> str:
    """A number with its unit, to so many digits."""
    shown = unit(of)
    return f"{value:.{digits}g}" if shown is None else f"{value:.{digits}g} {shown}"


def with_unit(name: str, of: str | None) -> str:
    """A quantity with its unit in brackets, as on axes and in heads of tables."""
    shown = unit(of)
    return name if shown is None else f"{name} [{shown}]"
