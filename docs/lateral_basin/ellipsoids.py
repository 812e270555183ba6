"""The proved ellipsoids by period, in `data/ellipsoids.json`: the rows of R in |R x| ≤ 1."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats

FILE = Path(__file__).parent / "data" / "ellipsoids.json"


def read_ellipsoid(period: float) -> Floats:
    """R, shape (6, 6); raises `UsageError` for a period without a stored ellipsoid."""
    known = _all()
    if f"{period:g}" not in known:
        raise UsageError(f"period {period:g}: expected one of {', '.join(known)}; others are searched with --search")
    return np.array(known[f"{period:g}"])


def write_ellipsoid(period: float, R: Floats) -> None:
    """Store an ellipsoid, replacing that of the same period."""
    known = {**_all(), f"{period:g}": R.tolist()}
    rows = ",\n".join(f'"{each}": [\n' + ",\n".join(map(str, R)) + "\n]" for each, R in sorted(known.items()))
    FILE.write_text(f"{{\n{rows}\n}}\n", encoding="utf-8")


def _all() -> dict[str, list[list[float]]]:
    if not FILE.exists():
        return {}
    found: dict[str, list[list[float]]] = json.loads(FILE.read_text(encoding="utf-8"))
    return found
