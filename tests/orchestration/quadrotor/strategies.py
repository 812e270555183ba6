"""What hypothesis draws from: timings of every kind, with horizons that keep a run short."""

from typing import Any, NamedTuple

from hypothesis import strategies as st

from orchestration.quadrotor.timing import Timing


class Case(NamedTuple):
    """A timing and how long to run it."""

    timing: Timing
    stop_time: float
    seed: int


def seconds(smallest: float, largest: float) -> st.SearchStrategy[float]:
    """Round decimals, which meet each other on the grid, and any other float, which hardly do."""
    unit = 10.0 ** len(str(int(1.0 / max(smallest, largest / 1000.0))))
    round_ones = st.integers(round(smallest * unit), max(round(smallest * unit), int(largest * unit)))
    return st.one_of(
        round_ones.map(lambda n: min(max(n / unit, smallest), largest)), st.floats(smallest, largest, width=64)
    )


@st.composite
def timings(draw: st.DrawFn, /, **fixed: Any) -> Timing:
    """Timings with everything that can go wrong at once; what is in `fixed` is as given."""
    period = fixed.get("period", draw(seconds(1e-4, 0.5)))
    ratio = fixed.get("clock_ratio", draw(st.sampled_from((1.0, 1.0, 0.5, 0.9999, 1.001, 1.7))))
    largest_jitter = 0.99 * period / ratio
    burst = draw(st.none() | st.floats(1.0, 20.0))
    most = 1.0 if burst is None else 0.999 * burst / (burst + 1.0)
    values = {
        "period": period,
        "offset": draw(st.just(0.0) | seconds(0.0, 3.0 * period)),
        "plant_interval": period * draw(st.sampled_from((0.1, 0.5, 1.0, 3.0)) | st.floats(0.05, 20.0)),
        "order": draw(st.sampled_from(("gauss-seidel", "jacobi"))),
        "delay": draw(st.just(0.0) | st.just(period) | seconds(0.0, 4.0 * period)),
        "delay_jitter": draw(st.just(0.0) | seconds(0.0, 3.0 * period)),
        "jitter": draw(st.just(0.0) | st.floats(0.0, largest_jitter)),
        "jitter_distribution": draw(st.sampled_from(("uniform", "normal"))),
        "measurement_loss": draw(st.just(0.0) | st.floats(0.0, most)),
        "command_loss": draw(st.just(0.0) | st.floats(0.0, most)),
        "burst_length": burst,
        "clock_ratio": ratio,
    }
    return Timing(**{**values, **fixed})


@st.composite
def cases(draw: st.DrawFn, /, **fixed: Any) -> Case:
    """A timing with a horizon of at most some thirty periods."""
    timing = draw(timings(**fixed))
    periods = draw(st.integers(1, 30).map(float) | st.floats(0.01, 30.0))
    return Case(timing, periods * timing.period, draw(st.integers(0, 2**32)))
