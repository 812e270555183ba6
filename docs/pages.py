"""Writing computed text into pages, for the scripts in this folder."""

import re
from pathlib import Path


def fill(page: Path, blocks: dict[str, str]) -> None:
    """Write each text between `<!-- NAME -->` and `<!-- end -->` of `page`; raises `ValueError` if they are missing."""
    content = page.read_text(encoding="utf-8")
    for name, text in blocks.items():
        start = f"<!-- {name} -->"
        between = f"(?<={re.escape(start)}\n).*?(?=<!-- end -->)"
        content, count = re.subn(between, f"\n{text}\n\n".replace("\\", r"\\"), content, flags=re.S)
        if count != 1:
            raise ValueError(f"{page}: expected one {start}, found {count}")
    page.write_text(content, encoding="utf-8")
