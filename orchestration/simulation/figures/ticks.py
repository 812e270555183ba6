"""Ticks of logarithmic axes as plain numbers."""

import math
from collections.abc import Sequence

from matplotlib.axis import Axis
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullFormatter, NullLocator


def plain(axis: Axis, at: Sequence[float] | None = None) -> None:
    """3, 4, 5 instead of 4·10⁰ where a logarithmic axis spans less than two decades, or at the values `at`."""
    if axis.get_scale() != "log":
        return
    low, high = sorted(axis.get_view_interval())
    decades = math.log10(high / low) if low > 0.0 else math.inf
    if at is not None:
        axis.set_major_locator(FixedLocator([*at]))
    elif decades < 0.8:
        axis.set_major_locator(MaxNLocator(5))
    elif decades < 2.0:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    else:
        return
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
