"""python -m docs.newcomer: clones the repository into an empty folder, and follows all pages there.

It ends at the first block that does not do what its page says, with exit code 1. All of it takes an hour or more. Only
some pages, in this order: python -m docs.newcomer README.md docs/start.md.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from docs.newcomer.blocks import blocks_of
from docs.newcomer.following import BlockFailed, Newcomer, print_now
from docs.newcomer.pages import pages

ROOT = Path(__file__).parents[2]


def main() -> None:
    """Follow the pages; report at the end what was not run, and why."""
    parser = argparse.ArgumentParser(prog="python -m docs.newcomer", description=__doc__)
    parser.add_argument("pages", nargs="*", type=Path, help="only these; default: all")
    parser.add_argument("--folder", type=Path, help="a copy in which the pages before these were already followed")
    parser.add_argument("--go-on", action="store_true", help="do not end where a block fails; report all that fail")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="newcomer-") as empty:
        folder = options.folder or Path(empty) / "quadcosim"
        if not folder.exists():
            subprocess.run(["git", "clone", "--quiet", str(ROOT), str(folder)], check=True)
        sys.exit(_follow(folder.resolve(), options.pages or pages(folder), go_on=options.go_on))


def _follow(folder: Path, read: list[Path], *, go_on: bool) -> int:
    began, failed = time.monotonic(), 0
    newcomer = Newcomer(folder, print_now)
    for page in read:
        newcomer.start_page()
        for block in blocks_of(page, folder):
            try:
                newcomer.follow(block)
            except (BlockFailed, subprocess.TimeoutExpired) as error:
                failed += 1
                print_now(f"FAILED: {error}")
                if not go_on:
                    newcomer.close()
                    return 1
    newcomer.close()
    print_now(f"{len(newcomer.skipped)} not run as written:")
    for one in newcomer.skipped:
        print_now(f"  {one.place}: {one.what}: {one.reason}")
    minutes = (time.monotonic() - began) / 60
    print_now(f"{newcomer.done} blocks of {len(read)} pages do what they say, {failed} do not; {minutes:.0f} min")
    return 1 if failed else 0


if __name__ == "__main__":
    main()
