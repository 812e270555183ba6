"""Violations of MISRA C:2012 in the C of the controller: `python -m benchmarks.misra`.

Needs cppcheck with its addon, which checks most decidable rules, without their texts. The controller is the law without
redesign and prediction, in both precisions: with them cppcheck takes more than ten minutes.
"""

import re
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

from benchmarks.embedded import FIXED
from benchmarks.mathematics import table
from fmu_kit.bundle import Target
from fmu_kit.compiler.pack.embedded_files import write
from fmu_kit.variants import Variant
from orchestration.components.building.models import MODELS

CPPCHECK = "cppcheck"
_FINDING = re.compile(r"\[misra-c2012-([\d.]+)\]")


def findings(source: Path) -> Counter[str]:
    """The number of violations of each rule in a file of C."""
    subprocess.run(
        [CPPCHECK, "--dump", "--max-configs=1", "--std=c99", "--quiet", source.name], cwd=source.parent, check=True
    )
    addon = [sys.executable, str(_addon()), f"{source.name}.dump"]
    done = subprocess.run(addon, cwd=source.parent, capture_output=True, text=True, check=False)
    return Counter(_FINDING.findall(done.stdout + done.stderr))


def _addon() -> Path:
    """The path of the checker's addon; raises `FileNotFoundError` if there is none."""
    for folder in (
        Path("/usr/share/cppcheck"),
        *Path("/usr/lib").glob("*/cppcheck"),
        Path("/opt/homebrew/share/cppcheck"),
    ):
        if (folder / "addons" / "misra.py").is_file():
            return folder / "addons" / "misra.py"
    raise FileNotFoundError("addons/misra.py: expected beside cppcheck")


def main() -> None:
    found: dict[str, Counter[str]] = {}
    law = replace(
        Target.parse(MODELS["UnifiedController"]), variant=Variant.of("Law", FIXED["no redesign, no prediction"])
    )
    with tempfile.TemporaryDirectory() as temporary:
        for precision in ("double", "single"):
            found[precision] = findings(write(law, Path(temporary) / precision, single=precision == "single"))
    rules = sorted({rule for each in found.values() for rule in each}, key=lambda rule: [*map(int, rule.split("."))])
    rows = [[rule, *(str(each[rule]) for each in found.values())] for rule in rules]
    rows.append(["all", *(str(each.total()) for each in found.values())])
    version = subprocess.run([CPPCHECK, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    print(table(["rule", *found], rows), version, sep="\n\n")


if __name__ == "__main__":
    main()
