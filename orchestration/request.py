"""What can be asked to run: a system file, or a scenario of the quadrotor; both are TOML."""

from pathlib import Path
from typing import TypeAlias

from orchestration.documents import read_toml
from orchestration.errors import UsageError
from orchestration.quadrotor.translation import system_of
from orchestration.scenario import Scenario
from orchestration.scenario_file import scenario_from_tables
from orchestration.system.model import System
from orchestration.system.system_file import is_system, system_from_tables, to_toml

Request: TypeAlias = Scenario | System


def load_request(path: str | Path) -> Request:
    """Read a system file or a scenario file; paths in it are relative to its folder.

    Raises `UsageError` for a file that cannot be read, a key that does not exist (naming those that do) or a
    value of the wrong kind.
    """
    path = Path(path)
    tables = read_toml(path, "system or scenario file")
    try:
        return (system_from_tables if is_system(tables) else scenario_from_tables)(tables, path.parent)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def system_meant(request: Request) -> System:
    """The system that a request means."""
    return system_of(request) if isinstance(request, Scenario) else request


def text_of(request: Request) -> str:
    """The file that loads as this request."""
    return request.to_toml() if isinstance(request, Scenario) else to_toml(request)
