"""Computers from tables of tasks, which are CSV files, and networks from CAN databases, as DBC files."""

import csv
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestration.foundation.basics.documents import readable
from orchestration.foundation.basics.errors import UsageError, expected_name, prefixed
from orchestration.foundation.basics.extras import needs
from orchestration.systems.system.computers import Task
from orchestration.systems.system.proposal import ProposedResources


def resources_of(arguments: Sequence[str]) -> tuple[ProposedResources, list[str]]:
    """The computers and networks of the files that have them, and the other arguments.

    Raises `UsageError` for a file that cannot be read, and where two have the same computer or network.
    """
    tables: dict[str, dict[str, Any]] = {}
    guessed: list[str] = []
    undecided: list[str] = []
    others = []
    for text in arguments:
        path = Path(text)
        if path.suffix.lower() == ".csv":
            _add(tables, "computers", path, computers_of(path))
        elif path.suffix.lower() in ENDINGS:
            bus = bus_of(path)
            _add(tables, "networks", path, bus.networks)
            guessed += bus.guessed
            undecided += bus.undecided
        else:
            others.append(text)
    return ProposedResources(tables=tables, guessed=tuple(guessed), undecided=tuple(undecided)), others


def _add(tables: dict[str, dict[str, Any]], table: str, path: Path, more: dict[str, Any]) -> None:
    for name in more:
        if name in tables.get(table, {}):
            raise UsageError(f"{path}: {table}.{name}: is in a file before it already; expected another name")
    tables.setdefault(table, {}).update(more)


ENDINGS = (".dbc", ".arxml", ".kcd", ".sym")
BIT_RATE, DATA_BIT_RATE = 500e3, 2e6
"""Rates where the database has none [1/s]"""


@dataclass(frozen=True, kw_only=True)
class Bus:
    """A bus of a CAN database."""

    networks: dict[str, Any]
    """the table `networks` of a system file"""
    guessed: tuple[str, ...]
    undecided: tuple[str, ...]
    """messages that are left out, and why"""


@needs("cantools")
def bus_of(path: Path) -> Bus:
    """The table `networks` of a system file, with each message that has an identifier of 11 bits and a cycle time.

    All are load, as a database has no connections. Raises `UsageError` for a file that is no CAN database.
    """
    import cantools

    with readable(path, "CAN database"), path.open("rb"):
        try:
            database = cantools.database.load_file(path, strict=False)
        except OSError:
            raise
        except Exception as error:  # of many types, including those of its parsers
            raise UsageError(f"{path}: expected a CAN database: {str(error) or type(error).__name__}") from error
    messages, undecided = {}, []
    for message in getattr(database, "messages", []):
        if message.is_extended_frame:
            undecided.append(f"{path.stem}.{message.name}: identifier of 29 bits; expected one of 11")
        elif not message.cycle_time:
            undecided.append(f"{path.stem}.{message.name}: no cycle time; expected how often it is sent")
        else:
            period = float(f"{message.cycle_time / 1e3:.15g}")
            messages[message.name] = {"bytes": message.length, "identifier": message.frame_id, "period": period}
    if not messages:
        raise UsageError(f"{path}: expected messages with a cycle time and an identifier of 11 bits")
    is_fd = any(message.is_fd for message in database.messages if message.name in messages)
    kind = "can-fd" if is_fd else "can"
    rates, guessed = _rates(path, database, is_fd)
    ordered = dict(sorted(messages.items(), key=lambda each: int(each[1]["identifier"])))
    return Bus(
        networks={path.stem: {"kind": kind, **rates, "messages": ordered}},
        guessed=guessed,
        undecided=tuple(undecided),
    )


