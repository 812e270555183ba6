"""Search ranges of limits: the quantities, and the scan of each."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from numbers import Real

from orchestration.components.fmi.read_description import Model, Variable
from orchestration.foundation.basics.bisection import Range, is_wide
from orchestration.foundation.basics.errors import UsageError, expected_name
from orchestration.foundation.basics.terminal import inform
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.foundation.basics.unit_algebra import after
from orchestration.simulation.results.quantities import is_in_seconds
from orchestration.systems.system.component import TaskSampling
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import TOP, changed, parameter_name, value_at
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of

PERIOD = "period"
QUANTITIES = (PERIOD, "delay", "jitter", "loss")
"""Names of quantities that a request may have; any other is a path"""
STEPS, PARTS = 20, 50
"""Number of steps of the scan of a given range, and of tolerances in a step"""
PER_DECADE, SHARE = 5, 0.01
"""Steps in a decade, at least, of a range by equal factors, and the tolerance there, as a share of the value"""
OWN = 0.2
"""Share of the file's own delay that is the unit of its range where it is more than a period"""


@dataclass(frozen=True, kw_only=True)
class Varied:
    """A request as a function of one quantity."""

    request: Request
    of: str
    """`period`, `delay`, `jitter` or `loss` of the quadrotor, or a path"""

    def __post_init__(self) -> None:
        if not isinstance(self.of, str):
            raise UsageError(f"--of {self.of}: expected the name of a quantity, or a path, as text")
        for path in self.paths:
            value = value_at(self.system, path)
            if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float, Distribution))):
                raise UsageError(f"--of {self.of}: expected the path of a number")

    @cached_property
    def system(self) -> System:
        """The unchanged system."""
        return system_of(self.request)

    @cached_property
    def paths(self) -> tuple[str, ...]:
        """The paths of the quantity; raises `UsageError` for an unknown one."""
        known = [name for name in QUANTITIES if self.request.range_of(name) is not None]
        if self.of in known:
            return paths_in(self.request, f"timing.{self.of}")
        if self.of in QUANTITIES:
            path = (
                f"components.NAME.sampling.{self.of}"
                if self.of in (PERIOD, "jitter")
                else f"connections.NAME.{self.of}"
            )
            raise UsageError(f"--of {self.of}: for the quadrotor only; expected a path, as {path}")
        if "." not in self.of and self.of not in TOP:
            words = f"{expected_name(self.of, known)}, or" if known else "expected"
            raise UsageError(f"--of {self.of}: {words} a path, as connections.NAME.delay")
        return paths_in(self.request, self.of)

    @cached_property
    def own(self) -> float | None:
        """The value that the unchanged system has; None: it has no number there, or several."""
        values = {value_at(self.system, path) for path in self.paths}
        return next((float(value) for value in values if len(values) == 1 and isinstance(value, Real)), None)

    def at(self, value: float) -> System:
        """The system with another value; raises `UsageError` for an invalid one."""
        with errors_in_own_terms(self.request):
            return changed(self.system, dict.fromkeys(self.paths, value))


def search_range(
    varied: Varied,
    models: Mapping[str, Model],
    *,
    first: float | None,
    last: float | None,
    tolerance: float | None,
    scan: float | None,
    share: float = 1.0,
) -> Range:
    """The range in which a limit is searched, by default a `share` of it; raises `UsageError` for an invalid one.

    From the value of the system itself, if that lies in it, the search goes up and down. Without a default, a range of
    one sign and of more than a decade is scanned by equal factors, unless a step or a tolerance is given.
    """
    for flag, value in (("from", first), ("to", last), ("tolerance", tolerance), ("scan", scan)):
        if value is not None and not isinstance(value, Real):
            raise UsageError(f"--{flag} {value}: expected a number")
    for flag, value in (("tolerance", tolerance), ("scan", scan)):
        if value is not None and not (value > 0.0 and math.isfinite(value)):
            raise UsageError(f"--{flag} {value}: expected a positive number")
    named = varied.request.range_of(varied.of)
    known = named or _range_by_period(varied)
    for path in varied.paths:
        name = parameter_name(path) or ""
        if component_of(name) in models:
            models[component_of(name)].variable(variable_of(name), path)
    if known is None and (first is None or last is None):
        raise UsageError(f"--of {varied.of}: expected --from and --to, between which it is searched")
    low = first if first is not None else known.first if known is not None else 0.0
    high = last if last is not None else low + share * (known.last - low) if known is not None else 0.0
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise UsageError(f"--from {low:g} --to {high:g}: expected finite numbers, the first one smaller")
    for flag, value in (("from", first), ("to", last)):
        try:
            if value is not None:
                varied.at(value)
        except UsageError as error:
            raise UsageError(f"--{flag} {value:g}: {error}") from None
    if known is not None and named is None and (first is None or last is None):
        inform(f"--of {varied.of}: searched from {low:g} to {high:g}{after(known.unit)}; --from and --to set others")
    before = known.before if known is not None and first is None else ()
    own = own_value(varied, models)
    if geometric := known is None and scan is None and tolerance is None and is_wide(low, high):
        decades = abs(math.log10(high / low))
        step, tolerance = 10.0 ** (decades / max(STEPS, math.ceil(PER_DECADE * decades))), SHARE
    else:
        step = scan if scan is not None else known.step if known is not None else float(f"{(high - low) / STEPS:.12g}")
    return Range(
        own=own if own is not None and min((*before, low)) <= own <= high else None,
        before=before,
        first=low,
        step=step,
        last=high,
        tolerance=tolerance if tolerance is not None else known.tolerance if known is not None else step / PARTS,
        unit=known.unit if known is not None else after(unit_at(varied.paths[0], models)).strip() or None,
        geometric=geometric,
    )


