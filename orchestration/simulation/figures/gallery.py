"""Figures by name, which a notebook displays."""

import base64
import html
import io
from collections.abc import Iterator, Mapping
from pathlib import Path

from matplotlib.figure import Figure

from orchestration.simulation.figures.style import Style, laid_out_once, save, write


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

    def save(self, folder: str | Path) -> list[Path]:
        """Write them into a folder, each as NAME.png and NAME.svg; their paths."""
        return save(self, Path(folder), self._style)
