"""What becomes of files where calls fail: `python -m tests.faults [COMMAND …] [--most N] [--out FILE]`."""

import argparse
import json
import os
import shutil
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

from tests.faults import shim


def main() -> int:
    """Start again with the shim, then work through the matrix."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults")
    parser.add_argument("commands", nargs="*", help="default: all")
    parser.add_argument("--most", type=int, default=10**9, help="numbers of each kind of call but rename")
    parser.add_argument("--out", type=Path, help="where all rows go, as JSON")
    parser.add_argument("--page", action="store_true", help="write the rows and the table of the documentation")
    options = parser.parse_args()
    if (lack := shim.lack()) is not None:
        print(f"no faults are made here: {lack}")
        return 1
    if "faults.so" not in os.environ.get("LD_PRELOAD", ""):
        with tempfile.TemporaryDirectory() as folder:
            again = {**os.environ, "LD_PRELOAD": str(shim.compile_into(Path(folder)))}
            words = [sys.executable, "-m", "tests.faults", *sys.argv[1:]]
            return os.spawnve(os.P_WAIT, sys.executable, words, again)
    from tests.faults import page
    from tests.faults.commands import COMMANDS
    from tests.faults.matrix import Row, work_through

    def tell(row: Row) -> None:
        if row.outcome not in ("old", "new"):
            print(f"{row.command}, {row.operation}, {row.n}: {row.outcome}: {row.note}", flush=True)

    chosen = [command for command in COMMANDS if not options.commands or command.name in options.commands]
    folder = tempfile.mkdtemp()  # no context manager, which forked processes would leave, too
    try:
        rows = work_through(chosen, Path(folder), most=options.most, tell=tell)
    finally:
        shutil.rmtree(folder)
    outcomes = [row.outcome for row in rows]
    print(len(rows), "cases:", {outcome: outcomes.count(outcome) for outcome in sorted(set(outcomes))})
    if options.out:
        options.out.write_text(json.dumps([asdict(row) for row in rows]), encoding="utf-8")
    if options.page:
        page.write([asdict(row) for row in rows])
    return int(any(outcome not in ("old", "new") for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