def _rates(path: Path, database: Any, is_fd: bool) -> tuple[dict[str, float], tuple[str, ...]]:
    """The bit rates, and messages on those that the database does not have."""
    buses = getattr(database, "buses", [])
    declared = {
        "bit_rate": next((bus.baudrate for bus in buses if bus.baudrate), None),
        "data_bit_rate": next((bus.fd_baudrate for bus in buses if getattr(bus, "fd_baudrate", None)), None),
    }
    defaults = {"bit_rate": BIT_RATE, **({"data_bit_rate": DATA_BIT_RATE} if is_fd else {})}
    rates = {key: float(declared[key] or value) for key, value in defaults.items()}
    guessed = [
        f"{path.stem}.{key} is {rates[key]:g}, as {path.name} does not have it" for key in defaults if not declared[key]
    ]
    return rates, tuple(guessed)


TIME_UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
"""Units of times, after the name of a column: `period [ms]`"""
TIMES = ("period", "offset", "jitter", "execution", "deadline")
TEXTS = ("component", "on", "read", "write", "overrun")
COLUMNS = ("name", "computer", "priority", *TIMES, *TEXTS)


def computers_of(path: Path) -> dict[str, Any]:
    """The table `computers` of a system file from a CSV file; without a column `computer`, all tasks are on one.

    Times are in seconds, or in the unit of their column: `period [ms]`. An empty cell stands for the default. Raises
    `UsageError`, naming the line, for an invalid value.
    """
    with readable(path, "CSV file"), path.open(newline="", encoding="utf-8-sig") as file:
        rows = csv.reader(file, strict=True)
        try:
            columns = [_column(path, name) for name in next(rows, [])]
            for needed in ("name", "execution"):
                if needed not in [name for name, _ in columns]:
                    raise UsageError(f"{path}: no column {needed}; expected some of {', '.join(COLUMNS)}")
            computers: dict[str, Any] = {}
            for row in rows:
                if any(cell.strip() for cell in row):
                    _add_task(computers, path, f"{path}: line {rows.line_num}", columns, row)
        except csv.Error as error:
            raise UsageError(f"{path}: expected CSV: {error}") from error
    if not computers:
        raise UsageError(f"{path}: expected a row for each task")
    return computers


def _column(path: Path, header: str) -> tuple[str, float]:
    """The key of a column, and the unit of its times [s]."""
    name, _, unit = header.strip().partition("[")
    name, unit = name.strip().lower(), unit.strip(" ]")
    if name not in COLUMNS:
        raise UsageError(f"{path}: column {header.strip()}: {expected_name(name, COLUMNS)}")
    if unit not in (TIME_UNITS if name in TIMES else ("",)):
        expected = ", ".join(filter(None, TIME_UNITS)) if name in TIMES else "none"
        raise UsageError(f"{path}: column {header.strip()}: unit {unit}: expected {expected}")
    return name, TIME_UNITS[unit]


def _add_task(
    computers: dict[str, Any], path: Path, place: str, columns: list[tuple[str, float]], row: list[str]
) -> None:
    if len(row) != len(columns):
        raise UsageError(f"{place}: {len(row)} values, expected {len(columns)} as in the header")
    given = {name: (cell.strip(), unit) for (name, unit), cell in zip(columns, row, strict=True) if cell.strip()}
    keys = {name: _task_value(place, name, *cell) for name, cell in given.items() if name not in ("name", "computer")}
    if "name" not in given:
        raise UsageError(f"{place}: name: expected one for each task")
    name = given["name"][0]
    tasks: dict[str, Mapping[str, Any]] = computers.setdefault(
        given.get("computer", (path.stem, 1.0))[0], {"tasks": {}}
    )["tasks"]
    if name in tasks:
        raise UsageError(f"{place}: name = {name}: expected another one than those before it")
    with prefixed(f"{place}: {name}: "):
        task = Task(**keys)
    defaults = {field.name: field.default for field in dataclasses.fields(task)}
    tasks[name] = {key: value for key, value in keys.items() if value != defaults[key]}


def _task_value(place: str, name: str, cell: str, unit: float) -> Any:
    if name in TEXTS:
        return cell
    try:
        return int(cell) if name == "priority" else float(f"{float(cell) * unit:.15g}")
    except ValueError:
        expected = "a whole number" if name == "priority" else "a number"
        raise UsageError(f"{place}: {name} = {cell}: expected {expected}") from None
