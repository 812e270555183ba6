"""Animations of flights, as GIF or MP4."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter

from fmu_kit.new_files import new_file, write_atomically
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.terminal import Share
from orchestration.quadrotor.flight.path import fill, stage
from orchestration.quadrotor.scenarios.wiring import COMMAND, POSITION, POSITION_REFERENCE, QUATERNION
from orchestration.simulation.figures.drawn_run import DrawnRun
from orchestration.simulation.figures.palette import BLACK, GREEN, ORANGE
from orchestration.simulation.figures.style import Style

RATE = 20
"""Pictures per second of the flight, if it is short [1/s]"""
MAX_PICTURES = 240
"""pictures: a longer flight is shown faster"""
DPI = 100.0
TRAIL = 2.0
"""Part of the path that is drawn thick [s]"""
SIZE = 0.06
"""Half the length of an arm as a share of the longest side of the view: much larger than in reality"""

PLACE, ATTITUDE = ([f"plant.{name}" for name in names] for names in (POSITION, QUATERNION))
THRUST = f"plant.{COMMAND[0]}"
COLUMNS = frozenset((*PLACE, *ATTITUDE, THRUST, *POSITION_REFERENCE))
"""Columns that a film needs"""
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 25)
_ROTORS = [
    np.column_stack([fore + 0.55 * np.cos(_CIRCLE), side + 0.55 * np.sin(_CIRCLE), np.zeros(len(_CIRCLE))])
    for fore, side in ((1, 1), (1, -1), (-1, 1), (-1, -1))
]
_ARMS = [np.array([[1.0, side, 0.0], [-1.0, -side, 0.0]]) for side in (1, -1)]


class _GifWriter(PillowWriter):
    """Writes the file by Python: Pillow itself takes what is written in part for written."""

    def finish(self) -> None:
        content: Any = BytesIO()
        path, content.name, self.outfile = Path(self.outfile), self.outfile, content
        super().finish()
        write_atomically(path, content.getvalue())


def writer(path: Path) -> AbstractMovieWriter:
    """A writer for the format of the ending.

    Raises `UsageError` for another ending, or for one without a writer on this machine.
    """
    if path.suffix == ".gif":
        return _GifWriter(fps=RATE)
    if path.suffix != ".mp4":
        raise UsageError(f"--film {path}: expected a file that ends in .gif or .mp4")
    if not FFMpegWriter.isAvailable():
        raise UsageError(f"--film {path}: expected ffmpeg on this machine; .gif needs nothing")
    return FFMpegWriter(fps=RATE)


def film(runs: Sequence[DrawnRun], path: Path, style: Style, progress: Share = lambda share: None) -> Path:
    """Write an animation of runs, each with its trail; its path. Raises `UsageError` as `writer` does."""
    movie = writer(path)
    start, end = min(run.span[0] for run in runs), max(run.span[1] for run in runs)
    count = max(2, min(MAX_PICTURES, round(RATE * (end - start))))
    times = np.linspace(start, end, count)
    pace = (end - start) * RATE / (count - 1)
    style = replace(style, dpi=DPI)
    with style.applied():
        figure, axes = stage(runs, style)
        for line in axes.get_lines():
            line.set(alpha=0.35)
        title = figure.suptitle("0.00 s")
        fill(figure, axes)
        size = SIZE * max(float(np.ptp(limits)) for limits in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim()))
        vehicles = [_Vehicle.on(axes, run, size) for run in runs]
        with new_file(path) as new, movie.saving(figure, str(new), DPI):
            for place, now in enumerate(times, start=1):
                title.set_text(f"{now:.2f} s" + ("" if abs(pace - 1.0) < 0.1 else f", {pace:.2g} times as fast"))
                for vehicle in vehicles:
                    vehicle.move(float(now))
                movie.grab_frame()
                progress(place / count)
    return path


@dataclass(frozen=True, kw_only=True)
class _Vehicle:
    """A vehicle, its trail, thrust and reference, as lines that are moved."""

    run: DrawnRun
    size: float
    lines: dict[str, Any]
    outlines: Sequence[Any]
    most: float
    """largest thrust of the run [N]"""

    @classmethod
    def on(cls, axes: Any, run: DrawnRun, size: float) -> "_Vehicle":
        def line(**how: Any) -> Any:
            return axes.plot([], [], [], **{"color": run.color, "zorder": 5, **how})[0]

        return cls(
            run=run, size=size,
            lines={
                "trail": line(linewidth=3.5, alpha=0.6), "thrust": line(color=GREEN, linewidth=2.5),
                "reference": line(color=ORANGE, marker="D", markerfacecolor="none"),
            },
            outlines=[line(color=BLACK, linewidth=2.5) for _ in _ARMS] + [line(linewidth=1.6) for _ in _ROTORS],
            most=max(float(np.nanmax(run.signals[THRUST])), 1e-9),
        )  # fmt: skip

    def move(self, now: float) -> None:
        """Move it to its place at a time [s], or at the end of its run."""
        t = self.run.signals["time"]
        now = min(now, float(t[-1]))
        place, turned = self._at(PLACE, now), _rotation(self._at(ATTITUDE, now))
        behind = np.linspace(max(now - TRAIL, float(t[0])), now, 30)
        self.lines["trail"].set_data_3d(*(np.interp(behind, t, self.run.signals[name]) for name in PLACE))
        self.lines["reference"].set_data_3d(*self._at(POSITION_REFERENCE, now)[:, None])
        force = float(self._at([THRUST], now)[0]) / self.most
        up = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -3.0 * force]])
        for drawn, points in zip((*self.outlines, self.lines["thrust"]), (*_ARMS, *_ROTORS, up), strict=True):
            drawn.set_data_3d(*(place + self.size * points @ turned.T).T)

    def _at(self, names: Sequence[str], now: float) -> Floats:
        t = self.run.signals["time"]
        return np.array([np.interp(now, t, self.run.signals[name]) for name in names])


def _rotation(quaternion: Floats) -> Floats:
    """From body to space, of a quaternion (x, y, z, w) of any length, shape (3, 3)."""
    x, y, z, w = quaternion / max(float(np.linalg.norm(quaternion)), 1e-300)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
