"""The paper's flight compared with the paper: its Fig. 3 redrawn, and a table of statements."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.flight.errors import ERRORS, Error, cut, draw_components
from orchestration.quadrotor.flight.path import draw_in_space
from orchestration.quadrotor.scenarios.measures import position_error
from orchestration.simulation.figures.drawn_run import DrawnRun
from orchestration.simulation.figures.lines import label_time
from orchestration.simulation.figures.style import Style
from orchestration.simulation.runs.draw import runs_of
from orchestration.simulation.runs.result import Result

BELOW = (0.05, 0.01)
"""Bounds of the position error [m]"""


def figure_3(result: Result, style: Style) -> Figure:
    """The figure arranged as in the caption of Fig. 3: the path at the left, the four errors at the right."""
    (run,) = runs_of([result], [""], None, None)
    figure = style.figure(44.0)
    halves: Any = figure.subfigures(1, 2, width_ratios=(1.2, 1.0))
    left, right = halves
    axes: Any = left.add_subplot(projection="3d")
    draw_in_space(axes, [run], style)
    left.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    panels = right.subplots(4, 1, sharex=True)
    shown = cut(run)
    for panel, error in zip(panels, _as_printed(), strict=True):
        draw_components(panel, shown, error, style, clips=False)
        panel.set_ylabel(panel.get_ylabel().replace("angular velocity", "ang. velocity"))
    panels[0].legend(loc="upper right", ncols=3)
    label_time(panels[-1])
    panels[-1].set_xlabel(f"{panels[-1].get_xlabel()}; flat from there to {run.span[1]:g} s")
    right.align_ylabels(panels)
    return figure


def statements(result: Result) -> str:
    """A table of statements of the paper, word for word, and of the results here."""
    (run,) = runs_of([result], [""], None, None)
    e, t = position_error(result.signals), result.signals["time"]
    position, velocity, attitude, turning = (_values(run, error.name) for error in ERRORS)
    z, below = position[:, 2], [f"{_settled(t, e, limit):.2f} s below {100 * limit:g} cm" for limit in BELOW]
    exponent, gain = (result.parameters[f"controller.{name}"] for name in ("surface_exponent", "gain.surface"))
    bound = np.abs(position[0]).max() ** (1.0 - exponent) / (gain * (1.0 - exponent))
    rows = (
        ("“The total time is set to 30 seconds”", f"{result.end:g} s"),
        (
            "errors “begin with large initialization errors”",
            f"at 0 s: position {_vector(position[0])} m, velocity {_vector(velocity[0])} m/s, attitude "
            f"{_vector(attitude[0])}, angular velocity {_vector(turning[0])} rad/s",
        ),
        (
            "“smoothly converging to the desired trajectory”",
            f"not without swinging: z passes its reference and is {z.max():.2f} m too low at {t[z.argmax()]:.1f} s, "
            f"then {-z[t > t[z.argmax()]].min():.2f} m too high",
        ),
        ("“all error signals converging within a finite time”", f"position error from {' and '.join(below)} on"),
        (
            "“converge to the origin”",
            f"with the wind, near it: at {result.end:g} s the position error is {1e3 * e[-1]:.2f} mm",
        ),
        (
            "settling time on the surface at most max \\|p̃₀\\|^(1 - β_t) / (k_s (1 - β_t))",
            f"{bound:.1f} s with β_t = {exponent:g}; the time until the surface is reached comes on top",
        ),
    )  # fmt: skip
    return "\n".join(
        ["| the paper | flown here |", "|---|---|", *(f"| {statement} | {here} |" for statement, here in rows)]
    )


def _as_printed() -> Sequence[Error]:
    """The errors in the order of the text: attitude, angular velocity, position, velocity."""
    position, velocity, attitude, turning = ERRORS
    return attitude, turning, position, velocity


def _values(run: DrawnRun, name: str) -> Floats:
    (error,) = [error for error in ERRORS if error.name == name]
    values = error.of(run)
    assert values is not None
    return values


def _settled(t: Floats, e: Floats, limit: float) -> float:
    outside = np.flatnonzero(e > limit)
    return float(t[outside[-1] + 1]) if len(outside) else 0.0


def _vector(values: Floats) -> str:
    return "(" + ", ".join(f"{value:.2g}" for value in values + 0.0) + ")"
