"""The figure of a limit: what was measured at each value, where it ceases to be good, and where theory says so."""

import contextlib
import re
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.building.inputs import files_of
from orchestration.figures.palette import BLUE, GREY, ORANGE, RED
from orchestration.figures.style import SCREEN, Style
from orchestration.fmi.foreign import LostError, isolated_call
from orchestration.limits.evaluation import RELIABILITY, Evaluation
from orchestration.limits.found import Found
from orchestration.results import display_names as labels
from orchestration.results import quantities
from orchestration.results.quantities import Quantity
from orchestration.stability.known_loops import LOOPS, KnownLoop
from orchestration.studies import figures
from orchestration.system.request import Request, system_of

DIGITS = 4
"""of what is said of a value"""


def measured(found: Found, style: Style = SCREEN) -> Figure:
    """What the criterion is about over the quantity, or the share of good seeds, with the limits."""
    across = _quantity(found)
    figure = style.figure(38.0)
    axes = figure.add_subplot()
    if found.confidence is None:
        _values(axes, found, across)
    else:
        _shares(axes, found, across)
    axes.set_xlim(_with_margin([one.value * across.factor for one in found.tried]))
    _limits(axes, found, across)
    axes.set_xlabel(across.title)
    axes.set_title(_title(found, across), loc="left")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def _values(axes: Axes, found: Found, across: Quantity) -> None:
    """One run a value: what the criterion is about, or good and not good where that has no value."""
    known = [one for one in found.tried if one.measured is not None]
    if not known:
        _drawn(axes, found.tried, [float(is_good(one)) for one in found.tried], across)
        axes.set(yticks=(0.0, 1.0), yticklabels=("not good", "good"), ylim=(-0.3, 1.3))
        return
    _drawn(axes, known, [one.measured or 0.0 for one in known], across)
    down = [one.value * across.factor for one in found.tried if one.measured is None]
    axes.plot(
        down, np.full(len(down), 0.97), "^", color=RED, transform=axes.get_xaxis_transform(),
        label="diverged" if down else None,
    )  # fmt: skip
    bound = found.judged_bound
    if bound is not None:
        axes.axhline(
            bound,
            color=GREY,
            linewidth=1.0,
            linestyle=":",
            label=f"the criterion's bound, {Quantity(name='', unit=found.judged_unit).text_of(bound, DIGITS)}",
        )
    values = [one.measured or 0.0 for one in known]
    if min(values) > 0.0 and max(values) > 20.0 * min(values):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("" if max(values) > 100.0 * min(values) else "{x:g}")
    axes.set_ylabel(labels.with_unit(labels.metric(found.judged or ""), found.judged_unit))


def _shares(axes: Axes, found: Found, across: Quantity) -> None:
    """Many runs a value: the share of seeds that are good, with its interval where all were run."""
    shares = [one.flew / one.runs for one in found.tried]
    _drawn(axes, found.tried, shares, across)
    known = [one for one in found.tried if one.share is not None]
    low, high = (np.array([one.share[side] for one in known if one.share is not None]) for side in (0, 1))
    middle = np.array([one.flew / one.runs for one in known])
    apart = np.maximum(np.array([middle - low, high - middle]), 0.0)
    axes.errorbar(
        [one.value * across.factor for one in known], middle, apart, fmt="none", ecolor=GREY, capsize=2,
        label=f"{found.confidence:.0%} interval",
    )  # fmt: skip
    axes.axhline(RELIABILITY, color=GREY, linewidth=1.0, linestyle=":", label=f"{RELIABILITY:.0%} of the seeds")
    axes.set(ylabel=f"share of {found.seeds} seeds that are good", ylim=(-0.05, 1.08))


