"""What is drawn, as it is written."""

import io
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest
from PIL import Image


def expect_picture(path: Path) -> None:
    """Expect a PNG with more on it than its background."""
    with Image.open(path) as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 100
        assert picture.convert("RGB").getcolors(20) is None, "more colours: the shades of the lines' edges"


@contextmanager
def blank_pictures() -> Iterator[None]:
    """A context in which pictures are files of one pixel, which are written in a fifth of the time."""
    from orchestration.simulation.figures import style

    pixel = io.BytesIO()
    Image.new("RGB", (1, 1)).save(pixel, "PNG", dpi=(1.0, 1.0))

    def write(figure: Any, file: Any, ending: str) -> None:
        Path(file).write_bytes(pixel.getvalue())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "laid_out_once", lambda figure: nullcontext())
        patch.setattr(style, "write", write)
        yield
