"""Draws the figures of README.md and of the pages beside this file: run as `make figures`."""

from pathlib import Path

import matplotlib

from orchestration import plots
from orchestration.flight import run

FIGURES = Path(__file__).parent / "figures"


def main() -> None:
    """Fly what the figures show and write them, small enough for a repository."""
    FIGURES.mkdir(exist_ok=True)
    flight = run()
    with matplotlib.rc_context({**plots.STYLE, "figure.dpi": 80}):
        plots.path(flight).savefig(FIGURES / "path.png")
        plots.errors(flight).savefig(FIGURES / "errors.png")
        plots.commands(flight).savefig(FIGURES / "commands.png")
        plots.energy(flight).savefig(FIGURES / "energy.png")


if __name__ == "__main__":
    main()
