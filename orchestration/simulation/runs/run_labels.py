"""Labels of runs: the settings that differ between their scenarios."""

from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from orchestration.foundation.basics.documents import tables_in
from orchestration.simulation.results import quantities
from orchestration.simulation.results.quantities import Quantity
from orchestration.simulation.runs.result import Result
from orchestration.systems.system.component import flattened
from orchestration.systems.system.requirements import is_number

MAX_SETTINGS_IN_LABEL = 3
"""Most settings in a label"""
_ABSENT = object()


def labels_of_runs(results: Sequence[Result], otherwise: Sequence[str]) -> list[str]:
    """A label for each run, as in "period 10 ms, κ 0"; those of `otherwise` where settings do not distinguish them."""
    runs = [_settings(result) for result in results]
    every = dict.fromkeys(path for run in runs for path in run)
    paths = [path for path in every if _is_setting_that_differs(path, runs)]
    named = {path: quantities.setting(path, [run.get(path) for run in runs]) for path in paths}
    names = [", ".join(_setting_text(path, each, run.get(path)) for path, each in named.items()) for run in runs]
    if 0 < len(paths) <= MAX_SETTINGS_IN_LABEL and len(set(names)) == len(names):
        return names
    return list(otherwise)


def _settings(result: Result) -> dict[str, Any]:
    """The settings of its scenario or system file by path, and the parameters that it ran with."""
    return {**result.parameters, **dict(flattened(tables_in(result.request.to_toml())))}


def _is_setting_that_differs(path: str, runs: Sequence[Mapping[str, Any]]) -> bool:
    values = [run.get(path, _ABSENT) for run in runs]
    return any(value != values[0] for value in values) and not _is_derived_by_master(path)


def _is_derived_by_master(path: str) -> bool:
    """Whether the master derives it from other settings."""
    return path.endswith((".sample_period", ".sample_offset"))


def _setting_text(path: str, named: Quantity, value: Any) -> str:
    if value is None:
        return f"{named.name} as usual"
    if isinstance(value, str) and path.endswith((".fmu", ".file")):
        return PurePath(value).stem
    return f"{named.name} {named.text_of(value) if is_number(value) else value}"
