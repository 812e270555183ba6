"""What the texts of the repository must not say again."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXTS = (
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "docs").glob("make_*.py")),
    ROOT / "fmus" / "README.md",
    *sorted((ROOT / "studies").glob("*.toml")),
    *(path for package in ("controller_fmu", "fmu_kit") for path in sorted((ROOT / package).glob("*.[ph]*"))),
)
ONE_WEIGHT_OF_THE_PROOF = re.compile(
    r"proof\s+(needs|asks\s+for\s+κ|does\s+not\s+go)|\(the\s+lyapunov\s+proof\)|\(lyapunov\s+proof\)|weight\s+of\s+the\s+proof",
    re.IGNORECASE,
)


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_text_says_that_the_proof_needs_one_coupling(path: Path) -> None:
    """The energy has its rate for every κ: `test_energy_has_the_rate_of_the_proof_for_every_weight`."""
    assert not ONE_WEIGHT_OF_THE_PROOF.search(path.read_text(encoding="utf-8", errors="ignore"))