def own_value(varied: Varied, models: Mapping[str, Model]) -> float | None:
    """The value that the unchanged system has, of a parameter that it does not set that of its FMU.

    None: it has no number there, or several.
    """
    path, *others = varied.paths
    if others or value_at(varied.system, path) is not None:
        return varied.own
    variable = _parameter_at(path, models)
    if variable is None or variable.kind != "Real" or variable.start is None:
        return None
    return float(variable.start)


def default_quantity(request: Request) -> str:
    """The default quantity: the period, or that of the only sampled component of a system.

    Raises `UsageError` for a system that has none or several, naming the periods.
    """
    if request.range_of(PERIOD) is not None:
        return PERIOD
    components = system_of(request).components.items()
    sampled = [(name, each.sampling) for name, each in components if each.sampling is not None]
    owners = [one.task if isinstance(one, TaskSampling) else f"components.{name}.sampling" for name, one in sampled]
    paths = [path for owner in owners if value_at(system_of(request), path := f"{owner}.{PERIOD}") is not None]
    if len(paths) != 1:
        listed = f", one of {', '.join(paths)}" if paths else ""
        raise UsageError(f"--of: expected a path, as connections.NAME.delay{listed}")
    return paths[0]


def _range_by_period(varied: Varied) -> Range | None:
    """The range of a period, jitter, delay or loss in a system, in periods as for the quadrotor; None: of others."""
    owner, _, name = varied.of.rpartition(".")
    is_task = owner.startswith("computers.")
    if name == PERIOD and (is_task or owner.endswith(".sampling")):
        period = float(value_at(varied.system, varied.of))
        return Range(first=period / 2.0, step=period / 2.0, last=50.0 * period, tolerance=period / 20.0)
    if name == "jitter" and owner.endswith(".sampling"):
        period = float(value_at(varied.system, f"{owner}.{PERIOD}"))
        return Range(first=0.0, step=period / 10.0, last=0.999 * period, tolerance=period / 100.0)
    ends = [x for x in varied.system.connections if owner == f"connections.{x.name}"]
    if name == "loss" and ends:
        length = ends[0].burst_length
        return Range(
            first=0.0, step=0.05, last=1.0 if length is None else length / (length + 1.0), tolerance=0.01, unit=None
        )
    periods = [
        float(sampling.true_period) / NANOSECONDS
        for x in ends
        for end in (x.sender, x.receiver)
        if (sampling := varied.system.components[end].sampling) is not None
    ]
    if name not in ("delay", "delay_jitter") or not periods or max(periods) == 0.0:
        return None
    most, unit = 50.0 if name == "delay" else 10.0, max(*periods, OWN * (varied.own or 0.0))
    return Range(first=0.0, step=unit / 2.0, last=most * unit, tolerance=unit / 20.0)


def unit_at(path: str, models: Mapping[str, Model]) -> str | None:
    """The unit of the value at a path of a system; None if it has none or is unknown."""
    if is_in_seconds(path):
        return "s"
    variable = _parameter_at(path, models)
    if variable is not None and variable.unit:
        return variable.unit
    if (of_signal := _OF_SIGNAL.fullmatch(path)) is not None:
        units = {
            variable.unit
            for model in models.values()
            for name, variable in model.variables.items()
            if name == of_signal[1] or name.startswith(f"{of_signal[1]}.")
        }
        return units.pop() if len(units) == 1 else None
    return None


def _parameter_at(path: str, models: Mapping[str, Model]) -> Variable | None:
    """The variable of the FMU of a component whose parameter is at a path; None: there is none."""
    prefixes = {f"components.{name}.parameters.": model for name, model in models.items()}
    found = (m.variables.get(path.removeprefix(prefix)) for prefix, m in prefixes.items() if path.startswith(prefix))
    return next(found, None)


_OF_SIGNAL = re.compile(r"connections\.[^.]+\.(?:noise|quantisation)\.(.+)")
"""A path of one signal of a connection, whose unit its value has"""


def paths_in(base: Request, target: str) -> tuple[str, ...]:
    """The paths of a target in the system of `base`; raises `UsageError` for an unknown target."""
    paths = base.paths_of(target)
    for path in paths:
        value_at(system_of(base), path)
    return paths
