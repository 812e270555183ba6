"""The criterion of a system: which runs are good, and which have diverged."""

from orchestration.basics.records import record
from orchestration.system.requirements import require

DIVERGED, TERMINATED = "diverged", "terminated"
"""What a run is called, whatever its criterion is, that left the region that counts, or that an FMU has ended"""


@record()
class Criterion:
    """What a good run is, as expressions."""

    good: str | None = None
    """The condition over objectives, at the end, by which a run is good; without it, that is not asked."""
    diverged: str | None = None
    """The condition over signals that ends a run at the first instant at which it holds; without it, none does."""
    outcomes: tuple[str, str] = ("good", "bad")
    """What a run is called that is good, and one that is not; one that diverged, or was terminated, is called so."""

    def __post_init__(self) -> None:
        given = ", ".join(self.outcomes)
        two = len({*self.outcomes, DIVERGED, TERMINATED, ""}) == 5 and given.isprintable()
        require(two, "outcomes", ascii(given), f"two names, and neither is {DIVERGED} or {TERMINATED}")
