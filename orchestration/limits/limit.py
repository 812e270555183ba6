"""The largest value of a quantity that is still good: measured, and beside it the local limit."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from orchestration.basics.bisection import Bracket, Range, bisected, first_failure
from orchestration.basics.errors import UsageError
from orchestration.basics.extras import explains_missing
from orchestration.basics.progress import ShareProgress, share_reporter
from orchestration.basics.terminal import inform
from orchestration.building.inputs import Files, files_of
from orchestration.engines.engine import Engine
from orchestration.engines.wiring import check_against_fmus
from orchestration.exact.mean_square import MeanSquareLimit, mean_square_limit
from orchestration.fmi.foreign import LostError, isolated_call
from orchestration.limits.evaluation import RELIABILITY, Evaluator, said
from orchestration.limits.found import Continuous, Found
from orchestration.requests.ranges import Varied, default_quantity, search_range
from orchestration.requests.request import RequestLike, request_of
from orchestration.results import html
from orchestration.results.criterion import bound_of, judged_objective
from orchestration.stability.known_loops import LocalLimit
from orchestration.stability.local_limit import local_limits
from orchestration.system.chance import has_random_timing, is_random
from orchestration.system.request import Request, errors_in_own_terms, system_of
from orchestration.workers.choice import single_run_execution
from orchestration.workers.executors import RunEvaluator

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.figures.gallery import Figures

GAP = 0.1
"""of the local limit: a larger difference to the large-signal one is worth saying"""
FINER = 5
"""parts of the step of the scan within the bracket"""
BEYOND = 4
"""values of the scan that are tried beyond the first that fails"""
CONTINUOUS = 1e-4
"""[s], the period of the flight that stands for continuous time"""


@dataclass(frozen=True, kw_only=True, repr=False)
class Limit(Found):
    """The last value that is good (of the quadrotor: flies) and what it rests on; in the quantity's unit."""

    def __repr__(self) -> str:
        return f"<Limit of {self.of}: {self.note}>"

    def _repr_html_(self) -> str:
        """As notebooks show it."""
        found = {
            "last value that is good": self.large_signal_limit,
            "local limit, of small errors at rest": self.local_limit,
            "mean-square limit": self.mean_square_limit,
            "refuted from": self.refuted_limit,
        }
        rows = [(name, html.number(value), "" if value is None else self.unit or "") for name, value in found.items()]
        return html.card(
            f"The limit of {self.of}", None, None, self.note, [*rows, ("values tried", str(len(self.tried)), "")]
        )

    @explains_missing
    def plot(self, *, style: Literal["screen", "paper", "slides"] = "screen") -> "Figures":
        """The figure of what was measured over the quantity, with both limits; a notebook shows it.

        `style` is how large and in what type it is. Raises `UsageError` for a style that there is not.
        """
        from orchestration.figures.gallery import Figures
        from orchestration.figures.style import style_named
        from orchestration.limits import figure as limit_figure

        chosen = style_named(style)
        with chosen.applied():
            return Figures({"limit": limit_figure.measured(self, chosen)}, chosen)

    @explains_missing
    def to_pandas(self) -> "pd.DataFrame":
        """A row for each value that was tried, upward: outcome, and how many seeds were run and good."""
        import pandas as pd

        return pd.DataFrame([vars(one) for one in self.tried])


