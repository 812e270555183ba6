"""Two quantities that vary at once: pairs of values that are certified, and pairs that break the loop."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from fmu_kit.new_files import new_files, write_atomically
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import needs
from orchestration.foundation.basics.terminal import ShareProgress, share_reporter
from orchestration.foundation.basics.times import floor_to_nanoseconds
from orchestration.simulation.figures.palette import BLUE, RED
from orchestration.simulation.figures.style import SCREEN, Style, save
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.simulation.results import display_names as labels
from orchestration.systems.system.request import system_of
from orchestration.theory.certificates import margin
from orchestration.theory.certificates.breaking import BreakingSequence, least_breaking, unstable_sequence
from orchestration.theory.certificates.certified_loop import LOSS
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.timeline import LoopTimeline
from orchestration.theory.stability.in_double import are_in_double, of_code
from orchestration.theory.stability.operating_point import inform_of_chance

COLUMNS = 6
"""values of the first quantity, from 0 to the one that alone breaks the loop"""
SHARES = (0.95, 0.98)
"""Shares of the breaking value: tried for a certificate, as of one quantity"""
LONGEST_SEQUENCE = 4
"""draws after which the tried sequences repeat"""

Pair = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Region:
    """Pairs of values [s]: at each draw both quantities are anywhere from 0 to theirs."""

    of: tuple[str, str]
    """The paths of the varying quantities."""
    certified: tuple[Pair, ...]
    """Pairs for which a proof was found, which covers all pairs smaller in both."""
    breaking: tuple[Pair, ...]
    """Pairs at which a periodic sequence was found that makes the loop unstable, the second value being the least."""
    searched: str
    """Sequences that were tried for `breaking`, as text."""
    states: int
    """The size of the state from period to period."""
    certificates: tuple[str, ...]
    """The proofs, one for each certified pair, as the texts of files that `check` verifies."""
    in_double: tuple[str, ...] = ()
    """The components whose float code in C is taken in double precision."""

    @property
    def verdict(self) -> str:
        """How many pairs of values are proved stable, and how many break the loop."""
        counts = f"{len(self.certified)} pairs are proved stable, {len(self.breaking)} break the loop"
        return f"{counts} (small deviations{of_code(self.in_double)})"

    def save(self, folder: str | Path, style: Style = SCREEN) -> list[Path]:
        """Write the certificates, `1.json` and so on, and the figure, into a folder; the paths."""
        folder = Path(folder)
        with style.applied():
            figure = self.figure(style)
        with new_files(folder) as new:
            written = [new / f"{i}.json" for i in range(1, len(self.certificates) + 1)]
            for path, text in zip(written, self.certificates):
                write_atomically(path, text)
            written += save({"region": figure}, new, style)
        return [folder / path.name for path in written]

    def figure(self, style: Style = SCREEN) -> Figure:
        """The pairs that are certified, and those that break the loop."""
        figure = style.figure(38.0)
        axes = figure.add_subplot()
        certified = [(1e3 * a, 1e3 * b) for a, b in self.certified]
        if len(certified) > 1:
            heights = [max(b for _, b in certified[i:]) for i in range(1, len(certified))]
            axes.stairs(
                heights, [0.0, *(a for a, _ in certified[1:])], fill=True, color=BLUE, alpha=0.25, label="certified"
            )
        axes.plot([a for a, _ in certified], [b for _, b in certified], ".", color=BLUE, clip_on=False)
        if self.breaking:
            broken = zip(*[(1e3 * a, 1e3 * b) for a, b in self.breaking])
            axes.plot(*broken, "x-", color=RED, label="a sequence breaks it", clip_on=False)
        across, up = (labels.with_unit(labels.setting(path), "ms") for path in self.of)
        axes.set(xlabel=across, ylabel=up, xlim=(0.0, None), ylim=(0.0, None))
        figure.legend(loc="outside lower center", ncols=2)
        return figure


@needs("flint", "clarabel")
def margin_region(
    request: RequestLike, of: str, and_of: str, *, columns: int = COLUMNS, progress: ShareProgress = None
) -> Region:
    """How far two quantities of a system may vary at once, as `margin`; both are paths of times.

    Raises `UsageError` as `margin` does, for two quantities of different sampled components, and for a loop that is
    unstable without either.
    """
    request = request_of(request)
    pair = [margin.varying_of(request, each) for each in (of, and_of)]
    if any(each.kind == LOSS for each in pair) or pair[0] == pair[1]:
        raise UsageError(f"--of {of} --and {and_of}: expected two different jitters or delay jitters")
    margin.expect_without_scheduler(request)
    inform_of_chance(system_of(request), but=[each.path for each in pair], includes=margin.ELSEWHERE)
    timeline = LoopTimeline(margin.linear_loop_of(request), pair)
    if unstable_sequence(timeline.family([0.0, 0.0])) is not None:
        raise UsageError("the loop is unstable where nothing varies, so nothing can be certified")
    if too_large := margin.not_sought_for(timeline.family([0.0, 0.0])):
        raise UsageError(f"no proof is sought: {too_large}")
    paths = (pair[0].path, pair[1].path)
    with share_reporter(progress, "certifying", steady=False) as report:
        widest = _least_breaking(timeline, 0.0, first=True)
        most = floor_to_nanoseconds(timeline.largest()) if widest is None else widest.value
        certified, breaking, texts = list[Pair](), list[Pair](), list[str]()
        for i in range(columns):
            report(i / columns)
            a = floor_to_nanoseconds(most * i / columns)
            broken = _least_breaking(timeline, a)
            top = floor_to_nanoseconds(timeline.largest() - a) if broken is None else broken.value
            if broken is not None:
                breaking.append((a, broken.value))
            b, text, _ = margin.largest_certified(_second_varies(timeline, a), paths, top, lambda share: None, SHARES)
            if b is not None and text is not None:
                certified.append((a, b))
                texts.append(text)
    return Region(
        of=paths, certified=tuple(certified), breaking=tuple(breaking), certificates=tuple(texts),
        in_double=are_in_double(timeline.loop.system.components),
        states=len(timeline.family([0.0, 0.0]).kept),
        searched=f"draws at either end of both ranges, sequences that repeat after at most {LONGEST_SEQUENCE}",
    )  # fmt: skip


def _second_varies(timeline: LoopTimeline, a: float) -> Callable[[float], LoopFamily]:
    return lambda b: timeline.family([a, b])


def _least_breaking(timeline: LoopTimeline, other: float, *, first: bool = False) -> BreakingSequence | None:
    """What breaks the loop in one quantity, the other one varying up to its value."""

    def up_to(value: float) -> LoopFamily:
        return timeline.family([value, other] if first else [other, value])

    return least_breaking(up_to, floor_to_nanoseconds(timeline.largest() - other), LONGEST_SEQUENCE)
