"""What is drawn, as it is written."""

from pathlib import Path

from PIL import Image


def expect_picture(path: Path) -> None:
    """Expect a PNG with more on it than its background."""
    with Image.open(path) as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 100
        assert picture.convert("RGB").getcolors(20) is None, "more colours: the shades of the lines' edges"
