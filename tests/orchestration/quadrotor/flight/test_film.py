"""A flight as a film."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

import quadcosim
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


def test_a_film_has_twenty_pictures_a_second_in_which_the_vehicle_moves(flight: Result, tmp_path: Path) -> None:
    heard: list[float] = []
    runs = runs_of([flight], ["one"], filming.COLUMNS | {"time"}, (0.0, 0.3))
    path = filming.film(runs, tmp_path / "new" / "flight.gif", SCREEN, heard.append)
    with Image.open(path) as film:
        assert film.n_frames == len(heard) == 6
        assert film.info["duration"] == 50
        pictures = []
        for place in (0, 5):
            film.seek(place)
            pictures.append(np.asarray(film.convert("RGB")))
    assert (pictures[0] != pictures[1]).any()
    assert heard[-1] == 1.0


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
