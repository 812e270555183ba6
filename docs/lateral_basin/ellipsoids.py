"""The ellipsoids that were proved, by period, in `data/ellipsoids.json`: the rows of R of |R x| ≤ 1."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats

FILE = Path(__file__).parent / "data" / "ellipsoids.json"


def kept(period: float) -> Floats:
    """R, shape (6, 6); raises `UsageError` for a period of which nothing is kept."""
    known = _all()
    if f"{period:g}" not in known:
        raise UsageError(f"period {period:g}: expected one of {', '.join(known)}; others are looked for with --search")
    return np.array(known[f"{period:g}"])


def keep(period: float, R: Floats) -> None:
    """Write it down, in the place of what there was for this period."""
    known = {**_all(), f"{period:g}": R.tolist()}
    rows = ",\n".join(f'"{each}": [\n' + ",\n".join(map(str, R)) + "\n]" for each, R in sorted(known.items()))
    FILE.write_text(f"{{\n{rows}\n}}\n", encoding="utf-8")


def _all() -> dict[str, list[list[float]]]:
    if not FILE.exists():
        return {}
    found: dict[str, list[list[float]]] = json.loads(FILE.read_text(encoding="utf-8"))
    return found
