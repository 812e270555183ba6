"""Networks from a CAN database: a DBC file, or another one that cantools reads."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestration.foundation.basics.documents import readable
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import needs

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
