"""Restore states from files and fly on, each in a copy of this process; print every variable after each step.

Arguments: a JSON list of FMU, flight and file of the state; the first step and the end.
"""

import functools
import json
import sys
from pathlib import Path

from tests.fmus.flights import FLIGHTS
from tests.fmus.instance import Instance
from tests.fmus.process import in_a_copy


def flown_on(fmu: str, flight: str, state: str, first: int, last: int) -> list[list[str]]:
    with Instance(Path(fmu)) as instance:
        instance.restore(Path(state).read_bytes())
        return FLIGHTS[flight].fly(instance, first, last)


def main(asked: list[tuple[str, str, str]], first: int, last: int) -> dict[str, list[list[str]]]:
    return {each[1]: in_a_copy(functools.partial(flown_on, *each, first, last)) for each in asked}


if __name__ == "__main__":
    print(json.dumps(main(json.loads(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))))