@explains_missing
def find(
    asked: RequestLike,
    of: str | None = None,
    *,
    first: float | None = None,
    last: float | None = None,
    tolerance: float | None = None,
    scan: float | None = None,
    confidence: float = 0.95,
    continuous: bool = False,
    workers: int = 1,
    engine: Engine | Literal["auto"] = "auto",
    progress: ShareProgress = "bar",
    announce: Callable[[str], None] | None = inform,
) -> Limit:
    """Find the largest value of a quantity of a system or a scenario that is still good, all else as it is.

    `of` is a path, or of the quadrotor `period`, `delay`, `jitter` or `loss`; without it, the period of the only
    component that is sampled. It is looked for from `first` to `last`, `scan` is the step, `continuous` adds that
    flight (of the quadrotor). The seeds of a random quantity are flown by `workers` processes. The engine `auto` takes
    native twins of the FMUs where they can be had. `progress` hears the share that is done of a search in which nothing
    fails before the end of the scan, `announce` what flies and a line for each value that was tried; None for silence.

    Raises `UsageError` for a quantity, range, tolerance, step or confidence that cannot be.
    """
    request, how = single_run_execution(request_of(asked), engine)
    of = of or default_quantity(request)
    varied, files = _checked(request, of, confidence)
    near = request.near_continuous(CONTINUOUS) if continuous else None
    if continuous and near is None:
        raise UsageError("--continuous: for the quadrotor only")
    models = files.models_of(varied.system)
    span = search_range(varied, models, first=first, last=last, tolerance=tolerance, scan=scan)
    with errors_in_own_terms(request):
        fitting = [check_against_fmus(varied.at(value), models) for value in span.values()]
    units, metric = fitting[0].units, judged_objective(varied.system)
    random = is_random(varied.at(span.last))
    seeds = math.ceil(math.log(1.0 - confidence) / math.log(RELIABILITY)) if random else 1
    local = _local(varied, span, files)
    mean_square = _mean_square(varied, span, files, local) if random else MeanSquareLimit()
    with share_reporter(progress, "longest search") as hear, RunEvaluator(files, workers, how.engine) as pool:
        tell = announce or (lambda line: None)
        if engine == "auto":
            tell(str(how))
        trials = Evaluator(varied, span, seeds, confidence if random else None, units, pool, tell, hear)
        values = span.values()
        bracket = first_failure(
            trials.fails, values, span.tolerance, parts=FINER, remaining=lambda most: trials.expect(most + BEYOND)
        )
        above = [value for value in values if bracket is not None and value >= bracket.bad]
        refuted = _refuted(trials, bracket, above) if random else None
        if not random:
            beyond = [value for value in above if value not in trials.tried][:BEYOND]
            for i, value in enumerate(beyond, start=1):
                trials.expect(len(beyond) - i)
                trials.fails(value)
        ideal = _flown(near, pool) if near is not None else None
        hear(1.0)
    note = [*_note(span, bracket, trials, refuted, local), *_note_of(mean_square, span)]
    tried = tuple(trials.tried[value] for value in sorted(trials.tried))
    return Limit(
        of=of, unit=span.unit.strip() or None, judged=metric, judged_unit=units.get(metric or ""),
        judged_bound=None if metric is None else bound_of(varied.system, metric),
        local_limit=local.limit, local_limit_outside=local.outside, local_method=local.method,
        local_accuracy=local.accuracy, mean_square_limit=mean_square.limit,
        large_signal_limit=None if bracket is None else bracket.good,
        refuted_limit=refuted, follows=fitting[0].follows, horizon=varied.system.stop_time, tolerance=span.tolerance,
        scan=span.step, confidence=confidence if random else None, seeds=seeds,
        flies_above=tuple(
            one.value for one in tried if bracket is not None and one.value > bracket.bad and one.flew == seeds
        ),
        continuous=ideal, tried=tried, note="; ".join(note),
    )  # fmt: skip


def _checked(request: Request, of: str, confidence: float) -> tuple[Varied, Files]:
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"--confidence {confidence}: expected a number between 0 and 1")
    varied = Varied(request=request, of=of)
    if varied.system.criterion.good is None:
        raise UsageError("criterion.good: expected in the system file, for it says what the limit is of")
    return varied, files_of(varied.system)


def _local(varied: Varied, span: Range, files: Files) -> LocalLimit:
    try:
        return isolated_call(files.fmus.values(), local_limits, varied, span)
    except LostError as error:
        return LocalLimit(reason=f"no local limit: {error}")