def _drawn(
    axes: Axes, tried: "list[Evaluation] | tuple[Evaluation, ...]", heights: list[float], across: Quantity
) -> None:
    """A mark a value: dots where all runs were good, crosses where not."""
    for good, mark, color, label in ((True, "o", BLUE, "good"), (False, "X", RED, "not good")):
        chosen = [i for i, one in enumerate(tried) if is_good(one) is good]
        x, y = [tried[i].value * across.factor for i in chosen], [heights[i] for i in chosen]
        axes.plot(x, y, mark, color=color, markersize=6, label=label if chosen else None)


def is_good(tried: Evaluation) -> bool:
    """Whether all runs at a value were."""
    return tried.flew == tried.runs


def _limits(axes: Axes, found: Found, across: Quantity) -> None:
    """The limits as lines, and what lies beyond the measured one shaded."""
    named = (
        (found.large_signal_limit, RED, "-", "measured limit"),
        (found.local_limit, ORANGE, "--", "local limit, by theory"),
        (found.refuted_limit, GREY, "-.", f"{RELIABILITY:.0%} refuted"),
    )
    left, right = axes.get_xlim()
    for limit, color, style, name in named:
        at = None if limit is None else limit * across.factor
        if limit is not None and at is not None and left <= at <= right:
            axes.axvline(at, color=color, linestyle=style, label=f"{name}  {across.text_of(limit, DIGITS)}")
    if found.large_signal_limit is not None:
        axes.axvspan(found.large_signal_limit * across.factor, right, color=RED, alpha=0.06, linewidth=0.0)


def _title(found: Found, across: Quantity) -> str:
    what, until = across.name, f", in runs of {found.horizon:g} s"
    if found.large_signal_limit is not None:
        return f"Good up to {across.text_of(found.large_signal_limit, DIGITS)}: {what}{until}"
    first = found.tried[0]
    return f"{what}: {'good throughout' if is_good(first) else 'never good'}{until}"


def _quantity(found: Found) -> Quantity:
    return quantities.setting(found.of, [one.value for one in found.tried], found.unit)


def _with_margin(values: list[float]) -> tuple[float, float]:
    room = 0.03 * (max(values) - min(values)) or 1.0
    return min(values) - room, max(values) + room


def draw_limit(request: Request, found: Found, folder: Path, style: Style = SCREEN) -> list[Path]:
    """Draw what was measured, with both limits, and the spectral radius where a loop is known over the quantity."""
    name = "limit_" + re.sub(r"[^A-Za-z0-9]+", "_", found.of).strip("_")
    written = figures.save(lambda how: measured(found, how), folder / name, style)
    with contextlib.suppress(UsageError, LostError):  # where linear theory does not apply, or its process is lost
        written += draw_spectral_radius(request, found, folder, style)
    return written


def draw_spectral_radius(request: Request, found: Found, folder: Path, style: Style = SCREEN) -> list[Path]:
    """Draw the spectral radius of the loop over the quantity; the paths of the figure, none where no loop is known.

    Raises `UsageError` where linear theory does not apply, and `LostError` as `computed` does.
    """
    known = LOOPS.of(request.kind)
    if known is None:
        return []
    ends = [limit for limit in (found.local_limit, found.large_signal_limit) if limit is not None]
    last = 1.3 * max(ends, default=0.1)
    values = np.array([0.001 + i / 199.0 * (last - 0.001) for i in range(200)])
    radii = isolated_call(files_of(system_of(request)).fmus.values(), _radii, known, request, found.of, values)
    return (
        []
        if radii is None
        else figures.save(
            lambda how: figures.spectral_radius(
                found.of,
                values,
                radii,
                local_limit=found.local_limit,
                large_signal_limit=found.large_signal_limit,
                style=how,
            ),
            folder / f"spectral_radius_{found.of}",
            style,
        )
    )


def _radii(known: KnownLoop, request: Request, of: str, values: Floats) -> Floats | None:
    """The spectral radius at each value; None for a quantity that the loop is not known over."""
    radius = known.radius_over(request, of)
    return None if radius is None else np.array([radius(value) for value in values])
