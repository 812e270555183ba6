"""Fills `docs/interop.md` and `docs/validation.md`, and draws the agreement chart: run as `make interop`.

Runs the paper's flight in third-party masters, and damages FMUs in all ways that the tests know. Takes some minutes on
two cores.
"""

import sys
from pathlib import Path

from docs.pages import fill
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.figures import style
from orchestration.simulation.interop import compare
from orchestration.simulation.interop.catalogue import chosen
from orchestration.simulation.interop.compare import agreements
from orchestration.simulation.interop.figure import agreement_chart
from tests.fmus import mutants
from tests.fmus.verdicts import Verdict

DOCS = Path(__file__).parent
INTERVAL = 0.01
"""Communication step [s]; that of the FMUs' default experiment"""


def main() -> None:
    """Fill both pages."""
    interop()
    validation()


def interop() -> None:
    """Run the flights, write the table into the page, and draw its chart."""
    found = agreements(Scenario(timing=Timing(plant_interval=INTERVAL)), chosen(None, ("controller", "plant")))
    with style.DOCS.applied():
        chart = agreement_chart(found)
    style.save({"interop": chart}, DOCS / "figures", style.DOCS)
    fill(DOCS / "interop.md", {"masters": compare.text(found)})


def validation() -> None:
    """Write how many damaged FMUs each tool finds."""
    print(f"damaging FMUs in {len(mutants.MUTANTS)} ways", file=sys.stderr)
    found = mutants.tables()
    fill(DOCS / "validation.md", {"count": "\n".join(_count(version, table) for version, table in found.items())})


def _count(version: int, table: list[Verdict]) -> str:
    quadcosim, fmpy, fmutool = (
        sum(map(bool, found)) for found in zip(*((v.quadcosim, v.fmpy, v.fmutool) for v in table))
    )
    return (
        f"Of {len(table)} damaged FMUs of FMI {version}.0 quadcosim finds {quadcosim}, fmpy {fmpy}, fmutool {fmutool}."
    )


if __name__ == "__main__":
    main()