def _mean_square(varied: Varied, span: Range, files: Files, local: LocalLimit) -> MeanSquareLimit:
    """Noise alone is added to a loop that it does not change: means of squares then have no end where errors grow."""
    if local.limit is not None and not has_random_timing(varied.at(span.last)):
        return MeanSquareLimit(limit=local.limit)
    try:
        return isolated_call(files.fmus.values(), mean_square_limit, varied, span, files.models_of(varied.system))
    except LostError as error:
        return MeanSquareLimit(reason=f"no mean-square limit: {error}")


_ALWAYS = ("local_limit", "large_signal_limit")
"""What is asked for: told also where there is none"""


def as_text(found: Limit) -> dict[str, str]:
    """The fields of a limit that apply, in words; of the values tried, those for which the share of seeds is known."""
    told = {name: value for name, value in vars(found).items() if value not in (None, "", ())}
    shown = {name: str(told[name]) if name in told else "-" for name in vars(found) if name in (*told, *_ALWAYS)}
    if found.flies_above:
        shown["flies_above"] = ", ".join(f"{value:.6g}" for value in found.flies_above)
    if (ideal := found.continuous) is not None:
        settles = "" if ideal.settling_time is None else f", within 5 cm from {ideal.settling_time:.6g} s on"
        shown["continuous"] = f"{ideal.outcome} at a period of {ideal.period:g} s{settles}"
    known = [f"{one.value:.6g}: {said(one)}" for one in found.tried if one.share is not None]
    shown["tried"] = "; ".join(known) or f"{len(found.tried)} values"
    return shown


def _note_of(found: MeanSquareLimit, span: Range) -> list[str]:
    """What a mean over runs means: it has no finite expectation from the mean-square limit on."""
    if found.limit is not None:
        return [f"from {found.limit:.6g}{span.unit} on means of squares have no finite expectation"]
    return [found.reason] if found.reason else []


def _refuted(trials: Evaluator, bracket: Bracket | None, above: list[float]) -> float | None:
    """The lowest value found at which it is refuted that `RELIABILITY` of the seeds fly."""
    if bracket is None:
        return None
    below = bracket.good
    for i, value in enumerate(above, start=1):
        trials.expect(len(above) - i)
        if trials.is_refuted(value):
            if below is None:
                return value
            return bisected(trials.is_refuted, below, value, trials.tolerance, remaining=trials.expect).bad
        below = value
    return None


def _flown(near: Request, pool: RunEvaluator) -> Continuous:
    """What comes of a run near continuous time."""
    (metrics,) = pool.run_until([system_of(near)], stop=lambda metrics: False)
    return Continuous(period=CONTINUOUS, outcome=metrics["outcome"], settling_time=metrics["settling_time"])


def _note(
    span: Range, bracket: Bracket | None, trials: Evaluator, refuted: float | None, found: LocalLimit
) -> list[str]:
    local = found.limit
    if bracket is None:
        parts = [f"good throughout the range, to {span.last:g}{span.unit}"]
    elif bracket.good is None:
        fell = said(trials.tried[bracket.bad])
        parts = [f"not good at {bracket.bad:g}{span.unit}, the first value of the range ({fell})"]
    else:
        fell = said(trials.tried[bracket.bad])
        parts = [f"good at {bracket.good:.6g}{span.unit} and not at {bracket.bad:.6g}{span.unit} ({fell})"]
    if refuted is not None:
        parts.append(
            f"that nine seeds in ten are good is refuted at {refuted:.6g}{span.unit}: {said(trials.tried[refuted])}"
        )
    parts.append(f"what is narrower than the scan, {span.step:g}{span.unit}, is not seen")
    if local is None:
        return [*parts, found.reason]
    measured = None if bracket is None else bracket.good
    if measured is None:
        return [*parts, f"the local limit is {local:.6g}{span.unit}"]
    if abs(measured - local) > GAP * local:
        return [*parts, f"more than a tenth from the local limit of {local:.6g}{span.unit}: large signals decide"]
    return [*parts, f"within a tenth of the local limit of {local:.6g}{span.unit}"]
