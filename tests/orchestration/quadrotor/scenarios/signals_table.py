"""Signals of the quadrotor as hashes: `python -m tests.orchestration.quadrotor.scenarios.signals_table` makes them.

The command flies the scenarios of the table again and writes what has come of them, in the columns that the table has.
The table in the repository is that of the master of one plant and one controller, from before there were systems.
"""

import hashlib
import json
import math
import statistics
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np

import quadcosim
from orchestration.quadrotor.scenarios.file import scenario_from_tables
from orchestration.quadrotor.scenarios.scenario import Scenario
from quadcosim import Result

TABLE = Path(__file__).parents[3] / "data" / "quadrotor_signals.json"
FUNCTIONS: tuple[Callable[[float], float], ...] = (
    math.tanh, math.sin, math.cos, math.exp, math.acos, math.sqrt, math.log1p, lambda x: x**1.7, lambda x: x**0.3,
    lambda x: math.atan2(x, 0.3), lambda x: math.hypot(x, 0.1, 0.7), lambda x: sum([x, 1e16, 0.1, -1e16, 0.3]),
    lambda x: statistics.NormalDist(0.5, 1.0 / 6.0).inv_cdf(0.5 + 0.49 * x),
)  # fmt: skip
"""What the platform's mathematics decides of a flight"""


def fingerprint() -> str:
    """Equal where the platform computes the functions, and draws the numbers, of which flights are made alike."""
    points = [k / 257.0 for k in range(1, 257)]
    values = [float(function(x)) for function in FUNCTIONS for x in points]
    values += np.random.Generator(np.random.PCG64(np.random.SeedSequence(1))).standard_normal(1000).tolist()
    values += np.rint(np.array(points) * 100.0).tolist()
    return hashlib.sha256(np.array(values).tobytes()).hexdigest()


def scenario_of(tables: dict[str, Any]) -> Scenario:
    """A scenario of the table."""
    return scenario_from_tables(tables, Path())


def simulated(tables: dict[str, Any]) -> Result:
    """Its flight."""
    return quadcosim.run(scenario_of(tables))


def entry(result: Result, known: Collection[str]) -> dict[str, Any]:
    """What the table says of a flight, of the columns that are known to it: variables may have come since."""
    own = [i for i, column in enumerate(result.columns) if column in known]
    rows = np.ascontiguousarray(result.rows[:, own])
    events = "\n".join(f"{event.time} {event.kind} {event.what} {event.sample}" for event in result.events)
    columns = [result.columns[i] for i in own]
    return {
        "columns": hashlib.sha256("\n".join(columns).encode()).hexdigest(),
        "rows": hashlib.sha256(rows.tobytes()).hexdigest(),
        "events": hashlib.sha256(events.encode()).hexdigest(),
        "number_of_rows": len(rows),
        "number_of_events": len(result.events),
        "last": dict(zip(columns, rows[-1].tolist(), strict=True)),
        "divergence_time": result.metrics["divergence_time"],
    }


def flights() -> list[tuple[str, dict[str, Any]]]:
    """Names and entries of the table."""
    return list(json.loads(TABLE.read_text(encoding="utf-8"))["flights"].items())


def main() -> None:
    """Write the table of what is simulated now."""
    found = {
        name: {"scenario": old["scenario"], **entry(simulated(old["scenario"]), old["last"])} for name, old in flights()
    }
    table = {"fingerprint": fingerprint(), "flights": found}
    TABLE.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
