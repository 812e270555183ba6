"""Labels of runs: the settings that differ between their scenarios."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from orchestration.simulation.results import quantities
from orchestration.simulation.results.quantities import Quantity
from orchestration.simulation.runs.run_like import RunLike

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MAX_SETTINGS_IN_LABEL = 3
"""settings in a label"""
_ABSENT = object()


def labels_of_runs(results: Sequence[RunLike], otherwise: Sequence[str]) -> list[str]:
    """A label for each run, as in "period 10 ms, κ 0"; those of `otherwise` where settings do not distinguish them."""
    settings = [_settings(result) for result in results]
    paths = [path for path in dict.fromkeys(path for one in settings for path in one) if _differs(path, settings)]
    named = {path: quantities.setting(path, [one.get(path) for one in settings]) for path in paths}
    names = [", ".join(_one(path, each, one.get(path)) for path, each in named.items()) for one in settings]
    if 0 < len(paths) <= MAX_SETTINGS_IN_LABEL and len(set(names)) == len(names):
        return names
    return list(otherwise)


def _settings(result: RunLike) -> dict[str, Any]:
    """The settings of its scenario or system file by path, and the parameters that it ran with."""
    written = dict(_flat(tomllib.loads(result.request.to_toml())))
    return {**result.parameters, **written}


def _flat(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    settings: list[tuple[str, Any]] = []
    for key, value in table.items():
        settings += _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else [(f"{prefix}{key}", value)]
    return settings


def _differs(path: str, settings: Sequence[Mapping[str, Any]]) -> bool:
    values = [one.get(path, _ABSENT) for one in settings]
    return any(value != values[0] for value in values) and not _follows(path)


def _follows(path: str) -> bool:
    """Whether the master derives it from other settings."""
    return path.endswith((".sample_period", ".sample_offset"))


def _one(path: str, named: Quantity, value: Any) -> str:
    if value is None:
        return f"{named.name} as usual"
    if isinstance(value, str) and path.endswith((".fmu", ".file")):
        return PurePath(value).stem
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return f"{named.name} {named.text_of(value) if is_number else value}"
