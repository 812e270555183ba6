"""What the scripts beside this file share: text that is computed, put into a page."""

import re
from pathlib import Path


def fill(page: Path, blocks: dict[str, str]) -> None:
    """Put each text between `<!-- NAME -->` and `<!-- end -->` of `page`; raises `ValueError` where they are not."""
    content = page.read_text(encoding="utf-8")
    for name, text in blocks.items():
        start = f"<!-- {name} -->"
        between = f"(?<={re.escape(start)}\n).*?(?=<!-- end -->)"
        content, count = re.subn(between, f"\n{text}\n\n".replace("\\", r"\\"), content, flags=re.S)
        if count != 1:
            raise ValueError(f"{page}: expected one {start}, found {count}")
    page.write_text(content, encoding="utf-8")
