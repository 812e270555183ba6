"""The style of figures: sizes, fonts and lines; and how files of them are written."""

import base64
import functools
import html
import io
import re
import textwrap
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import matplotlib
from cycler import cycler
from matplotlib.backend_bases import get_registered_canvas_class
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fmu_kit.new_files import new_file, new_files
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import Share, inform
from orchestration.simulation.figures.names import COLUMNS, FORMATS, WRITTEN
from orchestration.simulation.figures.palette import CYCLE

INCH = 25.4
"""Length of an inch [mm]"""
POINT = INCH / 72.0
"""Length of a point [mm]"""
PAGE = 235.0
"""Height of the text on a page of a journal [mm]"""


@dataclass(frozen=True, kw_only=True)
class Style:
    """Size, look and formats of figures; font sizes are those in the written file.

    Raises `UsageError` for an unknown format.
    """

    width: float = 203.0
    """Width [mm]"""
    height: float | None = None
    """Height [mm]; default: as the content needs"""
    font: float = 10.0
    """Size of the font [pt]"""
    serif: bool = False
    line: float = 1.3
    """Width of a line [pt]"""
    has_titles: bool = True
    """false for papers, which have captions instead"""
    dpi: float = 200.0
    """Resolution of PNG"""
    colors: int | None = None
    """largest number in a PNG; None: unlimited"""
    formats: tuple[str, ...] = WRITTEN
    """Formats of the files"""

    def __post_init__(self) -> None:
        for ending in self.formats:
            if ending not in FORMATS:
                raise UsageError(f"format {ending}: expected one of {', '.join(FORMATS)}")

    @property
    def is_wide(self) -> bool:
        """Whether two panels fit side by side."""
        return self.width >= 33.0 * self.font * POINT

    def figure(self, height: float, *, width: float = 1.0, **more: Any) -> Figure:
        """An empty figure, `height` lines of text high unless the style has a height; `width`: share of the style's.

        For a paper it is at most a page high.
        """
        high = self.height if self.height is not None else height * self.font * POINT
        if self.height is None and not self.has_titles:
            high = min(high, PAGE)
        figure = Figure(figsize=(width * self.width / INCH, high / INCH), **more)
        FigureCanvasAgg(figure)  # one renderer for layout and PNG: each text is measured once
        return figure

    def set_title(self, figure: Figure, text: str) -> None:
        """Put a text above all panels, in lines that fit the width; a paper has it as a caption, told by `save`."""
        figure.set_label(text)
        if self.has_titles:
            figure.suptitle(self.in_lines(text))

    def in_lines(self, text: str) -> str:
        """A text in lines that fit the width."""
        return textwrap.fill(text, max(20, round(self.width / (0.55 * self.font * POINT))))

    @contextmanager
    def applied(self) -> Iterator[None]:
        """A context in which figures have this style, regardless of the user's settings of matplotlib.

        Of characters that its fonts lack, matplotlib draws boxes and warns once for each; here it does not warn.
        """
        with matplotlib.rc_context(), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing from font")
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(_shared_settings())
            matplotlib.rcParams.update(self._settings())
            yield

    def _settings(self) -> dict[str, Any]:
        small = 0.85 * self.font
        return {
            "axes.labelsize": self.font,
            "axes.linewidth": 0.06 * self.font,
            "axes.prop_cycle": cycler(color=CYCLE),
            "axes.titlesize": self.font,
            "figure.constrained_layout.h_pad": 0.3 * self.font / 72.0,
            "figure.constrained_layout.w_pad": 0.3 * self.font / 72.0,
            "figure.dpi": self.dpi,
            "figure.labelsize": self.font,
            "figure.titlesize": self.font,
            "font.family": "serif" if self.serif else "sans-serif",
            "font.size": self.font,
            "grid.linewidth": 0.05 * self.font,
            "hatch.linewidth": 0.06 * self.font,
            "legend.fontsize": small,
            "legend.title_fontsize": small,
            "lines.linewidth": self.line,
            "lines.markersize": 0.45 * self.font,
            "mathtext.fontset": "stix" if self.serif else "dejavusans",
            "xtick.labelsize": small,
            "ytick.labelsize": small,
        }


@functools.cache
def _shared_settings() -> matplotlib.RcParams:
    return matplotlib.rc_params_from_file(Path(__file__).with_name("every.mplstyle"), use_default_template=False)


