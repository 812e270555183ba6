"""The criterion of a system: which runs are good, and which have diverged."""

from orchestration.foundation.basics.records import record
from orchestration.systems.system.requirements import require

DIVERGED, TERMINATED = "diverged", "terminated"
"""Outcomes whatever the criterion is: the run left the region of validity, or an FMU ended it"""


@record()
class Criterion:
    """The expressions by which a run is good, or has diverged."""

    good: str | None = None
    """The condition over objectives, at the end, by which a run is good; default: no run is judged."""
    diverged: str | None = None
    """The condition over signals that ends a run at the first instant at which it holds; default: none."""
    outcomes: tuple[str, str] = ("good", "bad")
    """The names of a good run and of one that is not; one that diverged or was terminated keeps that name."""

    def __post_init__(self) -> None:
        given = ", ".join(self.outcomes)
        two = len({*self.outcomes, DIVERGED, TERMINATED, ""}) == 5 and given.isprintable()
        require(two, "outcomes", ascii(given), f"two names, and neither is {DIVERGED} or {TERMINATED}")
