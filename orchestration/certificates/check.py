"""A certificate's file looked at again: what it proves, and whether that is about a system."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.extras import needs
from orchestration.basics.simulator import Floats
from orchestration.certificates.causes import Caused
from orchestration.certificates.certificate import Certificate, read_certificate
from orchestration.certificates.family import Family
from orchestration.certificates.margin import cause_in, expect_unshared, measured, varying_of
from orchestration.certificates.timeline import LOSS, Timeline, Varying
from orchestration.requests.request import RequestLike, request_of
from orchestration.stability.known_loops import rested

ROUNDING = 1e-12
"""of the largest entry of a row: what may be left of a zero"""


class AnotherLoop(UsageError):
    """A certificate proves something of another loop than that of the system."""


@dataclass(frozen=True, kw_only=True)
class Checked:
    """What a certificate was found to prove, made of its numbers."""

    ranges: dict[str, tuple[tuple[float, float], ...]]
    """By what may happen in a period: the ranges of its values [s]."""
    runs: dict[str, int | None]
    """How often each of that may happen in a row; None: for ever."""
    states: int
    """Numbers that go from one period to the next."""
    radius: float
    """Relative: the proof is for all matrices that are as near as that."""
    of: tuple[str, ...]
    """The paths that vary in the system that it was compared with; none if it was compared with none."""
    up_to: float | None = None
    """Of a path of a computer or a network: the largest value [s] that makes the loop no later than these ranges."""


@needs("flint")
def check(path: str | Path, asked: RequestLike | None = None) -> Checked:
    """Verify the certificate of a file, and, with a system, that its matrices are those of that system's loop.

    Raises `QuadcosimError` for a certificate that proves nothing, `UsageError` for a file that is none and for one of
    another loop.
    """
    from orchestration.certificates.checker import proven

    certificate = read_certificate(Path(path))
    found, up_to = proven(certificate), None
    if asked is not None:
        request = request_of(asked)
        cause = cause_in(request, certificate.of[0]) if len(certificate.of) == 1 else None
        if cause is None:
            expect_unshared(request)
            varying = [varying_of(request, of) for of in certificate.of]
            family = _as_long(certificate, Timeline(measured(request), varying), varying)
        else:
            caused = Caused(measured(request), rested(request), cause)
            up_to = caused.value_of(certificate.family)
            family = caused.family(up_to)
        expect_of(certificate, family)
    return Checked(
        ranges=found.ranges, runs=found.runs, states=found.states, radius=found.radius,
        of=() if asked is None else certificate.of, up_to=up_to,
    )  # fmt: skip


def _as_long(certificate: Certificate, timeline: Timeline, varying: list[Varying]) -> Family | None:
    """The family of a system for the ranges and runs of a certificate; None: it has none."""
    own = certificate.family
    timed = sum(each.kind != LOSS for each in varying)
    if any(len(letter.ranges) != timed for letter in own.letters):
        raise AnotherLoop("the certificate varies something else than the paths that it names")
    most = own.largest()
    run = max(len(letter.moves) for letter in own.letters) - 1  # what arrives does after any number of losses
    return timeline.family(most, run=run) if not most or sum(most) <= timeline.largest() else None


def expect_of(certificate: Certificate, family: Family | None) -> None:
    """Raise `AnotherLoop` where a certificate is not of that family, within the radius that its proof covers."""
    own = certificate.family
    if family is None or (family.kept, family.letters) != (own.kept, own.letters):
        raise AnotherLoop("what happens in a period of the system is something else than in the certificate")
    if family.matrices.keys() != own.matrices.keys():
        raise AnotherLoop("the system has other matrices than the certificate")
    for name, theirs in family.matrices.items():
        if not _is_within(own.matrices[name], theirs, certificate.radius):
            raise AnotherLoop(f"{name}: the system's matrix is farther from the certificate's than the proof covers")


def _is_within(own: Floats, theirs: Floats, radius: float) -> bool:
    """Whether a matrix is in the set that the checker proves something of."""
    from orchestration.certificates.checker import OF_THE_LARGEST

    if own.shape != theirs.shape:
        return False
    largest = np.abs(own).max(axis=1, keepdims=True)
    exact = (np.count_nonzero(own, axis=1) == 1)[:, None] & (own.sum(axis=1, keepdims=True) == 1.0)
    wide = np.where((own != 0.0) & ~exact, radius * (np.abs(own) + OF_THE_LARGEST * largest), ROUNDING * largest)
    return bool((np.abs(own - theirs) <= wide).all())