STYLES: Mapping[str, Style] = {
    "screen": Style(),
    "paper": Style(width=COLUMNS["double"], font=8.0, serif=True, line=0.9, has_titles=False, dpi=300.0),
    "slides": Style(width=254.0, height=142.9, font=16.0, line=2.2),
}
SCREEN = STYLES["screen"]
DOCS = replace(SCREEN, colors=256, formats=("png",))
"""Files small enough for a repository"""


def style_named(name: str) -> Style:
    """The style of a name; raises `UsageError` for an unknown one."""
    if name not in STYLES:
        raise UsageError(f"style {name}: expected one of {', '.join(STYLES)}")
    return STYLES[name]


_UNDATED: Mapping[str, dict[str, str | None]] = {
    "png": {"Software": "quadcosim"},
    "svg": {"Creator": "quadcosim", "Date": None},
    "pdf": {"Creator": "quadcosim", "CreationDate": None, "ModDate": None},
}


def named_by(name: str, of: str) -> str:
    """The name of the file of a figure of a quantity, a component or a signal."""
    return re.sub(r"[^A-Za-z0-9]+", "_", f"{name}_{of}").strip("_") if of else name


def save(
    figures: Mapping[str, Figure],
    folder: Path,
    style: Style = SCREEN,
    progress: Share = lambda share: None,
) -> list[Path]:
    """Write figures by name, in each format of the style, into a folder that is made if need be; their paths.

    The same data give the same bytes: files have no date. `progress` receives the share that is written.
    """
    written = []
    with new_files(folder) as new, style.applied():
        for name, figure in figures.items():
            with laid_out_once(figure):
                for ending in style.formats:
                    file = f"{name}.{ending}"
                    with new_file(new / file) as path:
                        write(figure, path, ending)
                        if ending == "png" and style.colors is not None:
                            _reduce(path, style.colors)
                    written.append(folder / file)
                    progress(len(written) / (len(figures) * len(style.formats)))
    for name, figure in figures.items():
        if figure.get_label() and not style.has_titles:
            inform(f"{name}: {figure.get_label()}")
    return written


def write(figure: Figure, file: Path | BinaryIO, ending: str) -> None:
    """Write a figure whose layout is done; `Figure.savefig` would draw it twice."""
    canvas: Any = figure.canvas
    if not hasattr(canvas, f"print_{ending}"):
        canvas = get_registered_canvas_class(ending)(figure)
    dpi = figure.dpi
    getattr(canvas, f"print_{ending}")(file, metadata=_UNDATED[ending])
    figure.dpi = dpi  # SVG and PDF leave that of their points


@contextmanager
def laid_out_once(figure: Figure) -> Iterator[None]:
    """A context in which the figure keeps its layout: computing it takes as long as writing the figure."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine("none")
    try:
        yield
    finally:
        figure.set_layout_engine(engine)


def _reduce(path: Path, colors: int) -> None:
    """Reduce the colours of a PNG, which makes it a third as large."""
    from PIL import Image, PngImagePlugin

    about = PngImagePlugin.PngInfo()
    about.add_text("Software", str(_UNDATED["png"]["Software"]))
    with Image.open(path) as image:
        few = image.convert("RGB").quantize(colors, dither=Image.Dither.NONE)
        few.save(path, optimize=True, dpi=image.info["dpi"], pnginfo=about)


class Figures(Mapping[str, Figure]):
    """Figures of matplotlib by name: `figures["errors"].axes` to change one, `save` to write them."""

    def __init__(self, figures: Mapping[str, Figure], style: Style) -> None:
        self._figures, self._style = dict(figures), style

    def __getitem__(self, name: str) -> Figure:
        return self._figures[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._figures)

    def __len__(self) -> int:
        return len(self._figures)

    def __repr__(self) -> str:
        return f"<Figures: {', '.join(self)}>"

    def _repr_html_(self) -> str:
        """All figures one below the other, as notebooks show them."""
        return "".join(
            f'<img alt="{html.escape(name)}" style="max-width:100%" src="data:image/png;base64,{self._png(figure)}">'
            for name, figure in self.items()
        )

    def _png(self, figure: Figure) -> str:
        file = io.BytesIO()
        with self._style.applied(), laid_out_once(figure):
            write(figure, file, "png")
        return base64.b64encode(file.getvalue()).decode()

    def save(self, folder: str | Path, of: str = "") -> list[Path]:
        """Write them into a folder, each as NAME.png and NAME.svg, `of` a quantity as NAME_OF; their paths."""
        return save({named_by(name, of): figure for name, figure in self.items()}, Path(folder), self._style)
