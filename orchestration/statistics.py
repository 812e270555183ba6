"""What a number of trials says about a share: its interval, and what it refutes."""

import math
from statistics import NormalDist

from orchestration.errors import UsageError


def wilson(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval for a share of which `successes` in `trials` were seen, as (low, high).

    Two-sided: the share lies below `low` and above `high` with (1 - confidence)/2 each. It stays in [0, 1]
    and has a width at 0 and at `trials` successes too. Raises `UsageError` for numbers that cannot be.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise UsageError(f"{successes} of {trials}: expected at least one trial and no more successes than trials")
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"confidence {confidence}: expected a number between 0 and 1")
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    share = successes / trials
    middle = share + z * z / (2.0 * trials)
    half = z * math.sqrt(share * (1.0 - share) / trials + z * z / (4.0 * trials * trials))
    scale = 1.0 + z * z / trials
    # At the ends the bound is 0 or 1 exactly; in floats it may miss it by a rounding.
    low = 0.0 if successes == 0 else (middle - half) / scale
    high = 1.0 if successes == trials else (middle + half) / scale
    return low, high


def refutes(successes: int, trials: int, share: float, confidence: float) -> bool:
    """Whether `successes` in `trials` are too few for a share that large, by the exact binomial test at `confidence`.

    That is, with such a share so few or fewer would be seen with a probability of at most 1 - confidence.
    """
    tail = sum(math.comb(trials, k) * share**k * (1.0 - share) ** (trials - k) for k in range(successes + 1))
    return tail <= 1.0 - confidence
