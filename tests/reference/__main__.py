"""Compute the tables anew: `python -m tests.reference [--out DIR]` compares them with `tests/data`."""

import argparse
from pathlib import Path

from tests.reference.tables import DATA, FLIGHTS, LAWS, difference, read, table, write


def main() -> None:
    """One line a table; with `--out`, the tables too."""
    parser = argparse.ArgumentParser(prog="python -m tests.reference", description=__doc__)
    parser.add_argument("--out", type=Path, help="folder for the tables")
    out = parser.parse_args().out
    for name in (*LAWS, *FLIGHTS):
        header, rows = table(name)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            write(out / name, header, rows)
        print(f"{name}: differs by at most {difference(rows, read(DATA / name)[1]):.1e}", flush=True)


if __name__ == "__main__":
    main()
