"""The settings of a system: the numbers of a run that a page may change, by path, and the values that are allowed."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from orchestration.components.fmi.instance import convert_value, number_of
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.components.fmi.read_description import NUMERIC, Model, Variable
from orchestration.systems.schedule.plan import MAX_TIME
from orchestration.systems.system.model import System

_LATEST = MAX_TIME / 1e9
_MOST = 1.7976931348623157e308


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One number of a run."""

    path: str
    """Path in the system"""
    value: float
    low: float = -_MOST
    high: float = _MOST
    excludes_low: bool = False
    is_whole: bool = False


class Settings:
    """All settings of a system, in the order in which C has them."""

    def __init__(
        self, system: System, models: Mapping[str, Model], free: Collection[str] = (), *, timing_is_given: bool = False
    ) -> None:
        """Parameters that are whole numbers choose between laws: only the `free` ones, by path, may be changed.

        With `timing_is_given` there are no settings of timing, nor of sources, but fixed ones.
        """
        self._free, self._is_given = free, timing_is_given
        self.all: list[Setting] = []
        self.at: dict[str, int] = {}
        """Places by path"""
        self._fixed_if_given("stop_time", system.stop_time, 0.0, _LATEST, excludes_low=True)
        self._fixed_if_given("seed", system.seed, 0.0, 2.0**63, is_whole=True)
        for name, component in system.components.items():
            place = f"components.{name}"
            if component.step is not None:
                self._of_timing(f"{place}.step", component.step, 0.0, _LATEST, excludes_low=True)
            sampling = component.sampling
            if sampling is not None:
                self._of_timing(f"{place}.sampling.period", sampling.period, 0.0, _LATEST, excludes_low=True)
                self._of_timing(f"{place}.sampling.offset", sampling.offset, 0.0, _LATEST)
                self._of_timing(f"{place}.sampling.jitter", sampling.jitter, 0.0, _LATEST)
                self._fixed_if_given(f"{place}.sampling.clock_ratio", sampling.clock_ratio, 0.0, excludes_low=True)
            for variable in models[name].variables.values():
                self._add_parameter(place, variable, component.parameters.get(variable.name))
        for x in system.connections:
            place = f"connections.{x.name}"
            self._of_timing(f"{place}.delay", x.delay, 0.0, _LATEST)
            self._of_timing(f"{place}.delay_jitter", x.delay_jitter, 0.0, _LATEST)
            self._of_timing(f"{place}.loss", x.loss, 0.0, 1.0)
            if x.burst_length is not None:
                self._of_timing(f"{place}.burst_length", x.burst_length, 1.0)
            for what, values in (("noise", x.noise), ("quantisation", x.quantisation)):
                each = [0.0] * len(x.start)
                for signal, value in values.items():
                    for i in x.places(signal):
                        each[i] = value
                for start, value in zip(x.start, each):
                    self._add(f"{place}.{what}.{start.partition('.')[2]}", value, 0.0)
            self._add(f"{place}.scale", x.scale)
            self._add(f"{place}.offset", x.offset)
        for name, source in system.sources.items():
            for key in ("constant", "noise", "period", "scale"):
                if (value := getattr(source, key)) is not None:
                    excludes = key == "period"
                    self._of_timing(f"sources.{name}.{key}", value, 0.0 if key in ("noise", "period") else -_MOST,
                                    excludes_low=excludes)  # fmt: skip

    def _add(self, path: str, value: object, low: float = -_MOST, high: float = _MOST,
             *, excludes_low: bool = False, is_whole: bool = False) -> None:  # fmt: skip
        assert isinstance(value, (int, float))
        self.at[path] = len(self.all)
        self.all.append(
            Setting(path=path, value=value, low=low, high=high, excludes_low=excludes_low, is_whole=is_whole)
        )

    def _of_timing(self, path: str, value: object, low: float, high: float = _MOST, **limits: bool) -> None:
        if not self._is_given:
            self._add(path, value, low, high, **limits)

    def _fixed_if_given(self, path: str, value: float, low: float, high: float = _MOST, **limits: bool) -> None:
        if self._is_given:
            self._add(path, value, value, value, is_whole=limits.get("is_whole", False))
        else:
            self._add(path, value, low, high, **limits)

    def _add_parameter(self, place: str, variable: Variable, given: object) -> None:
        is_one = variable.causality == "parameter" and not variable.is_constant and variable.kind in NUMERIC
        if not is_one or variable.name in (SAMPLE_PERIOD, SAMPLE_OFFSET):
            return
        value = variable.start if given is None else convert_value(variable, given, variable.name)
        number = None if value is None else number_of(variable, value)
        if number is None or not math.isfinite(number):
            return
        low = -_MOST if variable.minimum is None else variable.minimum
        high = _MOST if variable.maximum is None else variable.maximum
        if variable.kind == "Boolean":
            low, high = 0.0, 1.0
        elif variable.kind != "Real":
            low, high = max(low, -(2.0**31)), min(high, 2.0**31 - 1)
        path, is_whole = f"{place}.parameters.{variable.name}", variable.kind != "Real"
        if is_whole and path not in self._free:
            low = high = number
        self._add(path, number, low, high, is_whole=is_whole)
