"""What hypothesis draws from: timings of every kind, with horizons that keep a run short."""

from typing import Any, NamedTuple, get_args

from hypothesis import strategies as st

from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.systems.system.choices import Spread


class Case(NamedTuple):
    """A timing and how long to run it."""

    timing: Timing
    stop_time: float
    seed: int


BOOLEANS = st.booleans()
ONE_IN_THREE = st.sampled_from((False, False, True))
RATIOS = st.sampled_from((1.0, 1.0, 0.5, 0.9999, 1.001, 1.7))
BURSTS = st.none() | st.floats(1.0, 20.0)
INTERVALS = st.sampled_from((0.1, 0.5, 1.0, 3.0)) | st.floats(0.05, 20.0)
ORDERS = st.sampled_from(("gauss-seidel", "jacobi"))
DISTRIBUTIONS = st.sampled_from(get_args(Spread))
PERIODS = st.integers(1, 30).map(float) | st.floats(0.01, 30.0)
SEEDS = st.integers(0, 2**32)


def seconds(draw: st.DrawFn, smallest: float, largest: float) -> float:
    """Round decimals, which meet each other on the grid, and any other float, which hardly do."""
    if draw(BOOLEANS):
        return draw(st.floats(smallest, largest, width=64))
    unit = 10.0 ** len(str(int(1.0 / max(smallest, largest / 1000.0))))
    n = draw(st.integers(round(smallest * unit), max(round(smallest * unit), int(largest * unit))))
    return min(max(n / unit, smallest), largest)


@st.composite
def timings(draw: st.DrawFn, /, **fixed: Any) -> Timing:
    """Timings with everything that can go wrong at once; what is in `fixed` is as given."""

    def up_to(largest: float) -> float:
        return draw(st.floats(0.0, largest)) if draw(BOOLEANS) else 0.0

    def seconds_up_to(largest: float) -> float:
        return seconds(draw, 0.0, largest) if draw(BOOLEANS) else 0.0

    period = fixed["period"] if "period" in fixed else seconds(draw, 1e-4, 0.5)
    ratio = fixed.get("clock_ratio", draw(RATIOS))
    burst = draw(BURSTS)
    most = 1.0 if burst is None else 0.999 * burst / (burst + 1.0)
    values = {
        "period": period,
        "offset": seconds_up_to(3.0 * period),
        "plant_interval": period * draw(INTERVALS),
        "order": draw(ORDERS),
        "delay": period if draw(ONE_IN_THREE) else seconds_up_to(4.0 * period),
        "delay_jitter": seconds_up_to(3.0 * period),
        "jitter": up_to(0.99 * period / ratio),
        "jitter_distribution": draw(DISTRIBUTIONS),
        "measurement_loss": up_to(most),
        "command_loss": up_to(most),
        "burst_length": burst,
        "clock_ratio": ratio,
    }
    return Timing(**{**values, **fixed})


@st.composite
def cases(draw: st.DrawFn, /, **fixed: Any) -> Case:
    """A timing with a horizon of at most some thirty periods."""
    timing = draw(timings(**fixed))
    return Case(timing, draw(PERIODS) * timing.period, draw(SEEDS))
