"""What tells runs from each other, in a few words: the settings that differ between their scenarios."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from orchestration.results import display_names as labels
from orchestration.runs.ran import Ran

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOST = 3
"""settings that a name tells"""
_ABSENT = object()


def told_apart(results: Sequence[Ran], otherwise: Sequence[str]) -> list[str]:
    """A name for each run, as in "period 10 ms, κ 0"; the names `otherwise` where settings do not tell them apart."""
    settings = [_settings(result) for result in results]
    paths = [path for path in dict.fromkeys(path for one in settings for path in one) if _differs(path, settings)]
    names = [_told(one, paths) for one in settings]
    if 0 < len(paths) <= MOST and len(set(names)) == len(names):
        return names
    return list(otherwise)


def _settings(result: Ran) -> dict[str, Any]:
    """Of its scenario or system file by path, and the parameters that it was flown with."""
    written = dict(_flat(tomllib.loads(result.asked.to_toml())))
    return {**result.parameters, **written}


def _flat(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for key, value in table.items():
        found += _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else [(f"{prefix}{key}", value)]
    return found


def _differs(path: str, settings: Sequence[Mapping[str, Any]]) -> bool:
    values = [one.get(path, _ABSENT) for one in settings]
    return any(value != values[0] for value in values) and not _follows(path)


def _follows(path: str) -> bool:
    """Whether the master sets it from something else."""
    return path.endswith((".sample_period", ".sample_offset"))


def _told(settings: Mapping[str, Any], paths: Sequence[str]) -> str:
    return ", ".join(_one(path, settings.get(path)) for path in paths)


def _one(path: str, value: Any) -> str:
    name, unit = labels.SETTINGS.get(path, (labels.setting(path), None))
    if value is None:
        return f"{name} as usual"
    if isinstance(value, str):
        return PurePath(value).stem if path.endswith((".fmu", ".file")) else f"{name} {value}"
    return f"{name} {quantity(value, unit)}"


def quantity(value: Any, unit: str | None) -> str:
    """A value with its unit; short times in milliseconds."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    if unit == "s" and 0.0 < abs(value) < 1.0:
        return f"{1e3 * value:g} ms"
    shown = labels.unit(unit)
    return f"{value:g}" if shown is None else f"{value:g} {shown}"
