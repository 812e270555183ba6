"""Flies the paper's flight in other people's masters for `docs/interop.md`: run as `make interop`.

Writes the tables into the page, between the comments that name them, and draws its chart. A minute or two on
two cores.
"""

import re
import sys
from pathlib import Path

import matplotlib

from orchestration import plots
from orchestration.interop import table
from orchestration.interop.catalogue import chosen
from orchestration.interop.compare import agreements
from orchestration.interop.figure import agreement_chart
from orchestration.scenario import Scenario
from orchestration.timing import Timing

PAGE = Path(__file__).parent / "interop.md"
INTERVALS = ("0.01", "0.001")
"""Communication steps, as the page names them [s]."""


def main() -> None:
    """Fly, put the tables into the page, draw the chart of the first."""
    page = PAGE.read_text(encoding="utf-8")
    for interval in INTERVALS:
        print(f"flying with a step of {interval} s", file=sys.stderr)
        found = agreements(Scenario(timing=Timing(plant_interval=float(interval))), chosen(None))
        page = with_table(page, interval, table.text(found))
        if interval == INTERVALS[0]:
            with matplotlib.rc_context({**plots.STYLE, "figure.dpi": 80}):
                agreement_chart(found).savefig(PAGE.parent / "figures" / "interop.png")
    PAGE.write_text(page, encoding="utf-8")


def with_table(page: str, name: str, text: str) -> str:
    """`page` with `text` between `<!-- table name -->` and `<!-- end -->`."""
    start = f"<!-- table {name} -->"
    replaced, count = re.subn(f"({re.escape(start)}\n).*?(<!-- end -->)", rf"\g<1>\n{text}\n\n\g<2>", page, flags=re.S)
    if count != 1:
        raise ValueError(f"{PAGE}: expected one {start}, found {count}")
    return replaced


if __name__ == "__main__":
    main()
