"""The pages of the documentation, in the order in which a newcomer reads them."""

import re
from pathlib import Path

FIRST = ("README.md",)
PLACES = ("docs/**/*.md", "examples/**/*.md", "fmus/*.md", "tests/reference/*.md", "*.md")
NOT_TO_FOLLOW = ("CHANGELOG.md",)
"""Pages about the past, without instructions"""


def pages(root: Path) -> list[Path]:
    """All pages, relative to `root`: the README, then those of the site in its order, then the others."""
    listed = re.findall(r"^ +- (?:[^:\n]+: )?(\S+\.md)$", (root / "mkdocs.yml").read_text(encoding="utf-8"), re.M)
    of_site = [place for name in listed for place in (Path("docs", name), Path(name)) if (root / place).is_file()]
    others = [path.relative_to(root) for pattern in PLACES for path in sorted(root.glob(pattern))]
    order = dict.fromkeys([*map(Path, FIRST), *of_site, *others])
    return [page for page in order if page.name not in NOT_TO_FOLLOW]
