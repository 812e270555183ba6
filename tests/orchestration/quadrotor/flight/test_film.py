"""A flight as a film."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

import quadcosim
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.flight import film as filming
from orchestration.simulation.figures.style import SCREEN
from orchestration.simulation.runs.draw import runs_of
from quadcosim import Result, UsageError
from tests.commands import Main
from tests.native import native
from tests.places import EXAMPLES


@pytest.fixture(scope="module")
def flight() -> Result:
    return quadcosim.run(native(stop_time=0.4))


def test_a_film_has_twenty_pictures_a_second_in_which_the_vehicle_follows_its_path(
    flight: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[float] = []
    places: list[Floats] = []
    move = filming._Vehicle.move

    def moved(vehicle: Any, now: float) -> None:
        move(vehicle, now)
        places.append(pixel_of(vehicle.outlines[0].axes, vehicle._at(filming.PLACE, now)))

    monkeypatch.setattr(filming._Vehicle, "move", moved)
    runs = runs_of([flight], ["one"], filming.COLUMNS | {"time"}, (0.0, 0.3))
    path = filming.film(runs, tmp_path / "new" / "flight.gif", SCREEN, heard.append)
    with Image.open(path) as film:
        assert film.n_frames == len(heard) == 6
        assert film.info["duration"] == 50
        pictures = []
        for number in range(6):
            film.seek(number)
            pictures.append(np.asarray(film.convert("L")))
    for picture, place in zip(pictures, places, strict=True):
        assert np.linalg.norm(dark_centre(picture, place) - place) < 1.5
    assert np.linalg.norm(places[-1] - places[0]) > 5.0
    assert heard[-1] == 1.0


def pixel_of(axes: Any, point: Floats) -> Floats:
    """Column and row of a point in space in a picture of the figure."""
    x, y, _, w = axes.get_proj() @ [*point, 1.0]
    column, row = axes.transData.transform((x / w, y / w))
    return np.array([column, axes.figure.bbox.height - row])


def dark_centre(picture: npt.NDArray[np.uint8], about: Floats, reach: int = 12) -> Floats:
    """Mean column and row of the dark pixels about a place: the arms of a vehicle cross in its centre."""
    left, top = (int(value) - reach for value in about)
    rows, columns = np.nonzero(picture[top : top + 2 * reach + 1, left : left + 2 * reach + 1] < 70)
    return np.array([left + columns.mean() + 0.5, top + rows.mean() + 0.5])


def test_a_rotation_turns_the_axes_of_the_body_by_its_quaternion() -> None:
    half = np.sqrt(0.5)
    turned = filming._rotation(2.0 * np.array([0.0, 0.0, half, half]))
    assert turned @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])
    assert turned @ [0.0, 1.0, 0.0] == pytest.approx([-1.0, 0.0, 0.0])


def test_what_cannot_be_filmed_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, main: Main) -> None:
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(UsageError, match=r"film = a.mp4: expected ffmpeg on this machine; .gif needs nothing"):
        filming.writer(Path("a.mp4"))
    with pytest.raises(UsageError, match=r"film = a.avi: expected a file that ends in .gif or .mp4"):
        filming.writer(Path("a.avi"))
    monkeypatch.chdir(tmp_path)
    tank = EXAMPLES / "water_tank" / "system.toml"
    main("run", tank, "--stop-time", "1", "--no-figures", "--out", "tank")
    done = main("plot", "tank", "--film", "tank.gif", code=2)
    assert "--film: expected runs of a quadrotor" in done.stderr
