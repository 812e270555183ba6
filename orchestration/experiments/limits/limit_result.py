"""The result of the search for a limit, with all evaluated values."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from orchestration.experiments.limits.evaluation import Evaluation
from orchestration.foundation.basics.bisection import DIGITS, step_in_words
from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.interrupt import Interrupted
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.simulation.results import html

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.simulation.figures.style import Figures


@dataclass(frozen=True, kw_only=True)
class ContinuousRun:
    """The same flight near continuous time, without digital effects, to show what is not due to sampling."""

    period: float
    """Period [s]"""
    outcome: str
    settling_time: float | None
    """Settling time [s]"""


@dataclass(frozen=True, kw_only=True, repr=False)
class Limit:
    """The last good value of a quantity and the evidence for it, in the quantity's unit."""

    of: str
    """The quantity: a name, or a path."""
    unit: str | None = None
    """The unit of the quantity; None: it has none."""
    judged: str | None = None
    """The objective that the criterion judges; None: it judges none."""
    judged_unit: str | None = None
    """The unit of that objective; None: it has none."""
    judged_bound: float | None = None
    """The criterion's bound on that objective, in its unit; None: it has no plain bound."""
    local_limit: float | None
    """The value from which small errors about the operating point (hover) no longer decay; None: it is not defined, or
    not reached."""
    local_method: str | None = None
    """The method by which it was determined; None: it was not."""
    local_accuracy: float | None = None
    """Its accuracy, as far as the method provides it."""
    local_limit_outside: float | None
    """Likewise for the quadrotor, with the gain that the law has just outside its boundary layer; None also without
    such a layer."""
    local_lower_limit: float | None = None
    """The value below which, down from the system's own, small errors do not decay either; None: none was found."""
    mean_square_limit: float | None = None
    """The value just above which mean squares of the loop about its operating point have no finite expectation, as they
    may have again further above; None: nothing is random, or there is none in the range, or it is not known."""
    large_signal_limit: float | None
    """The last value that is good from the scenario's own initial state; None: no value in the range failed, or the
    first did."""
    large_signal_lower_limit: float | None = None
    """The lowest value that is good, down from the system's own, which is good, too; None: none below it failed, or the
    system's own is not good, or not in the range."""
    refuted_limit: float | None
    """The lowest evaluated value of a random quantity at which so many seeds fail that `RELIABILITY` is refuted at the
    confidence; None: nothing is random, or there is none in the range."""
    missed_deadlines_from: float | None = None
    """The lowest value, to the tolerance, at which tasks or messages miss deadlines; None: at no evaluated one."""
    missed_by: tuple[str, ...] = ()
    """The tasks and messages that miss them there."""
    follows: str = ""
    """The references and the components that follow them; empty if there are none."""
    horizon: float
    """The stop time [s], by which the criterion must be met."""
    tolerance: float
    """The width of the last bracket; of a geometric scan as a share of the value."""
    scan: float
    """The step of the scan; good or bad intervals between two of its values are not seen."""
    geometric: bool = False
    """Whether the scan is by equal factors, as over more than a decade: `scan` is one."""
    confidence: float | None
    """The confidence, for each value (not for the search), that at least `RELIABILITY` of all seeds are good; None:
    nothing is random."""
    seeds: int
    """The number of runs for each value, all of which must be good."""
    flies_above: tuple[float, ...]
    """Evaluated values above the limit that are good again."""
    continuous: ContinuousRun | None
    """The same flight near continuous time; None: not requested."""
    tried: tuple[Evaluation, ...]
    """All evaluated values, in rising order."""
    notes: tuple[str, ...]
    """Remarks beyond the verdict, a line each."""

    @property
    def resolution(self) -> tuple[str, str]:
        """The step of the scan and the tolerance, in words."""
        step = step_in_words(self.scan, self.unit, geometric=self.geometric)
        if self.geometric:
            return step, f"{100.0 * self.tolerance:g} %"
        return step, quantity(self.tolerance, self.unit, DIGITS, self.scan)

    @property
    def verdict(self) -> str:
        """The last good value, the first that is not and how it failed, and how finely that was searched."""

        def shown(value: float) -> str:
            return quantity(value, self.unit, DIGITS)

        step, tolerance = self.resolution
        resolution = f"scan {'by ' if self.geometric else ''}{step}, tolerance {tolerance}"
        seeds = f", all of {self.seeds} seeds" if self.seeds > 1 else ""

        def how(one: Evaluation) -> str:
            return one.outcome if one.unmet is None else f"{one.outcome}, {one.unmet}"

        def failing(one: Evaluation) -> str:
            at = shown(one.value)
            return f"diverges at {at}" if how(one) == "diverged" else f"not at {at}: {how(one)}"

        low, good = self.large_signal_lower_limit, self.large_signal_limit
        failed = [one for one in self.tried if not one.is_good]
        under = [one for one in failed if low is not None and one.value < low][-1:]
        over = [one for one in failed if (low is None or one.value > low) and (good is None or one.value > good)][:1]
        again = f"; good again at {some(map(shown, self.flies_above))}" if self.flies_above else ""
        if self.missed_deadlines_from is not None:
            again += f"; deadlines of {some(self.missed_by)} are missed already at {shown(self.missed_deadlines_from)}"
        if over and good is None:
            begins = f"not good even at {shown(over[0].value)}, where the scan begins: {how(over[0])}"
            return f"{self.of} {begins}{again} ({resolution})"
        start = "" if low is None else f" from {shown(low)}"
        if good is None:
            start = start or " throughout the scan,"
            good = self.tried[-1].value
        fails = "".join(f"; {failing(one)}" for one in (*over, *under))
        return f"{self.of} good{start} up to {shown(good)}{seeds}{fails}{again} ({resolution})"

    def __repr__(self) -> str:
        return f"<Limit: {self.verdict}>"

    def _repr_html_(self) -> str:
        """The form that notebooks show."""
        limits = {
            "last value that is good": self.large_signal_limit,
            "lowest value that is good": self.large_signal_lower_limit,
            "local limit, of small errors at rest": self.local_limit,
            "mean-square limit": self.mean_square_limit,
            "refuted from": self.refuted_limit,
        }
        rows = [(name, html.number(value), "" if value is None else self.unit or "") for name, value in limits.items()]
        rows.append(("values tried", str(len(self.tried)), ""))
        return html.card(f"The limit of {self.of}", None, None, "; ".join((self.verdict, *self.notes)), rows)

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """The figure of the measurements over the quantity, with both limits; a notebook shows it.

        `style` sets its size and fonts. Raises `UsageError` for an unknown style.
        """
        from orchestration.experiments.limits.figure import limit_figure
        from orchestration.simulation.figures.style import Figures, style_named

        chosen = style_named(style)
        with chosen.applied():
            return Figures({"limit": limit_figure(self, chosen)}, chosen)

    @explains_missing
    def to_pandas(self) -> "pd.DataFrame":
        """A row for each evaluated value, in rising order: outcome, and numbers of seeds run and good."""
        import pandas as pd

        return pd.DataFrame([vars(one) for one in self.tried])


