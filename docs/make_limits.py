"""The table of limits on the page of systems: `python -m docs.make_limits` writes it."""

from pathlib import Path

from docs.pages import fill
from orchestration.foundation.processes.resource_limits import OF_FILES, UNLIMITED, Limits

PAGE = Path(__file__).with_name("systems.md")


def table() -> str:
    """The limits of files, which are refused beyond, and of the processes that handle them, which are ended."""
    confined = Limits()
    rows = [(limit.of, limit) for limit in OF_FILES] + [
        ("Time of a process that checks an FMU", f"{confined.time:.0f} s"),
        ("Memory of a process with foreign FMUs, with its children (Linux)", f"{confined.memory:.0f} MB"),
        ("A file that a process writes which checks an FMU", f"{confined.size:.0f} MB"),
        ("What such a process prints", f"{confined.output:.0f} MB"),
        ("A message of such a process", f"{confined.message:.0f} MB"),
        ("A message of any other process with FMUs", f"{UNLIMITED.message:.0f} MB"),
    ]
    return "\n".join(["| limit of | at most |", "|---|---|", *(f"| {of} | {limit} |" for of, limit in rows)])


if __name__ == "__main__":
    fill(PAGE, {"python -m docs.make_limits": table()})
