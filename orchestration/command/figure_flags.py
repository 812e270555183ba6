"""Flags of the commands that draw: formats, size and style."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from orchestration.command.options import option
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.figures.names import COLUMNS, FORMATS, STYLES, WRITTEN

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Style


LEAST = 15.0
"""Least width of a figure in sizes of its font: below, numbers of cells and names overlap"""


@dataclass(frozen=True, kw_only=True)
class FigureFlags:
    """The flags on the command line; raises `UsageError` for invalid values."""

    format: Annotated[
        list[str] | None,
        option(
            "--format", f"Format of the files; default: {' and '.join(WRITTEN)}; may be repeated.", "|".join(FORMATS)
        ),
    ] = None
    style: Annotated[str, option("--style", "Fonts, lines and the default size.", "|".join(STYLES))] = STYLES[0]
    width: Annotated[
        str | None,
        option("--width", "Width in mm, or a column of a journal: single is 88.9, double 181.", "MM|single|double"),
    ] = None
    size: Annotated[str | None, option("--size", "Width and height in mm.", "MMxMM")] = None
    font_size: Annotated[float | None, option("--font-size", "Size of the text in points.", "PT")] = None

    def __post_init__(self) -> None:
        for ending in self.format or ():
            if ending not in FORMATS:
                raise UsageError(f"--format {ending}: expected one of {', '.join(FORMATS)}")
        if self.style not in STYLES:
            raise UsageError(f"--style {self.style}: expected one of {', '.join(STYLES)}")
        if self.size is not None and self.width is not None:
            raise UsageError("--size: expected no --width; the size includes the width")
        if self.font_size is not None and not 1.0 <= self.font_size <= 100.0:
            raise UsageError(f"--font-size {self.font_size:g}: expected 1 to 100 points")
        if (self.size, self.width, self.font_size) != (None, None, None):
            _ = self.figure_style  # before what is drawn is simulated

    @property
    def figure_style(self) -> "Style":
        """The style with the sizes and formats of these flags; raises `UsageError` for too little room for text."""
        from dataclasses import replace

        from orchestration.simulation.figures.style import POINT
        from orchestration.simulation.figures.style import STYLES as KNOWN

        style = replace(KNOWN[self.style], formats=tuple(dict.fromkeys(self.format or WRITTEN)), **self._extent)
        style = style if self.font_size is None else replace(style, font=self.font_size)
        if style.width < (least := LEAST * style.font * POINT):
            given = {"--size": self.size, "--width": self.width, "--font-size": self.font_size}
            flag = next(f"{name} {value}" for name, value in given.items() if value is not None)
            raise UsageError(
                f"{flag}: {style.width:g} mm are too narrow for text of {style.font:g} points; expected "
                f"a width of at least {least:.0f} mm, or a smaller --font-size"
            )
        return style

    @property
    def _extent(self) -> dict[str, Any]:
        captioned = {} if self.style == "slides" else {"has_titles": False}  # as what has its place in a document is
        if self.size is not None:
            width, cross, height = self.size.lower().partition("x")
            return {
                "width": _millimetres("--size", self.size, width),
                "height": _millimetres("--size", self.size, height if cross else ""),
                **captioned,
            }
        if self.width is None:
            return {}
        return {"width": COLUMNS.get(self.width) or _millimetres("--width", self.width, self.width), **captioned}


def _millimetres(flag: str, argument: str, text: str) -> float:
    try:
        value = float(text.removesuffix("mm"))
    except ValueError:
        value = -1.0
    if not 20.0 <= value <= 2000.0:
        expected = "MMxMM, as in 120x80" if flag == "--size" else f"{', '.join(COLUMNS)} or millimetres"
        raise UsageError(f"{flag} {argument}: expected {expected}, each from 20 to 2000 mm")
    return value
