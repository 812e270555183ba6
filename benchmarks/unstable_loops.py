"""Searches for certificates that cannot exist, and altered certificates: `python -m benchmarks.unstable_loops`.

A hundred loops, each a thousandth beyond the value at which a periodic sequence breaks it: fifty pairs of random
matrices, and fifty random plants under a quadratic regulator whose commands are late. The same loops below that value,
and how many of them are certified; and the checks of one certificate after single numbers were altered.
"""

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.theory.certificates.breaking import least_breaking
from orchestration.theory.certificates.certificate import Certificate, read_certificate
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.find_certificate import find_certificate
from orchestration.theory.certificates.verify_certificate import verified
from tests.orchestration.theory.certificates.loops import HOVER_A, HOVER_B, HOVER_F, late_command, switched

EACH = 50
"""loops of either kind"""
BEYOND, BELOW = 1.001, 0.9
"""relative to the value that breaks a loop"""
ALTERED = 80
"""numbers that are increased by 10 %"""


def main() -> None:
    """Print how many are certified beyond the breaking value, and below it."""
    for name, loops in (("two matrices in any order", _switched()), ("late commands", _late())):
        beyond, below = 0, 0
        for too_much, less in loops:
            beyond += find_certificate(too_much, ["benchmark"]) is not None
            below += find_certificate(less, ["benchmark"]) is not None
        print(f"{name}: certified {beyond} of {EACH} that are unstable, {below} of {EACH} a tenth below", flush=True)
    found = find_certificate(late_command(HOVER_A, HOVER_B, HOVER_F, 0.06, 0.019), ["benchmark"])
    assert found is not None
    print(f"one number of {ALTERED} altered: {_rejected(found.certificate)} rejected, the others prove another loop")


def _switched() -> Iterator[tuple[LoopFamily, LoopFamily]]:
    for seed in range(EACH):
        random = np.random.default_rng(seed)
        pair = [random.normal(size=(3, 3)) for _ in range(2)]
        pair = [m / np.abs(np.linalg.eigvals(m)).max() for m in pair]

        def of_size(size: float, pair=pair) -> LoopFamily:  # type: ignore[no-untyped-def]
            return switched(*[size * m for m in pair])

        broken = least_breaking(of_size, 1.05)
        assert broken is not None
        yield of_size(BEYOND * broken.value), of_size(BELOW * broken.value)


def _late() -> Iterator[tuple[LoopFamily, LoopFamily]]:
    count, seed = 0, 0
    while count < EACH:
        random, seed = np.random.default_rng([1, seed]), seed + 1
        n = int(random.integers(1, 5))
        A, B = random.normal(size=(n, n)), random.normal(size=(n, 1))
        block = expm(np.block([[A, B], [np.zeros((1, n + 1))]]))
        held, moved = block[:n, :n], block[:n, n:]
        P = solve_discrete_are(held, moved, np.eye(n), np.eye(1))
        F = -np.linalg.solve(np.eye(1) + moved.T @ P @ moved, moved.T @ P @ held)

        def up_to(jitter: float, A=A, B=B, F=F) -> LoopFamily:  # type: ignore[no-untyped-def]
            return late_command(A, B, F, 1.0, jitter)

        broken = least_breaking(up_to, 0.99)
        if broken is not None:
            count += 1
            yield up_to(BEYOND * broken.value), up_to(BELOW * broken.value)


def _rejected(certificate: Certificate) -> int:
    """How often the checker rejects a certificate with one number, of matrices or forms, increased by 10 %."""
    random, rejected = np.random.default_rng(0), 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "altered.json"
        for _ in range(ALTERED):
            document = json.loads(certificate.to_json())
            tables = [*document["matrices"].values(), *(each["form"] for each in document["forms"])]
            places = [(t, i, j) for t in tables for i, row in enumerate(t) for j, x in enumerate(row) if x]
            table, i, j = places[random.integers(len(places))]
            table[i][j] *= 1.1
            path.write_text(json.dumps(document), encoding="utf-8")
            try:
                verified(read_certificate(path))
            except QuadcosimError:
                rejected += 1
    return rejected


if __name__ == "__main__":
    main()