class LimitInterrupted(Interrupted):
    """Ctrl-C, once all is measured: this `result` is without what theory has not found yet."""

    def __init__(self, text: str, result: Limit) -> None:
        super().__init__(text)
        self.result = result


_ALWAYS = ("local_limit", "large_signal_limit")
"""Fields that are shown also where they have no value"""
_IN_ITS_UNIT = (
    *_ALWAYS, "local_limit_outside", "local_accuracy", "local_lower_limit", "mean_square_limit",
    "large_signal_lower_limit", "refuted_limit", "missed_deadlines_from",
)  # fmt: skip
"""Fields in the unit of the quantity"""
_HIDDEN = ("unit", "judged_unit", "geometric", "notes")


def as_text(limit: Limit) -> dict[str, str]:
    """The applicable fields of a limit as text; of the evaluated values their number."""
    units = {**dict.fromkeys(_IN_ITS_UNIT, limit.unit), "judged_bound": limit.judged_unit, "horizon": "s"}
    known = {name: value for name, value in vars(limit).items() if value not in (None, "", ())}
    texts = dict.fromkeys((name for name in vars(limit) if name in (*known, *_ALWAYS) and name not in _HIDDEN), "-")
    for name in texts.keys() & known.keys():
        value = known[name]
        texts[name] = quantity(value, units.get(name), DIGITS) if isinstance(value, float) else str(value)
    texts |= dict(zip(("scan", "tolerance"), limit.resolution))
    if limit.flies_above:
        texts["flies_above"] = ", ".join(quantity(value, limit.unit, DIGITS) for value in limit.flies_above)
    if limit.missed_by:
        texts["missed_by"] = ", ".join(limit.missed_by)
    if (ideal := limit.continuous) is not None:
        settles = "" if ideal.settling_time is None else f", within 5 cm from {ideal.settling_time:.6g} s on"
        texts["continuous"] = f"{ideal.outcome} at a period of {quantity(ideal.period, 's')}{settles}"
    texts["tried"] = f"{len(limit.tried)} values"
    return texts


def shares_as_text(limit: Limit) -> list[list[str]]:
    """A table of the evaluated values with their good seeds, and the share with its interval where all were run.

    Empty where nothing is random.
    """
    if limit.confidence is None:
        return []
    rows = []
    for one in limit.tried:
        good, share = f"{one.flew} of the first {one.runs}", "-"
        if one.share is not None:
            low, high = one.share
            good, share = f"{one.flew}", f"{one.flew / one.runs:.2f} [{low:.2f}, {high:.2f}]"
        rows.append([quantity(one.value, limit.unit, DIGITS), good, share])
    return [[limit.of, f"good of {limit.seeds}", f"share [{100.0 * limit.confidence:g} % Wilson interval]"], *rows]
