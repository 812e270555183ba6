"""Restore a state from a file in this process and fly on; print every variable after each step."""

import json
import sys
from pathlib import Path

from tests.fmus.flights import FLIGHTS
from tests.fmus.instance import Instance


def main(fmu: str, flight: str, state: str, first: str, last: str) -> None:
    with Instance(Path(fmu)) as instance:
        instance.restore(Path(state).read_bytes())
        print(json.dumps(FLIGHTS[flight].fly(instance, int(first), int(last))))


if __name__ == "__main__":
    main(*sys.argv[1:])
