"""The command `live`."""

import sys
import webbrowser
from pathlib import Path
from typing import Annotated

from orchestration.command.flags import FlightFlags, ScenarioFile, flight_options, request_from
from orchestration.command.options import option
from orchestration.command.registry import CommandResult, result_of_files
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import inform


@flight_options
def live(
    scenario: ScenarioFile = None,
    vary: Annotated[
        list[str] | None, option("--vary", "A number to change by a slider; may be repeated.", "PATH=LOW:HIGH")
    ] = None,
    map: Annotated[str | None, option("--map", "The two axes of the map, which vary.", "PATH,PATH")] = None,
    out: Annotated[Path, option("--out", "The file.", "FILE.html")] = Path("live.html"),
    *,
    flags: FlightFlags,
) -> CommandResult:
    """Write one HTML file in which a system runs while its numbers are changed; it needs no network.

    Without arguments it is the paper's flight, and a terminal opens it.
    """
    from orchestration.experiments.live.live import SHIPPED, Live, ranges_of
    from orchestration.experiments.live.live import live as page_of

    axes = None if map is None else tuple(map.split(","))
    if axes is not None and len(axes) != 2:
        raise UsageError(f"--map {map}: expected two paths, as PATH,PATH")
    if out.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"--out {out}: expected a file that ends in .html")
    is_usual = scenario is None and not vary and axes is None and flags == FlightFlags()
    if is_usual and SHIPPED.is_file():
        page = Live(html=SHIPPED.read_text(encoding="utf-8"))
    else:
        inform("compiling for WebAssembly, which takes a minute at first")
        page = page_of(
            request_from(scenario, flags),
            ranges_of(vary or []),
            None if axes is None else (axes[0], axes[1]),
            name=None if scenario is None else str(scenario),
        )
    written = page.save(out)
    if is_usual and sys.stdout.isatty():
        webbrowser.open(written.resolve().as_uri())
    return result_of_files([written])
